"""What a process does first in which a stranger's file is read: it takes its limits, and ends with the viewer.

It is told what to do by one line of JSON on standard input. Nothing here imports a library, so that the limits hold
before any is loaded.
"""

from __future__ import annotations

import json
import resource
import sys
from typing import Any

TOO_LARGE = "unpacks to more than a visitor's file may have here"
TOO_MUCH_MEMORY = "needs more memory than a visitor's file may have here"


def told_and_limited() -> dict[str, Any]:
    """What this process is to do; from here on it has the limits that it was told."""
    told: dict[str, Any] = json.loads(sys.stdin.readline())
    _limit(told["memory"], told["seconds"], told["bytes"])

    from etnet.child_process import end_with_parent

    end_with_parent()
    return told


def _limit(memory: int, seconds: int, written: int) -> None:
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    resource.setrlimit(resource.RLIMIT_AS, (memory, memory))
    resource.setrlimit(resource.RLIMIT_CPU, (seconds, seconds + 1))
    resource.setrlimit(resource.RLIMIT_FSIZE, (written, written))

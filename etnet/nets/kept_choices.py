"""What was measured on this machine, kept in the user's cache: one small JSON file, replaced whole."""

from __future__ import annotations

import contextlib
import hashlib
import json
import platform
from functools import lru_cache
from pathlib import Path
from typing import Any

from etnet.errors import EtnetError
from etnet.files import cache_folder, write_atomically

MAX_CHOICES = 500
"""Beyond it those that were kept first go."""


def kept_choice(name: str) -> dict[str, Any] | None:
    """What was kept under `name` for this processor, number of threads and version of torch; `None` for nothing."""
    found = _read().get(_key(name))
    return found if isinstance(found, dict) else None


def keep_choice(name: str, choice: dict[str, Any]) -> None:
    """Keep it. Where the folder cannot be written nothing is kept, and the next run measures again."""
    with contextlib.suppress(OSError, EtnetError):
        path = choices_file()
        path.parent.mkdir(parents=True, exist_ok=True)
        content = {**_read(), _key(name): choice}
        while len(content) > MAX_CHOICES:
            del content[next(iter(content))]
        write_atomically(path, json.dumps(content, indent=1).encode(), flushes=False)


def choices_file() -> Path:
    """Where the choices lie."""
    return cache_folder() / "measured.json"


@lru_cache(maxsize=1)
def processor_name() -> str:
    """The processor's model name, or its architecture where the system does not tell."""
    with contextlib.suppress(OSError):
        for line in Path("/proc/cpuinfo").read_text().splitlines():
            if line.startswith("model name"):
                return line.partition(":")[2].strip()
    return platform.processor() or platform.machine()


def _key(name: str) -> str:
    import torch

    from etnet.nets.runtime import isa_of_machine

    machine = f"{processor_name()}|{isa_of_machine()}|{torch.get_num_threads()}|{torch.__version__}"
    return hashlib.sha256(f"{machine}|{name}".encode()).hexdigest()[:24]


def _read() -> dict[str, Any]:
    try:
        content = json.loads(choices_file().read_bytes())
    except (OSError, ValueError):
        return {}
    return content if isinstance(content, dict) else {}

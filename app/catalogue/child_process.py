"""Starts, ends and judges the processes in which strangers' files are read."""

from __future__ import annotations

import contextlib
import json
import os
import signal
import subprocess
import sys
from pathlib import Path
from typing import Any

from app.catalogue.limited import TOO_LARGE

MEMORY = 3 << 30
"""Bytes of address space; the libraries alone take one."""


def started(script: str, told: dict[str, Any], folder: Path) -> subprocess.Popen[bytes]:
    """A process that runs `script` of this project and was told what to do. Its scratch files lie in `folder`."""
    root = Path(__file__).parents[2]
    search = os.pathsep.join([str(root), *(part for part in sys.path if part)])
    child = subprocess.Popen(
        [sys.executable, "-P", script],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        start_new_session=True,
        env={**os.environ, "PYTHONPATH": search, "TMPDIR": str(folder), "OMP_NUM_THREADS": "1"},
    )
    assert child.stdin is not None
    with contextlib.suppress(BrokenPipeError), child.stdin:
        child.stdin.write(json.dumps({"memory": MEMORY, **told}).encode() + b"\n")
    return child


def end(child: subprocess.Popen[bytes], patience: float = 1.0) -> None:
    """Whatever it does, and all that it started. One that is at its end has `patience` seconds for it."""
    with contextlib.suppress(subprocess.TimeoutExpired):
        child.wait(timeout=patience if child.poll() is None else 0)
    with contextlib.suppress(ProcessLookupError, PermissionError):
        os.killpg(child.pid, signal.SIGKILL)
    child.wait()


def why_it_ended(code: int) -> str:
    """The words for a process that ended without any of its own."""
    if code in (-signal.SIGXCPU, -signal.SIGKILL):
        return "takes more computing than a visitor's file may take here"
    if code == -signal.SIGXFSZ:
        return TOO_LARGE
    return "ended the process that read it; it may be damaged"

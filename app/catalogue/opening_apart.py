"""Opens a stranger's file in a process of its own, with limits: a crash, or too much of anything, is one sentence.

What comes back is a recording that our own writer wrote, beside the file; events, stamps and the camera's frames are
the file's, what the plain layout cannot hold is told.
"""

from __future__ import annotations

import contextlib
import json
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import asdict
from pathlib import Path
from queue import Empty, SimpleQueue
from typing import Any

from app.catalogue import opening_child
from etnet.errors import Cancelled, RecordingError
from etnet.events.assumptions import Assumptions
from etnet.events.recording import Remark
from etnet.plain_values import PlainError, bounded_json, fitted

MEMORY = 3 << 30
"""Bytes of address space; the libraries alone take one."""
SECONDS = 60
"""Of CPU time."""
PATIENCE = 120.0
"""Seconds by the clock."""
MOST_AT_ONCE = 2
"""Children of all visitors together; the next file waits."""
_ASK_EVERY = 0.2
_LONGEST_LINE = 100_000
_KINDS = ("detected", "repaired", "assumed", "advice")
_room = threading.Semaphore(MOST_AT_ONCE)


def open_apart(
    path: Path,
    assume: Assumptions,
    largest: int,
    progress: Callable[[float], None],
    is_wanted: Callable[[], bool],
    seconds: int = SECONDS,
) -> tuple[Path, tuple[Remark, ...]]:
    """A plain recording of what lies in `path`, beside it, and what was noticed.

    `largest`: bytes that it may have. It ends when `is_wanted` says no, or `progress` raises.

    Raises:
        RecordingError: the file cannot be read, or not within the limits.
        Cancelled: its visitor has gone.
    """
    out = path.with_name(f"{path.stem}.opened.h5")
    if out.exists():
        out.unlink()
    told = {
        "path": str(path), "out": str(out), "assume": asdict(assume), "memory": MEMORY, "seconds": seconds,
        "bytes": largest,
    }  # fmt: skip
    while not _room.acquire(timeout=_ASK_EVERY):
        if not is_wanted():
            raise Cancelled("its visitor has gone")
    try:
        said = _run(told, progress, is_wanted, path.parent)
    finally:
        _room.release()
    if "failed" in said:
        raise RecordingError(said["failed"])
    return out, _remarks(said.get("remarks"))


def _run(
    told: dict[str, Any], progress: Callable[[float], None], is_wanted: Callable[[], bool], folder: Path
) -> dict[str, Any]:
    root = Path(opening_child.__file__).parents[2]
    search = os.pathsep.join([str(root), *(part for part in sys.path if part)])
    child = subprocess.Popen(
        [sys.executable, "-P", opening_child.__file__],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        start_new_session=True,
        # Scratch files lie in the visitor's folder, and go with it.
        env={**os.environ, "PYTHONPATH": search, "TMPDIR": str(folder), "OMP_NUM_THREADS": "1"},
    )
    said: dict[str, Any] = {}
    ends = time.monotonic() + PATIENCE
    try:
        assert child.stdin is not None
        with contextlib.suppress(BrokenPipeError), child.stdin:
            child.stdin.write(json.dumps(told).encode() + b"\n")
        for words in _lines(child):
            if not is_wanted():
                raise Cancelled("its visitor has gone")
            if time.monotonic() > ends:
                raise RecordingError(
                    f"{Path(told['path']).name}: reading took more than {PATIENCE:.0f} s; it was stopped"
                )
            share = words.pop("share", None)
            if isinstance(share, int | float) and 0 <= share <= 1:
                progress(float(share))
            said |= words
    finally:
        _end(child)
    if child.returncode != 0 and "failed" not in said:
        said["failed"] = f"{Path(told['path']).name}: {_why(child.returncode)}"
    elif "failed" in said:
        said["failed"] = str(said["failed"])[:500].replace("\n", " ")
    return said


def _lines(child: subprocess.Popen[bytes]) -> Iterator[dict[str, Any]]:
    """What the child says, and {} every now and then, until it has ended."""
    heard: SimpleQueue[bytes | None] = SimpleQueue()

    def listen() -> None:
        assert child.stdout is not None
        with child.stdout:
            while line := child.stdout.readline(_LONGEST_LINE):
                heard.put(line)
        heard.put(None)

    threading.Thread(target=listen, daemon=True, name="opening").start()
    while True:
        try:
            line = heard.get(timeout=_ASK_EVERY)
        except Empty:
            yield {}
            continue
        if line is None:
            return
        try:
            words = bounded_json(line, _LONGEST_LINE)
        except PlainError:
            continue
        if isinstance(words, dict):
            yield words


def _end(child: subprocess.Popen[bytes]) -> None:
    """Whatever it does, and all that it started."""
    with contextlib.suppress(subprocess.TimeoutExpired):
        child.wait(timeout=1.0 if child.poll() is None else 0)
    with contextlib.suppress(ProcessLookupError, PermissionError):
        os.killpg(child.pid, signal.SIGKILL)
    child.wait()


def _why(code: int) -> str:
    if code in (-signal.SIGXCPU, -signal.SIGKILL):
        return "takes more computing than a visitor's file may take here"
    if code == -signal.SIGXFSZ:
        return "unpacks to more than a visitor's file may have here"
    return "ended the process that read it; it may be damaged"


def _remarks(said: object) -> tuple[Remark, ...]:
    try:
        pairs = fitted(tuple[tuple[str, str], ...], said)
    except PlainError:
        return ()
    return tuple(Remark(kind, text) for kind, text in pairs if kind in _KINDS)  # pyright: ignore[reportArgumentType]

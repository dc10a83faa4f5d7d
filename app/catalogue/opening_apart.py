"""Opens a stranger's file in a process of its own, with limits: a crash, or too much of anything, is one sentence.

What comes back is a recording that our own writer wrote, beside the file; events, stamps, the camera's frames, triggers
and motion are the file's, what the plain layout cannot hold is told.
"""

from __future__ import annotations

import glob
import subprocess
import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from queue import Empty, SimpleQueue
from tempfile import TemporaryDirectory
from typing import Any

from app.catalogue import opening_child
from app.catalogue.child_process import end, started, why_it_ended
from app.catalogue.plain_tables import read_tables
from etnet.errors import Cancelled, RecordingError
from etnet.events.assumptions import Assumptions
from etnet.events.recording import Inertial, Recording, Remark
from etnet.events.triggers import Triggers
from etnet.files import sweep_unfinished
from etnet.plain_values import PlainError, bounded_json, fitted

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


@dataclass(frozen=True, eq=False, slots=True)
class OpenedApart:
    """A plain recording at `path`, and what else the file holds or was noticed of it."""

    path: Path
    remarks: tuple[Remark, ...]
    triggers: Triggers | None = None
    inertial: Inertial | None = None

    def remove(self) -> None:
        """Take it from the disk."""
        _remove(self.path)

    def completed(self, plain: Recording) -> Recording:
        """The plain recording with all that."""
        return replace(plain, remarks=self.remarks, opened_as=None, triggers=self.triggers, inertial=self.inertial)


def open_apart(
    path: Path,
    assume: Assumptions,
    largest: int,
    progress: Callable[[float], None],
    is_wanted: Callable[[], bool],
    seconds: int = SECONDS,
) -> OpenedApart:
    """A plain recording of what lies in `path`, beside it.

    `largest`: bytes that it may have. It ends when `is_wanted` says no, or `is_wanted` or `progress` raises; nothing is
    left of it then.

    Raises:
        RecordingError: the file cannot be read, or not within the limits.
        Cancelled: its visitor has gone.
    """
    out = path.with_name(f"{path.stem}.opened.h5")
    _remove(out)
    told = {
        "path": str(path), "out": str(out), "assume": asdict(assume), "seconds": seconds, "bytes": largest,
    }  # fmt: skip
    while not _room.acquire(timeout=_ASK_EVERY):
        if not is_wanted():
            raise Cancelled("its visitor has gone")
    try:
        with TemporaryDirectory(dir=path.parent, ignore_cleanup_errors=True) as scratch:
            said = _run(told, progress, is_wanted, Path(scratch))
        if "failed" in said:
            raise RecordingError(said["failed"])
    except BaseException:
        _remove(out)
        sweep_unfinished(path.parent)
        raise
    finally:
        _room.release()
    return OpenedApart(out, _remarks(said.get("remarks")), *read_tables(out))


def _remove(out: Path) -> None:
    """A recording that was opened apart, and the tables beside it."""
    for made in out.parent.glob(f"{glob.escape(out.stem)}.*"):
        made.unlink(missing_ok=True)


def _run(
    told: dict[str, Any], progress: Callable[[float], None], is_wanted: Callable[[], bool], folder: Path
) -> dict[str, Any]:
    child = started(opening_child.__file__, told, folder)
    said: dict[str, Any] = {}
    ends = time.monotonic() + PATIENCE
    try:
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
        end(child)
    if child.returncode != 0 and "failed" not in said:
        said["failed"] = f"{Path(told['path']).name}: {why_it_ended(child.returncode)}"
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


def _remarks(said: object) -> tuple[Remark, ...]:
    try:
        pairs = fitted(tuple[tuple[str, str], ...], said)
    except PlainError:
        return ()
    return tuple(Remark(kind, text) for kind, text in pairs if kind in _KINDS)  # pyright: ignore[reportArgumentType]

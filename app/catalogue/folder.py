"""A watched folder: which recordings lie in it, and which of them are still being written."""

from __future__ import annotations

import os
from collections import OrderedDict, deque
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from etnet.files import in_megabytes, printable

VIDEO_SUFFIXES = (".mp4", ".mov", ".avi", ".mkv", ".webm", ".m4v")
"""Videos are shown as an event sensor would see them."""
MAX_ENTRIES = 500
"""Recordings listed of a folder."""
MAX_FOLDERS = 10_000
"""Folders looked into: every look, every few seconds, goes through them."""
RESTS = 2.0
"""Seconds for which a file that came or changed must stay as it is before it is offered."""
_KEPT_TURNS = 10_000
_FOLDER_SIGNS = ("events.txt", "events_ts.npy")

Sign = tuple[int, int]
"""Bytes, and the newest change (ns since 1970): what tells that a file is another one than before. (−1, 0): unknown."""


def recordings_in(folder: Path) -> dict[Path, Sign]:
    """What can be a recording, by its path, the upper folders first.

    No link to a folder is followed: it leads in a circle, or out, or to what is found without it. A file may be a link
    if what it leads to lies in `folder` too; a watched folder offers nothing that lies elsewhere.
    """
    from etnet.events.formats.picture_lists import is_beside_events
    from etnet.events.formats.registry import FORMATS

    suffixes = {suffix for entry in FORMATS for suffix in entry.suffixes if suffix} | {*VIDEO_SUFFIXES}
    found: dict[Path, Sign] = {}
    root = os.path.realpath(folder)
    waiting, num_folders = deque([folder]), 1
    while waiting and len(found) < MAX_ENTRIES:
        for path in _inside(waiting.popleft()):
            if path.name.startswith("."):
                continue
            # Path.is_file and its like raise where a folder may not be looked into; these say no.
            if os.path.isdir(path):
                if os.path.islink(path):
                    continue
                if _is_recording(root, path):
                    found[path] = sign_of(path)
                elif num_folders < MAX_FOLDERS:
                    waiting.append(path)
                    num_folders += 1
            elif not lies_in(root, path):
                continue
            elif path.suffix.lower() in suffixes and not is_beside_events(path.name):
                found[path] = sign_of(path)
    return dict(list(found.items())[:MAX_ENTRIES])


def sign_of(path: Path) -> Sign:
    """The sign of a file, or of a folder with what lies in it."""
    try:
        stats = [path.stat(), *(part.stat() for part in (_inside(path) if path.is_dir() else ()))]
    except OSError:
        return -1, 0
    return sum(stat.st_size for stat in stats), max(stat.st_mtime_ns for stat in stats)


def size_of(path: Path) -> str:
    """How large a file is, in words."""
    try:
        size = path.stat().st_size
    except OSError:
        return "cannot be read"
    if path.is_dir():
        return "folder"
    return in_megabytes(size)


def lies_in(root: str | Path, path: Path) -> bool:
    """Whether a file, or what its link leads to, is below `root`."""
    return not os.path.islink(path) or Path(os.path.realpath(path)).is_relative_to(root)


def _is_recording(root: str, folder: Path) -> bool:
    """Whether a folder is one recording by the names in it: a sign of its format, or its columns as npy files."""
    from etnet.events.formats.arrays.npy import folder_prefixes

    told = [each for each in _inside(folder) if each.name in _FOLDER_SIGNS or each.suffix.lower() == ".npy"]
    names = tuple(each.name for each in told if lies_in(root, each) and os.path.isfile(each))
    return any(sign in names for sign in _FOLDER_SIGNS) or "" in folder_prefixes(names)


def _inside(folder: Path) -> list[Path]:
    try:
        return sorted(folder.iterdir())
    except OSError:
        return []  # a folder we may not look into holds nothing for us


@dataclass(slots=True)
class _Seen:
    sign: Sign
    since: float


class Watch:
    """What of a folder is offered. What is there at first is; what comes or changes later is, once it rests.

    `offered` holds, by path, how often the file was another one before: what was computed of the former is not its.
    """

    def __init__(self, found: Mapping[Path, Sign]) -> None:
        self._seen = {path: _Seen(sign, 0.0) for path, sign in found.items()}
        self._turns: OrderedDict[Path, int] = OrderedDict((path, 0) for path in found)
        self.offered: dict[Path, int] = dict(self._turns)
        self.growing: tuple[str, ...] = ()
        """Names of the files that came or changed less than `RESTS` ago."""

    def look(self, found: Mapping[Path, Sign], now: float) -> bool:
        """Take in what lies there `now` (seconds of any steady clock); whether what is offered has changed."""
        offered: dict[Path, int] = {}
        growing: list[str] = []
        seen: dict[Path, _Seen] = {}
        for path, sign in found.items():
            before = self._seen.get(path)
            is_same = before is not None and before.sign == sign
            seen[path] = before if before is not None and is_same else _Seen(sign, now)
            if is_same and (path in self.offered or now - seen[path].since >= RESTS):
                offered[path] = self.offered.get(path, self._turn(path))
            else:
                growing.append(printable(path.name))
        is_news = offered != self.offered
        for path, turn in offered.items():
            self._turns[path] = turn
            self._turns.move_to_end(path)
        while len(self._turns) > _KEPT_TURNS:
            self._turns.popitem(last=False)
        self._seen, self.offered, self.growing = seen, offered, tuple(growing)
        return is_news

    def _turn(self, path: Path) -> int:
        return self._turns[path] + 1 if path in self._turns else 0

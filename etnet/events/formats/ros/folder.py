"""The parts of a ROS 2 folder, in the order in which they were recorded."""

from __future__ import annotations

import re

from etnet.errors import RecordingError
from etnet.events.formats.archive import FolderStore, read_small
from etnet.events.formats.base import Remarks, Request

SUFFIXES = (".mcap", ".db3")
_METADATA = "metadata.yaml"
_ITEM = re.compile(r"\s*-\s+(.*)")


def parts_in_order(request: Request, remarks: Remarks) -> list[str]:
    """Names within the folder: as the recorder lists them, else by the number at the end of the name."""
    there = [name for name in request.members if name.endswith(SUFFIXES)]
    stated = _stated(request)
    listed = [name for path in stated if (name := _found(path, there)) is not None]
    if not listed:
        return sorted(there, key=_by_number)
    missing = [path for path in stated if _found(path, there) is None]
    if missing:
        remarks.detected(f"{len(missing)} parts that {_METADATA} names are missing, the first one {missing[0][-80:]}")
    unlisted = [name for name in there if name not in listed]
    if unlisted:
        remarks.detected(f"{', '.join(unlisted[:5])}: not in the list of {_METADATA}, left out")
    return list(dict.fromkeys(listed))


def _stated(request: Request) -> list[str]:
    """The list `relative_file_paths` as it stands. The file is anyone's, so it is read by line and nothing is built."""
    if _METADATA not in request.members:
        return []
    try:
        text = read_small(FolderStore(request.path), _METADATA, request.name).decode("utf-8", "replace")
    except (OSError, RecordingError):
        return []
    _, _, after = text.partition("relative_file_paths:")
    names: list[str] = []
    for line in after.splitlines()[1:]:
        item = _ITEM.fullmatch(line)
        if item is None:
            break
        names.append(item[1].strip().strip("\"'"))
    return names


def _found(path: str, there: list[str]) -> str | None:
    """The part of that name; older recorders put the folder's own name before it."""
    name = path.rsplit("/", 1)[-1]
    return name if name in there else None


def _by_number(name: str) -> tuple[list[tuple[int, str]], str]:
    """Numbers by value, so that 2 comes before 10."""
    pieces = re.split(r"(\d+)", name)
    return [(int(piece), "") if piece.isdecimal() else (0, piece) for piece in pieces], name

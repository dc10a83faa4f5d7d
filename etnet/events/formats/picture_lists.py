"""Pictures as files beside the events, and where their stamps stand: a list with names, one stamp a line, or the names.

Layouts: the Event-Camera Dataset's images.txt ("t images/….png"; rpg.ifi.uzh.ch/davis_data), EDS's and DSEC's
timestamps, BS-ERGB's and HS-ERGB's timestamp.txt among the pictures.
"""

from __future__ import annotations

import re
from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass
from decimal import Decimal, InvalidOperation
from itertools import pairwise

import numpy as np

from etnet.errors import RecordingError
from etnet.events.assumptions import TimeUnit
from etnet.events.events import Sensor
from etnet.events.formats.archive import Store, read_small
from etnet.events.formats.base import Remarks
from etnet.events.formats.bounds import check_picture
from etnet.events.formats.camera_frames import picture_numbers
from etnet.events.formats.column_names import named_axis
from etnet.events.formats.frames import Frames

PICTURES = (".png", ".jpg", ".jpeg", ".bmp", ".tif", ".tiff", ".webp", ".pgm", ".ppm")

_LISTS = re.compile(r"^((images?|frames?|pictures?|rgb|aps|img)?_?(list|ts|times?|(time_?)?stamps?)?)\.(txt|csv)$")
_BESIDE_EVENTS = ("calib.txt", "groundtruth.txt", "imu.txt", "readme.txt", "license.txt")
OWN_FRAMES = ".etnet-frames"
"""Beside frames that `etnet reconstruct` wrote, and their stamps: no camera took them."""
_OWN = re.compile(r"(frames|cam0)/[^/]*\.png|stamps\.csv")
_NO_PICTURES = ("flow", "depth", "mask", "label", "disparity", "visual", "plot")
_FEWEST_DIGITS = 10
"""Of a picture's name that is its stamp; a number that counts pictures is shorter."""


@dataclass(frozen=True)
class _List:
    """Stamps as they stand in a list, and the names beside them (none where there is one stamp a line)."""

    member: str
    stamps: list[Decimal]
    files: list[str]
    unit: TimeUnit | None


def pictures_beside(store: Store, prefix: str, label: str, remarks: Remarks, max_pixels: int) -> Frames | None:
    """The pictures under `prefix` ("" or "a/b/") with their stamps; what cannot be shown is said."""
    inside = [name for name in _without_own(store.names()) if name.startswith(prefix)]
    folders: dict[str, list[str]] = defaultdict(list)
    for name in inside:
        if name.lower().endswith(PICTURES) and not _is_computed(name, prefix):
            folders[name.rpartition("/")[0]].append(name)
    lists = [name for name in inside if is_list(name.rpartition("/")[2])]
    # A recording's folder may be called "depth", and then all that is in it.
    lists = [name for name in lists if not _is_computed(name, prefix)] or lists
    for member in sorted(lists, key=lambda name: (name.count("/"), not name.endswith("images.txt"), name)):
        listed = _read_list(store, member, label)
        files = _named(listed, prefix, inside, remarks) if listed.files else _counted(listed, folders, remarks)
        if files is not None:
            return _frames(store, files[0], files[1], listed.unit, label, max_pixels)
    return _by_name(store, folders, label, remarks, max_pixels)


def is_list(name: str) -> bool:
    """Whether a file's name is one that lists of pictures have: it holds no events."""
    return _LISTS.match(name.lower()) is not None


def is_beside_events(name: str) -> bool:
    """Whether a file lies beside events and holds none, by its name: a list of pictures, poses, a licence."""
    return name.lower() in _BESIDE_EVENTS or is_list(name)


def _without_own(names: Sequence[str]) -> list[str]:
    own = [name.removesuffix(OWN_FRAMES) for name in names if name.rpartition("/")[2] == OWN_FRAMES]
    return [
        name
        for name in names
        if not any(name.startswith(folder) and _OWN.fullmatch(name[len(folder) :]) for folder in own)
    ]


def _is_computed(name: str, prefix: str) -> bool:
    """Whether a file belongs to what is no camera's picture, by its path under `prefix`."""
    return any(word in name[len(prefix) :].lower() for word in _NO_PICTURES)


def _read_list(store: Store, member: str, label: str) -> _List:
    rows: list[list[Decimal | None]] = []
    files: list[str] = []
    unit: TimeUnit | None = None
    place: int | None = None
    text = read_small(store, member, label).decode("utf-8-sig", "replace")
    for number, line in enumerate(text.splitlines(), 1):
        tokens = [token.strip("\"'") for token in re.split(r"[\s,;]+", line.strip()) if token]
        row = [_number(token) for token in tokens]
        is_without = all(value is None for value in row)
        if not tokens or tokens[0].startswith("#") or (is_without and not rows):
            unit, named = unit or _named_unit(line), _named_place(line)
            place = place if named is None or rows else named
            continue
        file = next((token for token in tokens if token.lower().endswith(PICTURES)), None)
        if is_without or (file is None and files) or (file is None and len(tokens) > 3):
            raise RecordingError(
                f'{label}: line {number} of {member} reads "{line.strip()[:60]}"; wanted a stamp and a picture\'s name'
            )
        rows.append(row)
        files += [] if file is None else [file.replace("\\", "/")]
    return _List(member, _stamps(rows, place), files, unit)


def _stamps(rows: list[list[Decimal | None]], named: int | None) -> list[Decimal]:
    """The number of each row at the place that the head names, else the first that does not merely count the rows."""
    if named is not None:
        there = [value for row in rows if named < len(row) and (value := row[named]) is not None]
        if len(there) == len(rows):
            return there
    values = [[value for value in row if value is not None] for row in rows]
    has_two = len(rows) > 1 and all(len(row) > 1 for row in values)
    counts_rows = has_two and all(later[0] - row[0] == 1 for row, later in pairwise(values))
    return [row[1 if counts_rows else 0] for row in values]


def _named_place(line: str) -> int | None:
    """Which column the head calls the stamps; its names may hold blanks where something else divides them."""
    words = re.split(r"[,;]|\s{2,}|\t", line.strip("# \t"))
    words = line.strip("# \t").split() if len(words) == 1 else words
    named = [named_axis(word) for word in words]
    return next((place for place, found in enumerate(named) if found is not None and found[0] == "t"), None)


def _named_unit(line: str) -> TimeUnit | None:
    named = (named_axis(word.strip("# ")) for word in re.split(r"[,;]|\s{2,}|\t", line))
    return next((found[1] for found in named if found is not None and found[1] is not None), None)


def _named(listed: _List, prefix: str, inside: list[str], remarks: Remarks) -> tuple[list[Decimal], list[str]] | None:
    """Names are looked for beside the list, under the events' folder, in images/, then by themselves anywhere."""
    there, folder = set(inside), listed.member.rpartition("/")[0]
    beside = folder + "/" if folder else ""
    alone: dict[str, list[str]] = defaultdict(list)
    for name in inside:
        alone[name.rpartition("/")[2]].append(name)
    stamps, files = [], []
    for stamp, file in zip(listed.stamps, listed.files, strict=True):
        plain = file.removeprefix("./")
        last = alone.get(plain.rpartition("/")[2], [])
        candidates = [beside + plain, prefix + plain, prefix + "images/" + plain, *(last if len(last) == 1 else [])]
        found = next((name for name in candidates if name in there), None)
        if found is not None:
            stamps.append(stamp)
            files.append(found)
    missing = len(listed.files) - len(files)
    if missing:
        table = listed.member.rpartition("/")[2]
        remarks.repaired(f"{missing} pictures that {table} names are missing and were left out")
    return (stamps, files) if files else None


def _counted(listed: _List, folders: dict[str, list[str]], remarks: Remarks) -> tuple[list[Decimal], list[str]] | None:
    """The folder with as many pictures as there are stamps: the list's own first, then left before right."""
    own = listed.member.rpartition("/")[0]
    fitting = [folder for folder, files in folders.items() if len(files) == len(listed.stamps)]
    if not listed.stamps or not fitting:
        if folders and listed.stamps:
            counts = ", ".join(
                f"{folder or 'the folder'} {len(files)}" for folder, files in sorted(folders.items())[:4]
            )
            remarks.repaired(
                f"{listed.member} has {len(listed.stamps)} stamps, no folder has as many pictures ({counts}); "
                "the pictures were left out"
            )
        return None
    folder = min(fitting, key=lambda name: (name != own, not name.startswith(own), "right" in name, name))
    remarks.detected(f"the stamps of the {len(listed.stamps)} pictures in {folder} are in {listed.member}")
    return listed.stamps, sorted(folders[folder])


def _by_name(
    store: Store, folders: dict[str, list[str]], label: str, remarks: Remarks, max_pixels: int
) -> Frames | None:
    """Pictures that are named by their stamps; any others are said not to be shown."""
    for folder, files in sorted(folders.items()):
        names = [name.rpartition("/")[2].rpartition(".")[0] for name in files]
        if all(name.isdigit() and len(name) >= _FEWEST_DIGITS for name in names):
            remarks.assumed(f"the {len(files)} pictures in {folder or 'the folder'} are named by their stamps")
            return _frames(store, [Decimal(name) for name in names], files, None, label, max_pixels)
    count = sum(map(len, folders.values()))
    if count and not any("pictures" in remark.text for remark in remarks.kept):
        remarks.detected(f"{count} pictures have no list of stamps, such as images.txt, and are not shown")
    return None


def _frames(
    store: Store, stamps: list[Decimal], files: list[str], unit: TimeUnit | None, label: str, max_pixels: int
) -> Frames:
    height, width = check_picture(read_small(store, files[0], label), f"{label}: {files[0]}", max_pixels)
    has_fractions = any(stamp != stamp.to_integral_value() or stamp.as_tuple().exponent != 0 for stamp in stamps)

    def read_raw(index: int) -> np.ndarray:
        return picture_numbers(read_small(store, files[index], label), f"{label}: {files[index]}", max_pixels)

    usual: TimeUnit = unit or ("s" if has_fractions else "us")
    return Frames(stamps, usual, read_raw, Sensor(width, height), is_bgr=True)


def _number(token: str) -> Decimal | None:
    try:
        value = Decimal(token)
    except InvalidOperation:
        return None
    return value if value.is_finite() and abs(value.adjusted()) < 40 else None

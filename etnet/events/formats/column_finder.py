"""Finds the events in a tree of arrays, whatever container it is in: HDF5, npz, npy, MATLAB.

Columns under known names in one group, records with named fields, or a table of four columns; left before right.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Protocol, runtime_checkable

import numpy as np

from etnet.errors import RecordingError
from etnet.events.assumptions import TimeUnit
from etnet.events.formats.base import Remarks
from etnet.events.formats.column_names import column_keys, named_axis
from etnet.events.formats.table_order import table_order

_EVENT_WORDS = ("event", "evs", "evt", "dvs", "cd", "td", "prophesee", "davis", "arr", "stream")
_OTHER_WORDS = ("em", "aps", "imu", "trigger", "label", "labels", "bbox", "box", "noise", "flow", "pose")
_RIGHT_WORDS = ("right", "cam1", "camera1", "1")
_FEWEST_ROWS = 64
"""Of a table that is called nothing like events; a matrix of a calibration has fewer."""
_SAMPLES = 8
_SAMPLE = 512


@runtime_checkable
class Column(Protocol):
    """Numbers in memory or in a file, read by slice."""

    def __len__(self) -> int:
        """How many there are."""
        ...

    def __getitem__(self, part: slice, /) -> Any:
        """Some of them, as an array."""
        ...


Columns = dict[str, Column]
"""x, y, t and p."""


@dataclass(frozen=True)
class Leaf:
    """One array: its shape and type are known, it is opened only where it is used."""

    shape: tuple[int, ...]
    dtype: np.dtype
    open: Callable[[], Any]

    @property
    def is_numbers(self) -> bool:
        """Whether it holds numbers or booleans."""
        return self.dtype.kind in "iufb"

    @property
    def is_vector(self) -> bool:
        """Whether it is a row of numbers: all sides but one are 1."""
        return self.is_numbers and bool(self.shape) and int(np.prod(self.shape)) == max(self.shape)

    def is_table(self, num_columns: int) -> bool:
        """Whether it is n × `num_columns`, or the same on its side."""
        return self.is_numbers and len(self.shape) == 2 and num_columns in self.shape


Tree = Mapping[str, Leaf]
"""Arrays by their path, with "/" between groups."""


@dataclass(frozen=True)
class Found:
    """The events' columns, the group or array they are in ("" at the top), the unit that the name of t states."""

    where: str
    columns: Columns
    unit: TimeUnit | None = None
    order: str = ""
    """The order of a table's columns, where that was judged by their values."""


@dataclass(frozen=True)
class _Place:
    """Where events may be, and how to get at them."""

    where: str
    kind: int
    count: int
    open: Callable[[], Found | None]

    def rank(self) -> tuple[bool, bool, bool, int, int, str]:
        """The smaller, the likelier."""
        is_other, is_unnamed, is_right, where = rank_of(self.where)
        return (is_other, is_unnamed, is_right, self.kind, -self.count, where)


def rank_of(path: str) -> tuple[bool, bool, bool, str]:
    """How likely events are in a group of this name, by the name alone: the smaller, the likelier."""
    words = words_of(path)
    is_right = any(word in _RIGHT_WORDS for word in words)
    return (any(word in _OTHER_WORDS for word in words), not _is_named(path), is_right, path)


def _is_named(path: str) -> bool:
    return any(word.startswith(event) for word in words_of(path) for event in _EVENT_WORDS)


def words_of(path: str) -> list[str]:
    """The parts of a path, in lower case."""
    return [word for part in path.lower().split("/") for word in part.replace("-", "_").split("_")]


def find_events(tree: Tree, remarks: Remarks) -> Found | None:
    """The columns at the likeliest place; other places are named. None where there is none."""
    places = sorted([*_groups(tree), *_records(tree), *_tables(tree)], key=_Place.rank)
    for i, place in enumerate(places):
        found = place.open()
        if found is None:
            continue
        if found.where:
            remarks.detected(f"events are in {found.where}")
        others = [other.where or "the top" for other in places[i + 1 :] if other.where != found.where]
        if others:
            said = ", ".join(others[:6])
            remarks.detected(f"{said} {'looks' if len(others) == 1 else 'look'} like events, too; left out")
        return found
    return None


def paths_in(tree: Tree, found: Found) -> set[str]:
    """The arrays that the columns are in: one, or the vectors of a group."""
    if found.where in tree:
        return {found.where}
    prefix = found.where + "/" if found.where else ""
    length = len(found.columns["t"])
    inside = {path for path in tree if path.startswith(prefix) and "/" not in path[len(prefix) :]}
    return {path for path in inside if tree[path].shape and max(tree[path].shape) == length}


def _groups(tree: Tree) -> list[_Place]:
    """Groups in which vectors have the columns' names."""
    members: dict[str, dict[str, Leaf]] = {}
    for path, leaf in tree.items():
        group, _, key = path.rpartition("/")
        is_pair = leaf.is_table(2) and (named_axis(key) or ("",))[0] == "xy"
        if is_pair or (leaf.is_vector and (named_axis(key) or ("",))[0] != "xy"):
            members.setdefault(group, {})[key] = leaf
    found = []
    for group, leaves in members.items():
        keys = column_keys(leaves)
        if keys is not None:
            count = max(leaves[keys["t"]].shape)
            found.append(_Place(group, 0, count, lambda g=group, k=keys, v=leaves: _of_group(g, k, v)))
    return found


def _of_group(group: str, keys: dict[str, str], leaves: dict[str, Leaf]) -> Found:
    opened = {axis: leaves[key].open() for axis, key in keys.items()}
    columns: Columns = {axis: Vector(stored) for axis, stored in opened.items() if axis != "xy"}
    if "xy" in opened:
        pairs = Rows(opened["xy"], 2)
        columns |= {"x": Field(pairs, 0), "y": Field(pairs, 1)}
    named = named_axis(keys["t"])
    return Found(group, columns, None if named is None else named[1])


def _records(tree: Tree) -> list[_Place]:
    """Arrays whose fields have the columns' names."""
    found = []
    for path, leaf in tree.items():
        keys = column_keys(leaf.dtype.names or ())
        if keys is not None and "xy" not in keys and leaf.shape:
            found.append(_Place(path, 1, max(leaf.shape), lambda p=path, k=keys, v=leaf: _of_records(p, k, v)))
    return found


def _of_records(path: str, keys: dict[str, str], leaf: Leaf) -> Found:
    rows = Rows(leaf.open())
    columns: Columns = {axis: Field(rows, key) for axis, key in keys.items()}
    named = named_axis(keys["t"])
    return Found(path, columns, None if named is None else named[1])


def _tables(tree: Tree) -> list[_Place]:
    """Tables of four columns that are called events, or hold nothing else."""
    found = []
    for path, leaf in tree.items():
        is_likely = _is_named(path) or len(tree) == 1 or max(leaf.shape, default=0) >= _FEWEST_ROWS
        if leaf.is_table(4) and leaf.dtype.kind != "b" and is_likely:
            found.append(_Place(path, 2, max(leaf.shape), lambda p=path, v=leaf: _of_table(p, v, len(tree) == 1)))
    return found


def _of_table(path: str, leaf: Leaf, is_alone: bool) -> Found | None:
    rows = Rows(leaf.open(), 4)
    is_named = is_alone or _is_named(path)
    places = sorted({int(place) for place in np.linspace(0, max(0, len(rows) - _SAMPLE), _SAMPLES)})
    order = table_order(np.concatenate([rows[at : at + _SAMPLE] for at in places]), is_named)
    if order is None:
        return None
    return Found(path, {axis: Field(rows, order.index(axis)) for axis in "xytp"}, None, order)


class Vector:
    """A row of numbers, read by slice; its other sides are 1."""

    def __init__(self, stored: Any) -> None:
        self._stored = stored
        self._side = stored.shape.index(max(stored.shape))

    def __len__(self) -> int:
        return self._stored.shape[self._side]

    def __getitem__(self, part: slice) -> np.ndarray:
        start, stop, _ = part.indices(len(self))
        places: list[int | slice] = [0] * len(self._stored.shape)
        places[self._side] = slice(start, stop)
        return np.asarray(self._stored[tuple(places)])


class Rows:
    """Rows of a table of `width` columns, or records; the last ones are kept, for all columns are asked for in turn."""

    def __init__(self, stored: Any, width: int = 1) -> None:
        self._stored = stored
        shape = stored.shape
        self._side = int(shape[1] != width) if width > 1 else shape.index(max(shape))
        self._kept: tuple[slice, np.ndarray] | None = None

    def __len__(self) -> int:
        return self._stored.shape[self._side]

    def __getitem__(self, part: slice) -> np.ndarray:
        start, stop, _ = part.indices(len(self))
        whole = slice(start, stop)
        if self._kept is None or self._kept[0] != whole:
            places: list[int | slice] = [slice(None) if self._stored.ndim == 2 else 0] * self._stored.ndim
            places[self._side] = whole
            block = np.asarray(self._stored[tuple(places)])
            self._kept = whole, block.T if self._side == 1 else block
        return self._kept[1]


@dataclass(frozen=True)
class Field:
    """One column of rows: a number of a table's, or a name of records'."""

    rows: Rows
    key: int | str

    def __len__(self) -> int:
        return len(self.rows)

    def __getitem__(self, part: slice) -> np.ndarray:
        block = self.rows[part]
        return block[:, self.key] if isinstance(self.key, int) else block[self.key].reshape(-1)


def check_lengths(columns: Columns, name: str) -> int:
    """How many events there are; an error where the columns differ."""
    lengths = {axis: len(column) for axis, column in columns.items()}
    if len(set(lengths.values())) != 1:
        said = ", ".join(f"{axis} {length}" for axis, length in lengths.items())
        raise RecordingError(f"{name}: its columns differ in length ({said}); the file is damaged")
    return lengths["t"]

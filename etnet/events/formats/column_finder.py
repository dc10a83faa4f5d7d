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
from etnet.events.formats.column_names import column_keys, named_axis, stated_unit
from etnet.events.formats.column_views import Field, Rows, Vector
from etnet.events.formats.table_order import table_order

_EVENT_WORDS = ("event", "evs", "evt", "dvs", "cd", "td", "prophesee", "davis", "arr", "stream")
_OTHER_WORDS = ("em", "aps", "imu", "trigger", "label", "labels", "bbox", "box", "noise", "flow", "pose")
_RIGHT_WORDS = ("right", "cam1", "camera1", "1")
_FEWEST_ROWS = 64
"""Of a table that is called nothing like events; a matrix of a calibration has fewer."""
_LONGEST_UNIT = 64
"""Bytes of the word for it."""
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
    paths: tuple[str, ...] = ()
    """The arrays that the columns are in."""


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
    named = _groups(tree)
    unnamed = _four_vectors(tree, {place.where for place in named})
    places = sorted([*named, *_records(tree), *_tables(tree), *unnamed], key=_Place.rank)
    for i, place in enumerate(places):
        found = place.open()
        if found is None:
            continue
        if found.where:
            remarks.detected(f"events are in {found.where}")
        others = [called(other.where) for other in places[i + 1 :] if other.where != found.where]
        if others:
            said = ", ".join(others[:6])
            remarks.detected(f"{said} {'looks' if len(others) == 1 else 'look'} like events, too; left out")
        return found
    return None


def called(where: str) -> str:
    """A place in words. EM, of ATIS cameras, has pairs of moments that measure grey levels."""
    if "em" in words_of(where):
        return f"{where} (exposure measurements, whose polarity is no change)"
    return where or "the top"


def _groups(tree: Tree) -> list[_Place]:
    """Groups in which vectors have the columns' names, or have them behind a common word ("left_x", "left_t")."""
    members: dict[str, dict[str, Leaf]] = {}
    for path, leaf in tree.items():
        group, _, key = path.rpartition("/")
        if _is_column(leaf, key):
            members.setdefault(group, {})[key] = leaf
    found = []
    for group, leaves in members.items():
        for prefix, inside in ({"": leaves} if column_keys(leaves) is not None else _by_prefix(leaves)).items():
            keys = column_keys(inside)
            if keys is not None:
                where = "/".join(part for part in (group, prefix.rstrip("_")) if part)
                paths = {axis: f"{group}/{prefix}{key}" if group else prefix + key for axis, key in keys.items()}
                count = max(inside[keys["t"]].shape)
                named = named_axis(keys["t"])
                unit = None if named is None else named[1]
                found.append(_Place(where, 0, count, lambda w=where, p=paths, u=unit: _of_group(w, p, u, tree)))
    return found


def _is_column(leaf: Leaf, key: str) -> bool:
    return leaf.is_table(2) if (named_axis(key) or ("",))[0] == "xy" else leaf.is_vector


def _by_prefix(leaves: Mapping[str, Leaf]) -> dict[str, dict[str, Leaf]]:
    """Arrays whose names begin with the same words, by the rest of their names."""
    found: dict[str, dict[str, Leaf]] = {}
    for key, leaf in leaves.items():
        prefix, dash, rest = key.rpartition("_")
        if prefix and _is_column(leaf, rest):
            found.setdefault(prefix + dash, {})[rest] = leaf
    return found


def _of_group(where: str, paths: dict[str, str], unit: TimeUnit | None, tree: Tree) -> Found:
    opened = {axis: tree[path].open() for axis, path in paths.items()}
    columns: Columns = {axis: Vector(stored) for axis, stored in opened.items() if axis != "xy"}
    if "xy" in opened:
        pairs = Rows(opened["xy"], 2)
        columns |= {"x": Field(pairs, 0), "y": Field(pairs, 1)}
    return Found(where, columns, unit or _unit_beside(paths["t"], tree), paths=tuple(paths.values()))


def _unit_beside(path: str, tree: Tree) -> TimeUnit | None:
    group, slash, _ = path.rpartition("/")
    leaf = tree.get(f"{group}{slash}time_unit")
    is_word = leaf is not None and leaf.shape == () and leaf.dtype.kind in "SU" and leaf.dtype.itemsize <= _LONGEST_UNIT
    return stated_unit(leaf.open()[()]) if leaf is not None and is_word else None


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
    return Found(path, columns, None if named is None else named[1], paths=(path,))


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
    order = table_order(np.concatenate([rows[part] for part in _samples(len(rows))]), is_named)
    if order is None:
        return None
    return Found(path, {axis: Field(rows, order.index(axis)) for axis in "xytp"}, None, order, (path,))


def _samples(count: int) -> list[slice]:
    """A few short slices from the first to the last, which do not overlap."""
    most = min(_SAMPLES, max(1, count // _SAMPLE))
    starts = np.linspace(0, max(0, count - _SAMPLE), most).astype(int).tolist()
    return [slice(start, start + _SAMPLE) for start in starts]


def _four_vectors(tree: Tree, known: set[str]) -> list[_Place]:
    """Four arrays of one length whose names say nothing, as np.savez(file, a, b, c, d) calls them.

    `known`: groups in which names say enough.
    """
    groups: dict[str, list[str]] = {}
    for path, leaf in tree.items():
        if leaf.is_vector and max(leaf.shape) >= _FEWEST_ROWS:
            groups.setdefault(path.rpartition("/")[0], []).append(path)
    found = []
    for group, paths in groups.items():
        counts = {max(tree[path].shape) for path in paths}
        if group not in known and len(paths) == 4 and len(counts) == 1:
            chosen = tuple(sorted(paths))
            found.append(_Place(group, 3, counts.pop(), lambda g=group, p=chosen: _of_four(g, p, tree)))
    return found


def _of_four(group: str, paths: tuple[str, ...], tree: Tree) -> Found | None:
    vectors = [Vector(tree[path].open()) for path in paths]
    parts = _samples(len(vectors[0]))
    sample = np.stack([np.concatenate([vector[part] for part in parts]) for vector in vectors], 1)
    order = table_order(sample, name_is_events=False)
    if order is None:
        return None
    return Found(group, {axis: vectors[order.index(axis)] for axis in "xytp"}, None, order, paths)


def check_lengths(columns: Columns, name: str) -> int:
    """How many events there are; an error where the columns differ."""
    lengths = {axis: len(column) for axis, column in columns.items()}
    if len(set(lengths.values())) != 1:
        said = ", ".join(f"{axis} {length}" for axis, length in lengths.items())
        raise RecordingError(f"{name}: its columns differ in length ({said}); the file is damaged")
    return lengths["t"]

"""An HDF5 file's datasets by their path, without following what a hostile one could point to."""

from __future__ import annotations

import os
from collections.abc import Mapping
from typing import Any

import h5py
import numpy as np

from etnet.events.formats.bounds import check_growth
from etnet.events.formats.column_finder import Leaf
from etnet.events.formats.hdf5.file import dataset, find

MOST_DATASETS = 20_000
_DEEPEST = 8
_LONGEST_TEXT = 1 << 16
"""Bytes beyond which it does not matter how long a text is."""


def tree_of(file: h5py.File, name: str) -> dict[str, Leaf]:
    """All datasets that lie in the file itself. MATLAB's own groups, which begin with "#", are none of the person's."""
    found: dict[str, Leaf] = {}
    _walk(file, "", file, name, found)
    return found


def _walk(group: h5py.Group, prefix: str, file: h5py.File, name: str, found: dict[str, Leaf]) -> None:
    for key in group.keys():  # noqa: SIM118  (iterating a group is not the same in all versions)
        if len(found) >= MOST_DATASETS or key.startswith("#"):
            return
        if not isinstance(group.get(key, getlink=True), h5py.HardLink):
            continue
        node, path = group[key], prefix + key
        if isinstance(node, h5py.Group) and prefix.count("/") < _DEEPEST:
            _walk(node, path + "/", file, name, found)
        elif isinstance(node, h5py.Dataset) and node.shape is not None:
            found[path] = Leaf(node.shape, _type_of(node), lambda p=path: dataset(file, p, name, ndim=None))


def _type_of(stored: h5py.Dataset) -> np.dtype:
    """A dataset's type; a single text of any length, as h5py writes one, counts as one of the bytes that it has.

    Their number stands where the dataset lies, before the place of the text: no long one is read to be measured.
    """
    text = h5py.check_string_dtype(stored.dtype)
    if stored.shape != () or text is None or text.length is not None or stored.file.driver != "sec2":
        return stored.dtype
    place = stored.id.get_offset()
    if place is None:
        return stored.dtype
    length = int.from_bytes(os.pread(stored.file.id.get_vfd_handle(), 4, place), "little")
    return np.dtype(f"S{min(length, _LONGEST_TEXT)}")


def check_columns(file: h5py.File, paths: set[str], name: str) -> None:
    """An error where the columns together declare far more than lies in the file; one alone may be all noughts."""
    datasets = [dataset(file, path, name, ndim=None) for path in paths]
    stored = sum(column.id.get_storage_size() for column in datasets)
    declared = sum(column.nbytes for column in datasets)
    check_growth(
        stored, declared, f"{name}: its columns", "write it again, or allow it with --unpack-limit MB, if you trust it"
    )


def attributes_of(file: h5py.File, group: str, name: str) -> Mapping[str, Any]:
    """A group's attributes; none where there is no such group."""
    node = file if not group else find(file, group, name)
    return {} if node is None else dict(node.attrs.items())


def outline(file: h5py.File) -> str:
    """What lies in the file, two levels deep: "ovc (left, ts), prophesee (left, right)"."""
    parts = []
    for key in sorted(file.keys())[:12]:
        node: Any = file[key] if isinstance(file.get(key, getlink=True), h5py.HardLink) else None
        if isinstance(node, h5py.Group):
            inner = sorted(node.keys())
            more = ", …" if len(inner) > 8 else ""
            parts.append(f"{key} ({', '.join(inner[:8])}{more})")
        else:
            parts.append(f"{key} {node.shape}" if isinstance(node, h5py.Dataset) else key)
    return ", ".join(parts) + (", …" if len(file.keys()) > 12 else "") or "nothing"

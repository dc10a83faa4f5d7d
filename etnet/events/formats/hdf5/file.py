"""HDF5 files, opened without following what a hostile one could point to."""

from __future__ import annotations

from typing import Any

import h5py
import hdf5plugin  # noqa: F401  (registers Blosc, zstd and LZ4 with the HDF5 library)

from etnet.errors import RecordingError
from etnet.events.formats.base import Remarks, Request, contained
from etnet.events.formats.bounds import MAX_BLOCK, at_most
from etnet.events.formats.hdf5.chunks import checked
from etnet.events.formats.hdf5.journal import restore


def open_file(request: Request) -> h5py.File:
    """The file, read only; it is closed with the recording.

    Opened with HDF5's usual locking, so that h5py can open it beside us in the same process; without any where the
    file system or another reader does not allow that.
    """
    with contained(request.name, "the HDF5 file"):
        restore(request.path)
        try:
            file = h5py.File(request.path, "r")
        except OSError as error:
            if "lock" not in str(error):
                raise
            file = h5py.File(request.path, "r", locking=False)
        return request.resources.enter_context(file)


def find(group: h5py.Group, path: str, name: str) -> Any:
    """The group or dataset at `path`, None if there is none. Links out of the file are refused at every step."""
    node: Any = group
    for part in path.split("/"):
        if not isinstance(node, h5py.Group) or part not in node.keys():  # noqa: SIM118  (`in node` follows links)
            return None
        link = node.get(part, getlink=True)
        if isinstance(link, h5py.ExternalLink):
            raise RecordingError(
                f"{name}: {path} is a link to another file ({link.filename}); copy the data into one file"
            )
        if isinstance(link, h5py.SoftLink):
            raise RecordingError(f"{name}: {path} is a soft link; copy the data in its place")
        with contained(name, path):
            node = node[part]
    return node


def dataset(group: h5py.Group, path: str, name: str, *, ndim: int | None = 1) -> h5py.Dataset:
    """A dataset that must be there, holds its own data, and has `ndim` dimensions (any if None)."""
    node = find(group, path, name)
    if not isinstance(node, h5py.Dataset):
        raise RecordingError(f"{name}: {path} is {'missing' if node is None else 'a group'}; wanted a dataset there")
    if node.external or node.is_virtual:
        raise RecordingError(f"{name}: {path} lies in another file; copy the data into one file")
    if node.chunks is not None:
        num_bytes = node.dtype.itemsize
        for side in node.chunks:
            num_bytes *= side
        if num_bytes > at_most(MAX_BLOCK):
            raise RecordingError(
                f"{name}: a chunk of {path} unpacks to {num_bytes:,} bytes, at most {at_most(MAX_BLOCK):,} are read; "
                "allow it with --unpack-limit MB if you trust it"
            )
    if ndim is not None and node.ndim != ndim:
        raise RecordingError(f"{name}: {path} has {node.ndim} dimensions; wanted {ndim}")
    return checked(node, path, name)


def say_unread(group: h5py.Group, path: str, what: str, name: str, remarks: Remarks) -> None:
    """Count what lies beside the events and is not read."""
    node = find(group, path, name)
    if isinstance(node, h5py.Dataset) and node.shape and node.shape[0]:
        remarks.detected(f"{node.shape[0]} {what}, which are not read further")


def columns(group: h5py.Group, paths: tuple[str, ...], name: str) -> tuple[h5py.Dataset, ...]:
    """Datasets of one length."""
    found = tuple(dataset(group, path, name) for path in paths)
    lengths = {path: len(column) for path, column in zip(paths, found, strict=True)}
    if len(set(lengths.values())) != 1:
        said = ", ".join(f"{path} {length}" for path, length in lengths.items())
        raise RecordingError(f"{name}: its columns differ in length ({said}); the file is damaged")
    return found

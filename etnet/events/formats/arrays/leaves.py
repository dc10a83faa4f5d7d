"""npy arrays as leaves of a tree: their headers are read at once, their numbers where they are used."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from io import BufferedIOBase, BytesIO
from pathlib import Path

import numpy as np

from etnet.errors import RecordingError
from etnet.events.cache import MEMORY_CAP
from etnet.events.formats.archive import Store, read_small
from etnet.events.formats.base import Request, contained
from etnet.events.formats.bounds import Unpacked
from etnet.events.formats.column_finder import Leaf

PICKLED = (
    "it holds Python objects, which are not loaded, for they could run any code; save the columns as plain arrays: "
    "np.savez(file, x=…, y=…, t=…, p=…)"
)
_STEP = 1 << 20
MAGIC = b"\x93NUMPY"


def header_of(stream: BufferedIOBase) -> tuple[tuple[int, ...], np.dtype]:
    """Shape and type of the npy array that a stream begins with."""
    version = np.lib.format.read_magic(stream)
    read = np.lib.format.read_array_header_1_0 if version == (1, 0) else np.lib.format.read_array_header_2_0
    shape, _, dtype = read(stream)
    return shape, dtype


def is_pickled(leaf: Leaf) -> bool:
    """Whether it holds Python objects."""
    return leaf.dtype.hasobject


def leaves_of(
    store: Store, members: Iterable[str], request: Request, opens: Callable[[Store, str, Request], np.ndarray]
) -> dict[str, Leaf]:
    """The npy files among `members`, by their names without ".npy"; `opens` gives the numbers of one."""
    found = {}
    for member in members:
        if not member.lower().endswith(".npy"):
            continue
        with contained(request.name, member), store.open(member) as stream:
            shape, dtype = header_of(stream)
        found[member[: -len(".npy")]] = Leaf(shape, dtype, lambda m=member: opens(store, m, request))
    return found


def mapped(store: Store, member: str, request: Request) -> np.ndarray:
    """An npy file as numbers; one in an archive is unpacked to scratch and mapped there."""
    path: Path | None = store.local_path(member)
    if path is not None:
        return load_foreign(path, f"{request.name}: {member}", request)
    path = request.scratch.path(member.replace("/", "_"), store.size(member))
    unpacked = Unpacked(max(1, request.path.stat().st_size), request.name)
    with store.open(member) as packed, path.open("wb") as plain:
        while block := packed.read(_STEP):
            unpacked.take(len(block))
            plain.write(block)
            request.progress(0.1)
    return load_mapped(path, f"{request.name}: {member}")


def held(store: Store, member: str, request: Request) -> np.ndarray:
    """A small npy file in memory."""
    content = read_small(store, member, request.name)
    if header_of(BytesIO(content))[1].hasobject:
        raise RecordingError(f"{request.name}: {member}: {PICKLED}")
    return np.load(BytesIO(content), allow_pickle=False)


def load_foreign(path: Path, where: str, request: Request) -> np.ndarray:
    """An npy file that is not ours, in memory, or as a map of a private copy where it is large.

    Who cuts a mapped file short ends the process that reads it.
    """
    size = path.stat().st_size
    if size > MEMORY_CAP:
        copy = request.scratch.path(f"{path.stem}.{path.stat().st_ino}.npy", size)
        with path.open("rb") as source, copy.open("wb") as target:
            while block := source.read(_STEP):
                target.write(block)
                request.progress(0.1)
        return load_mapped(copy, where)
    with path.open("rb") as stream:
        shape, dtype = header_of(stream)
        if dtype.hasobject:
            raise RecordingError(f"{where}: {PICKLED}")
        if math.prod(shape) * dtype.itemsize > size - stream.tell():
            raise RecordingError(f"{where}: ends before its array of {shape}; it is truncated, copy it again")
    return np.load(path, allow_pickle=False)


def load_mapped(path: Path, where: str) -> np.ndarray:
    """An npy file of our own scratch as a map, never with Python objects; one without a dimension is read."""
    with path.open("rb") as stream:
        shape, dtype = header_of(stream)
    if dtype.hasobject:
        raise RecordingError(f"{where}: {PICKLED}")
    if not shape or 0 in shape:
        return np.load(path, allow_pickle=False)
    return np.load(path, mmap_mode="r", allow_pickle=False)

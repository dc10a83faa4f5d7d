"""Chunks whose unpackers trust what lies in them: they are looked through before HDF5 has them unpacked.

Blosc and Bitshuffle follow sizes that stand in the chunk. Where one of them is damaged they read what lies beyond it,
which ends the process; bzip2's filter goes on for ever at a stream without an end. The layouts are those of c-blosc
(README_CHUNK_FORMAT), of the Bitshuffle filter (its README, "LZ4 and ZSTD") and of bzip2.
"""

from __future__ import annotations

import bz2
import itertools
import math
import struct
from collections.abc import Callable, Iterator
from typing import Any

import h5py
import numpy as np

from etnet.errors import RecordingError

BZIP2, BLOSC, BITSHUFFLE = 307, 32001, 32008
_SHUFFLE, _FLETCHER32 = 2, 3
_CHECKSUM = 4
"""Bytes that fletcher32 adds."""
_REFERENCE = 16
"""Bytes of an element that lies elsewhere, such as text of any length."""

Check = Callable[[bytes, int], bool]
"""Whether a stored chunk is what its unpacker expects; with the bytes that it unpacks to."""


def checked(stored: h5py.Dataset, path: str, name: str) -> h5py.Dataset:
    """The dataset itself, or one that looks through each chunk before it is read. Raises RecordingError for a codec
    that lies below another filter, where it cannot be looked through."""
    if stored.chunks is None:
        return stored
    made = stored.id.get_create_plist()
    filters = [made.get_filter(number) for number in range(made.get_nfilters())]
    place = next((number for number, (code, *_) in enumerate(filters) if code in _CHECKS), None)
    if place is None:
        return stored
    code, _, options, title = filters[place]
    before, after = {each[0] for each in filters[:place]}, [each[0] for each in filters[place + 1 :]]
    if before - {_SHUFFLE} or after not in ([], [_FLETCHER32]):
        raise RecordingError(
            f"{name}: {path} is packed by {title.decode(errors='replace')} and by other filters around it; "
            "write it again with one of them (h5repack)"
        )
    return _Checked(stored, _CHECKS[code](options), place, _CHECKSUM * len(after), f"{name}: {path}")


class _Checked(h5py.Dataset):
    """Looks through the chunks of what is read, each once."""

    def __init__(self, stored: h5py.Dataset, check: Check, place: int, num_extra: int, where: str) -> None:
        """`place` is the codec's among the filters; `num_extra` bytes of each chunk are not its own."""
        super().__init__(stored.id)
        self._check, self._place, self._num_extra, self._where = check, place, num_extra, where
        self._known: set[tuple[int, ...]] = set()
        self._sides_of_chunk: tuple[int, ...] = stored.chunks or ()
        size_of_element = _REFERENCE if stored.dtype.kind == "O" else stored.dtype.itemsize
        self._unpacked = math.prod(self._sides_of_chunk) * size_of_element

    def __getitem__(self, args: Any, new_dtype: Any = None) -> Any:
        for offset in self._offsets(args):
            if offset not in self._known:
                self._look_through(offset)
                self._known.add(offset)
        return super().__getitem__(args, new_dtype)

    def __array__(self, dtype: Any = None, copy: bool | None = True) -> np.ndarray:
        return np.asarray(self[()], dtype)

    def _offsets(self, args: Any) -> Iterator[tuple[int, ...]]:
        """Of the chunks that a selection may touch: all of a side for whatever is no plain slice or number."""
        parts = args if isinstance(args, tuple) else (args,)
        sides: list[range] = []
        shape: tuple[int, ...] = self.shape or ()
        for side, (length, chunk) in enumerate(zip(shape, self._sides_of_chunk, strict=True)):
            part = parts[side] if side < len(parts) else slice(None)
            start, stop = 0, length
            if isinstance(part, slice) and part.step in (None, 1):
                start, stop, _ = part.indices(length)
            elif isinstance(part, int | np.integer) and not isinstance(part, bool):
                start = int(part) % max(length, 1)
                stop = start + 1
            if stop <= start:
                return
            sides.append(range(start - start % chunk, min(stop, length), chunk))
        yield from itertools.product(*sides)

    def _look_through(self, offset: tuple[int, ...]) -> None:
        try:
            mask, content = self.id.read_direct_chunk(offset)
        except RuntimeError:
            return  # nothing was written there, which HDF5 fills in; whatever else it is, it says at the read
        is_packed = not mask >> self._place & 1
        if is_packed and not self._check(content[: len(content) - self._num_extra], self._unpacked):
            raise RecordingError(f"{self._where} is damaged in the chunk that begins at {offset}; copy the file again")


def _check_of_blosc(_options: tuple[int, ...]) -> Check:
    def check(content: bytes, unpacked: int) -> bool:
        if len(content) < 16:
            return False
        num_bytes, block, stored = struct.unpack_from("<III", content, 4)
        return num_bytes == unpacked and stored == len(content) and 0 < block <= max(num_bytes, 1)

    return check


def _check_of_bitshuffle(options: tuple[int, ...]) -> Check:
    """`options`: version, version, bytes of an element, block size, codec (0: none)."""
    size_of_element, codec = (options[2], options[4] if len(options) > 4 else 0) if len(options) > 2 else (0, 0)

    def check(content: bytes, unpacked: int) -> bool:
        if size_of_element == 0 or unpacked % size_of_element:
            return False
        if codec == 0:
            return len(content) == unpacked
        if len(content) < 12:
            return False
        num_bytes, block = struct.unpack_from(">QI", content)
        if num_bytes != unpacked or block == 0 or block % (8 * size_of_element):
            return False
        elements, at = unpacked // size_of_element, 12
        per_block = block // size_of_element
        whole = elements - elements % 8  # what is left over lies there as it is
        for _ in range(-(-whole // per_block)):
            if at + 4 > len(content):
                return False
            at += 4 + struct.unpack_from(">I", content, at)[0]
        return at + (elements - whole) * size_of_element == len(content)

    return check


def _check_of_bzip2(_options: tuple[int, ...]) -> Check:
    def check(content: bytes, unpacked: int) -> bool:
        stream = bz2.BZ2Decompressor()
        try:
            found = len(stream.decompress(content, unpacked + 1))
        except (OSError, ValueError):
            return False
        return stream.eof and found == unpacked

    return check


_CHECKS: dict[int, Callable[[tuple[int, ...]], Check]] = {
    BLOSC: _check_of_blosc,
    BITSHUFFLE: _check_of_bitshuffle,
    BZIP2: _check_of_bzip2,
}

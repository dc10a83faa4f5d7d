"""Metavision HDF5: events as records in CD/events, plain or compressed with ECF, read chunk by chunk.

Layout: docs.prophesee.ai, "HDF5 event files"; openeb's hdf5_event_file_writer.
"""

from __future__ import annotations

from collections import OrderedDict

import h5py
import numpy as np

from etnet.errors import RecordingError
from etnet.events.events import Sensor
from etnet.events.formats.base import Opened, Remarks, Request
from etnet.events.formats.decode import Decoded
from etnet.events.formats.hdf5.chunks import checked
from etnet.events.formats.hdf5.file import dataset, find
from etnet.events.formats.paged import paged
from etnet.events.formats.prophesee.ecf import Chunk, DamagedChunk, decode_chunk
from etnet.events.formats.prophesee.header import Header
from etnet.events.formats.trigger_table import MOST_TRIGGERS, TriggerTable
from etnet.events.triggers import Triggers

ECF_FILTER = 36559
_HELD_CHUNKS = 32


class _EcfChunks:
    """Decoded chunks, the last few of them kept."""

    def __init__(self, table: h5py.Dataset, size: int, name: str) -> None:
        self._table = table
        self._size = size
        self._name = name
        self._held: OrderedDict[int, Chunk] = OrderedDict()

    def read(self, start: int, stop: int) -> Decoded:
        """Events start … stop − 1."""
        size = self._size
        if start == stop:
            none = np.empty(0, np.int64)
            return Decoded(none, none, none, none)
        parts = [self._chunk(i) for i in range(start // size, -(-stop // size))]
        offset = start // size * size
        x, y, t, p = (np.concatenate(column)[start - offset : stop - offset] for column in zip(*parts, strict=True))
        return Decoded(x, y, t, p)

    def _chunk(self, i: int) -> Chunk:
        if i in self._held:
            self._held.move_to_end(i)
            return self._held[i]
        size = self._size
        mask, content = self._table.id.read_direct_chunk((i * size,))
        try:
            chunk = _plain(content, self._table.dtype) if mask else decode_chunk(content)
        except DamagedChunk as slip:
            raise RecordingError(f"{self._name}: chunk {i} of CD/events is damaged ({slip})") from slip
        wanted = min(size, len(self._table) - i * size)
        if len(chunk.t) < wanted:
            raise RecordingError(
                f"{self._name}: chunk {i} of CD/events holds {len(chunk.t)} events instead of {wanted}"
            )
        chunk = Chunk(*(column[:wanted] for column in chunk))
        self._held[i] = chunk
        while len(self._held) > _HELD_CHUNKS:
            self._held.popitem(last=False)
        return chunk


def _plain(content: bytes, dtype: np.dtype) -> Chunk:
    records = np.frombuffer(content, dtype)
    return Chunk(*(records[axis].astype(np.int64) for axis in "xytp"))


def open_metavision(request: Request, file: h5py.File) -> Opened:
    """Events of CD/events; the size comes from the root's attributes, which are those of the RAW header."""
    remarks = Remarks()
    table = dataset(file, "CD/events", request.name)
    if table.dtype.names is None or not {"x", "y", "t", "p"} <= set(table.dtype.names):
        raise RecordingError(f"{request.name}: CD/events is of type {table.dtype}; wanted records of x, y, p and t")
    filters = [table.id.get_create_plist().get_filter(i)[0] for i in range(table.id.get_create_plist().get_nfilters())]
    if ECF_FILTER in filters:
        if filters != [ECF_FILTER] or table.chunks is None:
            raise RecordingError(f"{request.name}: CD/events mixes ECF with the filters {filters}; write it with one")
        read, kind = _EcfChunks(table, table.chunks[0], request.name).read, "Metavision HDF5 (ECF)"
    else:
        read, kind = _reader_of(table), "Metavision HDF5"
    texts = {key: str(value) for key, value in file.attrs.items() if isinstance(value, str)}
    declared: Sensor | None = Header(texts, 0).sensor(request.name, remarks, request.assume.sensor is not None)
    triggers = _triggers(file, request.name, remarks)
    collected = paged(request, kind, len(table), read, declared, remarks)
    kept = tuple(remarks.kept)
    return Opened(kind, collected.source, collected.sensor, collected.span, kept, triggers=triggers)


def _triggers(file: h5py.File, name: str, remarks: Remarks) -> Triggers | None:
    """EXT_TRIGGER/events: records of p (1 rising), t in µs and id. Triggers that cannot be read cost no event."""
    node = find(file, "EXT_TRIGGER/events", name)
    if not isinstance(node, h5py.Dataset) or not node.shape or not node.shape[0]:
        return None
    gathered = TriggerTable()
    try:
        records = checked(node, "EXT_TRIGGER/events", name)[:MOST_TRIGGERS]
        gathered.add(records["t"].astype(np.int64), records["id"], np.where(records["p"] > 0, 1, -1))
        gathered.num_triggers = node.shape[0]
    except (OSError, ValueError, KeyError, IndexError, TypeError, RecordingError):
        remarks.detected(f"{node.shape[0]} triggers, which cannot be read")
        return None
    return gathered.triggers(remarks)


def _reader_of(table: h5py.Dataset):
    def read(start: int, stop: int) -> Decoded:
        records = table[start:stop]
        return Decoded(records["x"], records["y"], records["t"].astype(np.int64), records["p"])

    return read

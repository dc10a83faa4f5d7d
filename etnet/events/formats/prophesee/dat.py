"""Prophesee DAT: records of eight bytes (u32 t in µs, u32 address), so events are read in slices with no index.

Layout: docs.prophesee.ai, "DAT file format". Version 2 has 14 bits x, 14 bits y, 4 bits polarity.
"""

from __future__ import annotations

import numpy as np

from etnet.errors import RecordingError
from etnet.events.formats.base import Format, Opened, Remarks, Request
from etnet.events.formats.clock32 import begins_anew, collect_unrolled, is_out_of_order
from etnet.events.formats.decode import Decoded, collect
from etnet.events.formats.paged import paged, pages
from etnet.events.formats.prophesee.header import Header, read_header
from etnet.events.formats.prophesee.raw import RAW
from etnet.events.formats.rows_on_disk import RowsOnDisk

_EVENT_TYPES = (0x00, 0x0C)
"""Change events: the old "2d" and the later "CD"; both have one layout in version 2."""

_SHORT = 1 << 22
"""Events up to which every stamp is looked at before the file is read by slice; of a longer one some are."""

_SAMPLES = 4096


def _open(request: Request) -> Opened:
    remarks = Remarks()
    header = read_header(request)
    version = header.fields.get("Version", "1")
    kind = _record_kind(request, header)
    if not _is_kind(kind):
        raise RecordingError(
            f"{request.name}: a DAT file of event type {kind.hex() or 'none'}; "
            "wanted change events of 8 bytes (0008 or 0c08)"
        )
    size = request.path.stat().st_size - header.num_bytes - 2
    if size % 8:
        remarks.repaired(f"{size % 8} bytes after the last whole event were left out; the file may be truncated")
    if size < 8:
        raise RecordingError(f"{request.name}: holds no events; there is nothing to open")
    words = RowsOnDisk(request.path, "<u4", header.num_bytes + 2, (size // 8, 2))
    request.resources.callback(words.close)
    offset = int(header.fields["T0"]) if header.fields.get("T0", "").isdigit() else 0
    declared = header.sensor(request.name, remarks, request.assume.sensor is not None)
    bits = (9, 8) if version == "1" else (14, 14)

    def read(start: int, stop: int) -> Decoded:
        return _decoded(words[start:stop], bits, offset)

    looked_at = _some_stamps(words)
    if begins_anew(looked_at):
        collected = collect_unrolled(request, len(words), read, declared, remarks)
    elif is_out_of_order(looked_at):
        collected = collect(request, pages(len(words), read), declared, remarks)
    else:
        collected = paged(request, "Prophesee DAT", len(words), read, declared, remarks)
    name = f"Prophesee DAT {version}"
    return Opened(name, collected.source, collected.sensor, collected.span, tuple(remarks.kept))


def _record_kind(request: Request, header: Header) -> bytes:
    """The type and the size of the records, two bytes after the header."""
    with request.path.open("rb") as file:
        file.seek(header.num_bytes)
        return file.read(2)


def _is_kind(kind: bytes) -> bool:
    return len(kind) == 2 and kind[0] in _EVENT_TYPES and kind[1] == 8


def _decoded(words: np.ndarray, bits: tuple[int, int], offset: int) -> Decoded:
    stamps, address = words[:, 0].astype(np.int64) + offset, np.asarray(words[:, 1])
    x = (address & ((1 << bits[0]) - 1)).astype(np.uint16)
    y = ((address >> bits[0]) & ((1 << bits[1]) - 1)).astype(np.uint16)
    polarity = (address >> (bits[0] + bits[1])) & 1
    return Decoded(x, y, stamps, polarity.astype(bool))


def _some_stamps(words: RowsOnDisk) -> np.ndarray:
    """All of a short file; of a long one some that are spread over it, and the last."""
    if len(words) <= _SHORT:
        return words[:, 0]
    return np.append(words[:: len(words) // _SAMPLES, 0], words[-1:, 0])


def _is_dat(request: Request) -> bool:
    """By the header's own words, or by the records that follow it; a RAW file's header may have the same words."""
    if request.head[:1] != b"%":
        return False
    has_words = b"% Data file containing" in request.head or b"% Version" in request.head
    has_records = _is_kind(_record_kind(request, read_header(request)))
    return (has_words and has_records) if RAW.recognises(request) else (has_words or has_records)


DAT = Format("Prophesee DAT", (".dat",), _is_dat, _open)

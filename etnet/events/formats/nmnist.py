"""N-MNIST and N-Caltech101 .bin (Orchard et al. 2015): five big-endian bytes: x 8, y 8, polarity 1, t 23 bits in µs."""

from __future__ import annotations

import numpy as np

from etnet.errors import RecordingError
from etnet.events.formats.base import Format, Opened, Remarks, Request
from etnet.events.formats.decode import Decoded, collect
from etnet.files import in_megabytes

_LARGEST = 64 << 20
_MARK, _PERIOD = 240, 1 << 13
"""The sensor, an ATIS, has rows 0 … 239."""
_MOST_BACK = 0.01
"""Share of events before their predecessor from which on these are no stamps."""


def _open(request: Request) -> Opened:
    remarks = Remarks()
    size = request.path.stat().st_size
    if size > _LARGEST:
        raise RecordingError(
            f"{request.name}: {in_megabytes(size)} of .bin; samples of N-MNIST and N-Caltech101 are far smaller"
        )
    octets = np.fromfile(request.path, np.uint8)
    if size % 5:
        raise RecordingError(
            f"{request.name}: {size} bytes are no multiple of 5, so these are no N-MNIST or N-Caltech101 events"
        )
    if not octets.any():
        raise RecordingError(f"{request.name}: nothing but zeros; the copy or download broke off")
    rows = octets.reshape(-1, 5).astype(np.int64)
    stamps = ((rows[:, 2] & 0x7F) << 16) | (rows[:, 3] << 8) | rows[:, 4]
    rows, stamps = _without_marks(rows, stamps, remarks)
    num_back = int(np.count_nonzero(np.diff(stamps) < 0))
    if num_back > max(3, _MOST_BACK * len(stamps)):
        raise RecordingError(
            f"{request.name}: read as N-MNIST's five-byte events time runs back at {num_back:,} of {len(stamps):,}, so "
            "it is none; give the file the suffix of its format, or convert it"
        )
    remarks.assumed("five-byte events as in N-MNIST: a .bin file says nothing about itself")
    pieces = [Decoded(rows[:, 0], rows[:, 1], stamps, rows[:, 2] >> 7, 1.0)]
    collected = collect(request, pieces, None, remarks)
    return Opened("N-MNIST .bin", collected.source, collected.sensor, collected.span, tuple(remarks.kept))


def _without_marks(rows: np.ndarray, stamps: np.ndarray, remarks: Remarks) -> tuple[np.ndarray, np.ndarray]:
    """Events alone. A row y = 240, below the sensor, marks that the recorder's clock of 13 bits wrapped."""
    is_mark = rows[:, 1] == _MARK
    if not is_mark.any():
        return rows, stamps
    remarks.repaired(f"{int(is_mark.sum())} marks of the recorder's clock were taken into the stamps")
    later = stamps + np.cumsum(is_mark) * _PERIOD
    return rows[~is_mark], later[~is_mark]


FORTY_BITS = Format(
    "N-MNIST .bin", (".bin",), lambda request: request.suffix == ".bin", _open, is_known_by_content=False
)

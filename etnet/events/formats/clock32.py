"""Stamps of 32 bits: µs that wrap after 71.6 minutes. A later moment is found only once they are unrolled."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from jaxtyping import Int64, Integer

from etnet.events.events import Sensor
from etnet.events.formats.base import Remarks, Request
from etnet.events.formats.decode import Collected, Decoded, collect
from etnet.events.formats.paged import ReadColumns, pages
from etnet.events.formats.word_stream import unrolled

_PERIOD = 1 << 32


def begins_anew(stamps: Integer[np.ndarray, " n"]) -> bool:
    """Whether the clock turns among these stamps, some of a file's in its order: a smaller step back is disorder."""
    return bool((_steps(stamps) < -(_PERIOD // 2)).any())


def is_out_of_order(stamps: Integer[np.ndarray, " n"]) -> bool:
    """Whether any of these stamps is smaller than the one before it."""
    return bool((_steps(stamps) < 0).any())


def collect_unrolled(
    request: Request, num_events: int, read_columns: ReadColumns, declared: Sensor | None, remarks: Remarks
) -> Collected:
    """All events, with stamps that go on where the clock wraps; that is told."""
    remarks.repaired("the 32-bit stamps wrap (every 71.6 minutes) and were unrolled")
    return collect(request, _unrolled(pages(num_events, read_columns)), declared, remarks)


def _unrolled(pieces: Iterator[Decoded]) -> Iterator[Decoded]:
    last, turns = None, 0
    for piece in pieces:
        t, turns = unrolled(piece.t.astype(np.int64, copy=False), _PERIOD, last, turns)
        last = int(piece.t[-1])
        yield piece._replace(t=t)


def _steps(stamps: Integer[np.ndarray, " n"]) -> Int64[np.ndarray, " m"]:
    return np.diff(stamps.astype(np.int64, copy=False))

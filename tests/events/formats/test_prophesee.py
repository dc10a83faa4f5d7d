"""RAW files of a camera that ran for longer than its clock counts: 34 bits of µs, 4.8 hours."""

from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
import pytest

from etnet.events.open import open_recording

PERIOD = 1 << 34
Event = tuple[int, int, int, int]
"""t in µs, x, y, p in 0 … 1."""


def evt2(events: Sequence[Event]) -> bytes:
    """A time word and a pixel word for each event."""
    words = []
    for t, x, y, p in events:
        words += [0x8 << 28 | t % PERIOD >> 6, p << 28 | (t & 63) << 22 | x << 11 | y]
    return b"% evt 2.0\n% geometry 64x32\n% end\n" + np.array(words, "<u4").tobytes()


def evt21(events: Sequence[Event]) -> bytes:
    """A time word and a word with one pixel set for each event."""
    words = []
    for t, x, y, p in events:
        base = p << 60 | (t & 63) << 54 | (x & ~31) << 43 | y << 32
        words += [0x8 << 60 | (t % PERIOD >> 6) << 32, base | 1 << (x & 31)]
    return b"% evt 2.1\n% geometry 64x32\n% end\n" + np.array(words, "<u8").tobytes()


@pytest.mark.parametrize("written", [evt2, evt21])
def test_a_clock_that_began_anew_goes_on_and_is_told(tmp_path: Path, written: Callable[[Sequence[Event]], bytes]):
    events = [(PERIOD - 2000 + 1000 * i, 3 * i, i, i % 2) for i in range(6)]
    path = tmp_path / "long.raw"
    path.write_bytes(written(events))
    with open_recording(path) as recording:
        read = recording.read(0, 6)
        assert (read.t - read.t[0]).tolist() == [1000 * i for i in range(6)]
        assert read.x.tolist() == [x for _, x, _, _ in events]
        assert read.p.tolist() == [2 * p - 1 for *_, p in events]
        told = [remark.text for remark in recording.remarks if "anew" in remark.text]
    assert told == ["the 34-bit clock begins anew (every 4.8 hours) and was unrolled"]


@pytest.mark.parametrize("written", [evt2, evt21])
def test_a_clock_that_did_not_is_not_spoken_of(tmp_path: Path, written: Callable[[Sequence[Event]], bytes]):
    path = tmp_path / "short.raw"
    path.write_bytes(written([(PERIOD - 9000 + 1000 * i, i, i, 1) for i in range(6)]))
    with open_recording(path) as recording:
        assert not [remark for remark in recording.remarks if "anew" in remark.text]

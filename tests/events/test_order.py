"""Time that runs back is told from a clock of 32 bits that begins anew, and no recording ends before it begins."""

from __future__ import annotations

import h5py
import numpy as np
import pytest

from etnet.errors import RecordingError
from etnet.events.open import Assumptions, open_recording
from tests.events.containers import all_events
from tests.strategies import make_events

TURN = 1 << 32


def save_dat(path, t):
    """Event i is at x = i % 20."""
    records = np.stack([t % TURN, np.arange(len(t)) % 20], 1).astype("<u4")
    header = b"% Data file containing CD events.\n% Version 2\n% Width 20\n% Height 12\n\x0c\x08"
    path.write_bytes(header + records.tobytes())
    return path


def save_dsec(path, t):
    with h5py.File(path, "w") as file:
        file["events/x"], file["events/y"] = (np.arange(len(t)) % 20).astype("u2"), np.zeros(len(t), "u2")
        file["events/t"], file["events/p"] = (t % TURN).astype("u4"), np.ones(len(t), "u1")
        file["ms_to_idx"], file["t_offset"] = np.zeros(1, "u8"), np.int64(5)
    return path


SAVE = {".dat": (save_dat, 0), ".h5": (save_dsec, 5)}
STATED = {"width": 20, "height": 12}


@pytest.mark.parametrize("suffix", SAVE)
@pytest.mark.parametrize("num_events", [3, 40_000])
@pytest.mark.parametrize("share", [0.3, 1.0])
def test_a_32_bit_clock_that_begins_anew_goes_on_wherever_it_does(suffix, num_events, share, tmp_path):
    save, offset = SAVE[suffix]
    first = TURN - 100 * max(1, int(share * (num_events - 1)))
    t = first + np.arange(num_events) * 100
    path = save(tmp_path / f"a{suffix}", t)
    with open_recording(path, assume=Assumptions(**STATED)) as recording:
        assert recording.span == (first + offset, int(t[-1]) + offset)
        np.testing.assert_array_equal(all_events(recording).t, t + offset)
        told = [remark.text for remark in recording.remarks if remark.kind == "repaired"]
    assert told == ["the 32-bit stamps wrap (every 71.6 minutes) and were unrolled"]


def test_a_small_step_back_in_dat_is_sorted_and_not_called_a_turn(tmp_path):
    t = np.arange(5000) * 100 + 7
    t[3000] -= 400
    with open_recording(save_dat(tmp_path / "a.dat", t)) as recording:
        np.testing.assert_array_equal(all_events(recording).t, np.sort(t))
        told = [remark.text for remark in recording.remarks if remark.kind == "repaired"]
    assert told == ["time ran back 1 times, first at event 3000, by up to 300 µs; the events were sorted by timestamp"]


@pytest.mark.parametrize("suffix", [*SAVE, ".npz"])
@pytest.mark.parametrize("num_events", [2, 5000, 40_000])
def test_a_last_event_before_the_first_is_refused_at_opening_and_sorted_on_demand(suffix, num_events, tmp_path):
    t = np.arange(num_events) * 100 + 10_000
    t[-1] = 3
    path = tmp_path / f"a{suffix}"
    if suffix == ".npz":
        events = make_events(num_events)
        np.savez(path, x=events.x, y=events.y, t=t, p=events.p, **STATED)
    else:
        SAVE[suffix][0](path, t)
    with pytest.raises(RecordingError, match=rf"time runs back .*event {num_events - 1}\b.*--sort"):
        open_recording(path, assume=Assumptions(**STATED))
    with open_recording(path, assume=Assumptions(sort=True, **STATED)) as recording:
        assert recording.span.start <= recording.span.stop
        np.testing.assert_array_equal(np.diff(all_events(recording).t), np.diff(np.sort(t)))

"""Noise tools take out what they say, whatever the block, and leave every other event as it was."""

import numpy as np
import pytest

from etnet.errors import RecordingError
from etnet.events import denoise
from etnet.events.denoise import UNCLEANED, Cleaning, cleaned
from etnet.events.events import Events, Sensor
from etnet.events.open import open_recording
from etnet.events.recording import recording_of_events
from tests.real_data import real_file


def noisy(num_events=3000, seed=0):
    rng = np.random.default_rng(seed)
    sensor = Sensor(13, 9)
    x, y = rng.integers(0, 13, num_events), rng.integers(0, 9, num_events)
    x[::4], y[::4] = 3, 5  # one pixel that fires as often as a quarter of the sensor
    return recording_of_events(
        Events(
            x.astype(np.uint16),
            y.astype(np.uint16),
            np.sort(rng.integers(0, 2_000_000, num_events)).astype(np.int64),
            rng.choice(np.array([-1, 1], np.int8), num_events),
            sensor,
        )
    )


def slowly_supported(events, within):
    """The filter's definition, one event after the other."""
    newest, stays = {}, []
    for x, y, t in zip(events.x.tolist(), events.y.tolist(), events.t.tolist(), strict=True):
        around = [newest.get((x + i, y + j)) for i in (-1, 0, 1) for j in (-1, 0, 1) if (i, j) != (0, 0)]
        stays.append(any(before is not None and t - before <= within for before in around))
        newest[x, y] = t
    return np.array(stays)


@pytest.mark.parametrize("block", [7, 1 << 18])
@pytest.mark.parametrize("within", [1, 500, 20_000])
def test_the_filter_keeps_what_a_neighbour_supports_and_nothing_else(monkeypatch, block, within):
    monkeypatch.setattr(denoise, "_BLOCK", block)
    recording = noisy(1500)
    events = recording.read(0, recording.num_events)
    stays = slowly_supported(events, within)
    if not stays.any():
        with pytest.raises(RecordingError, match="filter less"):
            cleaned(recording, Cleaning(support_within=within))
        return
    left = cleaned(recording, Cleaning(support_within=within))
    found = left.read(0, left.num_events)
    for name in ("x", "y", "t", "p"):
        assert np.array_equal(getattr(found, name), getattr(events, name)[stays])


def test_hot_pixels_go_and_all_other_events_stay():
    recording = noisy()
    events = recording.read(0, recording.num_events)
    is_hot = (events.x == 3) & (events.y == 5)
    left = cleaned(recording, Cleaning(hot_pixels=True))
    assert left.num_events == (~is_hot).sum()
    assert np.array_equal(left.read(10, 20).t, events.t[~is_hot][10:20])
    assert "events stayed" in str(left.remarks[-1])


def test_no_cleaning_is_the_recording_itself():
    recording = noisy()
    assert cleaned(recording, UNCLEANED) is recording


@pytest.mark.real
def test_a_real_recording_loses_its_noise_and_keeps_most():
    with open_recording(real_file("derived/slider_depth_0.4s_evreal.zip")) as recording:
        left = cleaned(recording, Cleaning(hot_pixels=True, support_within=10_000))
        assert 0.5 < left.num_events / recording.num_events < 1
        assert left.ground_truth is recording.ground_truth
        middle = left.read(left.num_events // 2, left.num_events // 2 + 5)
        assert (np.diff(middle.t) >= 0).all()
        assert left.index_at(int(middle.t[0])) <= left.num_events // 2

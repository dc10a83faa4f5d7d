"""The doctor counts what is there, and finds what was put in."""

from __future__ import annotations

import json

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from etnet.errors import RecordingError
from etnet.events.denoise import Cleaning, cleaned
from etnet.events.events import Events, Sensor
from etnet.events.examine import examine, look_through
from etnet.events.fitness import measure_fitness
from etnet.events.open import open_recording
from etnet.events.pixel_counts import LARGEST_COUNTED, PixelCounts
from etnet.events.recording import GroundTruth, recording_of_events
from etnet.render.examination import draw_examination
from tests import strategies
from tests.real_data import real_file


@settings(max_examples=30, deadline=None)
@given(events=strategies.events())
def test_counts_are_those_of_the_columns(events):
    exam = examine(recording_of_events(events))
    assert exam.num_looked_at == len(events) == int(exam.count_image.sum())
    assert exam.num_on == np.count_nonzero(events.p > 0)
    assert sum(exam.step_counts) == max(0, len(events) - 1)
    assert exam.num_equal_stamps == np.count_nonzero(np.diff(events.t) == 0)
    assert exam.num_silent_pixels == events.sensor.num_pixels - len(
        set(zip(events.x.tolist(), events.y.tolist(), strict=True))
    )
    if exam.rates:
        widths = events.t[-1] - events.t[0]
        assert sum(exam.rates) * widths / len(exam.rates) / 1e6 == pytest.approx(len(events))
    assert json.loads(json.dumps(exam.as_dict()))["num_events"] == len(events)


def test_a_hot_pixel_a_gap_and_foreign_frames_are_found():
    rng = np.random.default_rng(0)
    t = np.sort(np.concatenate([rng.integers(0, 10**6, 3000), 3_000_000 + rng.integers(0, 10**6, 3000)]))
    x, y = rng.integers(0, 20, 6000).astype(np.uint16), rng.integers(0, 12, 6000).astype(np.uint16)
    x[::4], y[::4] = 7, 5
    x[(x != 7) & (abs(x.astype(int) - 7) < 2)] = 15
    x[(x == 7) & (y != 5)] = 15
    events = Events(x, y, t, np.ones(6000, np.int8), Sensor(20, 12))
    truth = GroundTruth(np.array([10**12, 10**12 + 40_000]), lambda i: np.zeros((6, 10), np.float32))
    exam = examine(recording_of_events(events, ground_truth=truth))
    assert [(pixel.x, pixel.y) for pixel in exam.hot_pixels] == [(7, 5)]
    assert exam.gaps[0].stop - exam.gaps[0].start > 1_900_000
    assert exam.frames is not None
    assert exam.frames.num_outside_span == 2
    assert exam.frames.frames_per_second == pytest.approx(25)
    assert len(exam.advice) == 4


def test_a_sensor_of_too_many_pixels_is_counted_in_cells_and_that_is_told():
    events = Events(
        np.array([1, 65_535, 65_535], np.uint16), np.array([2, 0, 0], np.uint16), np.array([0, 5, 9]),
        np.ones(3, np.int8), Sensor(65_536, 65_536),
    )  # fmt: skip
    recording = recording_of_events(events)
    exam = examine(recording)
    assert exam.cell > 1
    assert exam.count_image.size <= LARGEST_COUNTED
    assert exam.count_image[0, 0] == 1
    assert exam.count_image[0, -1] == 2
    assert (exam.num_silent_pixels, exam.hot_pixels) == (None, ())
    assert any("in cells of" in said for said in exam.advice)
    assert draw_examination(exam).ndim == 3
    with pytest.raises(RecordingError, match="region"):
        cleaned(recording, Cleaning(support_within=1000))
    with pytest.raises(RecordingError, match="region"):
        next(measure_fitness(recording))


@given(width=st.integers(1, 65_536), height=st.integers(1, 65_536))
def test_no_sensor_has_more_cells_than_are_counted(width, height):
    sensor = Sensor(width, height)
    counts = PixelCounts(sensor)
    assert counts.image.size <= LARGEST_COUNTED
    assert (counts.cell == 1) == (sensor.num_pixels <= LARGEST_COUNTED)
    assert counts.image.shape[0] * counts.cell >= height
    assert counts.image.shape[1] * counts.cell >= width


@pytest.mark.real
def test_slider_depth_is_healthy():
    with open_recording(real_file("ecd_slider_depth/slider_depth.zip")) as recording:
        exam = examine(recording)
    assert exam.advice == ()
    assert exam.frames is not None
    assert exam.frames.first_after_first_event == -3811
    assert exam.suggested_events == 15_120


def test_in_short_stretches_the_same_is_found_and_the_share_only_grows(monkeypatch):
    rng = np.random.default_rng(3)
    events = Events(
        rng.integers(0, 20, 5000).astype(np.uint16), rng.integers(0, 12, 5000).astype(np.uint16),
        np.sort(rng.integers(0, 10**6, 5000)), rng.choice(np.array([-1, 1], np.int8), 5000), Sensor(20, 12),
    )  # fmt: skip
    monkeypatch.setattr("etnet.events.examine._BLOCK", 700)
    recording = recording_of_events(events)
    stretches = list(look_through(recording))
    shares = [share for _, share in stretches]
    assert len(stretches) == 20 + 9  # 200 parts of the span, then 8 blocks and what was found
    assert shares == sorted(shares)
    assert shares[-1] == 1.0
    assert all(found is None for found, _ in stretches[:-1])
    assert stretches[-1][0] == examine(recording)

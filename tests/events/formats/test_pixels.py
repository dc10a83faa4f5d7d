"""Pixels that count from 1, are 32nds, fractions or swapped are told and mended on demand."""

from __future__ import annotations

import numpy as np
import pytest

from etnet.errors import RecordingError
from etnet.events.open import Assumptions, open_recording
from tests.events.containers import all_events

RNG = np.random.default_rng(0)
COUNT = 4000
X, Y = RNG.integers(0, 346, COUNT), RNG.integers(0, 260, COUNT)
X[:2], Y[:2] = (0, 345), (0, 259)
SIZE = {"width": 346, "height": 260}


def save(path, x, y):
    columns = {"x": x, "y": y, "t": np.arange(COUNT) * 40, "p": np.arange(COUNT) % 2}
    if path.suffix == ".npz":
        np.savez(path, **columns)
    else:
        np.savetxt(path, np.stack(list(columns.values()), 1), "%.10g", ",", header="x,y,t_us,p", comments="")
    return path


def advice(path, **stated) -> str:
    with open_recording(path, assume=Assumptions(**stated)) as recording:
        return "\n".join(remark.text for remark in recording.remarks if remark.kind == "advice")


def pixels(path, **stated):
    with open_recording(path, assume=Assumptions(**stated)) as recording:
        found = all_events(recording)
        return found.x.astype(int), found.y.astype(int), str(recording.sensor)


@pytest.mark.parametrize("suffix", [".npz", ".csv"])
def test_pixels_that_count_from_1_are_advised_on_and_moved_on_demand(suffix, tmp_path):
    path = save(tmp_path / f"a{suffix}", X + 1, Y + 1)
    assert "--pixels from1" in advice(path)
    x, y, sensor = pixels(path, pixels="from1")
    np.testing.assert_array_equal(x, X)
    np.testing.assert_array_equal(y, Y)
    assert sensor == "346×260"
    assert advice(save(tmp_path / f"b{suffix}", X, Y)) == ""


@pytest.mark.parametrize("suffix", [".npz", ".csv"])
def test_a_known_sensor_on_its_side_is_advised_on(suffix, tmp_path):
    assert "x and y may be swapped" in advice(save(tmp_path / f"a{suffix}", Y, X))


@pytest.mark.parametrize("suffix", [".npz", ".csv"])
def test_fixed_point_pixels_are_no_larger_sensor(suffix, tmp_path):
    path = save(tmp_path / f"a{suffix}", X * 32, Y * 32)
    with pytest.raises(RecordingError, match=r"multiples of 32.*--pixels 32nds"):
        open_recording(path)
    x, y, sensor = pixels(path, pixels="32nds")
    np.testing.assert_array_equal(x, X)
    np.testing.assert_array_equal(y, Y)
    assert sensor == "346×260"


def test_32nds_slightly_below_0_lost_their_sign(tmp_path):
    stored = (X * 32).astype(np.uint16)
    stored[5:8] = 65_534
    x, _, _ = pixels(save(tmp_path / "a.npz", stored, (Y * 32).astype(np.uint16)), pixels="32nds")
    assert x[5:8].tolist() == [0, 0, 0]


@pytest.mark.parametrize("suffix", [".npz", ".csv"])
def test_fractions_are_refused_and_rounded_on_demand(suffix, tmp_path):
    path = save(tmp_path / f"a{suffix}", X + 0.25, Y - 0.25)
    with pytest.raises(RecordingError, match="--pixels rounded"):
        open_recording(path)
    x, y, _ = pixels(path, pixels="rounded", **SIZE)
    np.testing.assert_array_equal(x, X)
    np.testing.assert_array_equal(y, Y)


@pytest.mark.parametrize("suffix", [".npz", ".csv"])
def test_negative_pixels_are_strays(suffix, tmp_path):
    x = X.copy()
    x[10:13] = (-1, -300, 70_000)
    path = save(tmp_path / f"a{suffix}", x, Y)
    for stated in ({}, {"drop_outside": True, **SIZE}):
        with open_recording(path, assume=Assumptions(**stated)) as recording:
            assert recording.num_events == COUNT - 3
            assert any("3 events beyond the sensor" in remark.text for remark in recording.remarks)

"""A view shows the same events at other pixels; a region is the events inside it, by any slice."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from etnet.errors import RecordingError
from etnet.events import view as view_module
from etnet.events.open import View, open_recording
from etnet.events.recording import GroundTruth, recording_of_events
from etnet.events.write import write_recording
from tests.events.containers import all_events
from tests.strategies import make_events

FLIPS = ("none", "horizontal", "vertical", "both")
TURNS = (0, 90, 180, 270)


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    """A file with 2000 events and three pictures."""
    events = make_events(2000)
    pictures = np.random.default_rng(0).integers(0, 256, (3, 12, 20)).astype(np.float32) / 255
    truth = GroundTruth(np.array([0, 20_000, 40_000]), lambda i: pictures[i])
    path = tmp_path_factory.mktemp("view") / "events.h5"
    write_recording(recording_of_events(events, ground_truth=truth), path)
    return path, events, pictures


@pytest.mark.parametrize("flip", FLIPS)
@pytest.mark.parametrize("turn", TURNS)
@pytest.mark.parametrize("factor", [1, 2, 4])
def test_events_and_pictures_move_alike(written, flip, turn, factor):
    """An event picture made before the view and one made after it are the same picture."""
    path, events, pictures = written
    with open_recording(path, view=View(downsample=factor, flip=flip, rotate=turn)) as recording:
        moved = all_events(recording)
        assert recording.num_events == len(events)
        np.testing.assert_array_equal(moved.t, events.t)
        np.testing.assert_array_equal(moved.p, events.p)
        before = np.zeros((12, 20))
        np.add.at(before, (events.y, events.x), 1)
        after = np.zeros((recording.sensor.height, recording.sensor.width))
        np.add.at(after, (moved.y, moved.x), 1)
        np.testing.assert_array_equal(after, by_hand(before, factor, flip, turn, np.sum))
        frame = recording.ground_truth.read_frame(1)
        np.testing.assert_allclose(frame, by_hand(pictures[1], factor, flip, turn, np.mean), atol=1e-6)


def by_hand(picture, factor, flip, turn, join):
    """The slow twin: block by block, then numpy's own flips and turns (counter-clockwise, hence the minus)."""
    height, width = picture.shape[0] // factor, picture.shape[1] // factor
    block = lambda r, c: picture[r * factor : (r + 1) * factor, c * factor : (c + 1) * factor]  # noqa: E731
    joined = np.array([[join(block(r, c)) for c in range(width)] for r in range(height)])
    joined = {"none": joined, "horizontal": joined[:, ::-1], "vertical": joined[::-1], "both": joined[::-1, ::-1]}[flip]
    return np.rot90(joined, -(turn // 90))


@settings(max_examples=20, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=st.data())
def test_a_region_is_the_events_inside_it_by_any_slice(written, data, monkeypatch):
    path, events, pictures = written
    monkeypatch.setattr(view_module, "REGION_BLOCK", data.draw(st.sampled_from([97, 500, 65_536])))
    left, top = data.draw(st.integers(0, 19)), data.draw(st.integers(0, 11))
    width, height = data.draw(st.integers(1, 20 - left)), data.draw(st.integers(1, 12 - top))
    inside = (events.x >= left) & (events.x < left + width) & (events.y >= top) & (events.y < top + height)
    if not inside.any():
        with pytest.raises(RecordingError, match="no event lies"):
            open_recording(path, view=View(region=(left, top, width, height)))
        return
    with open_recording(path, view=View(region=(left, top, width, height))) as recording:
        assert (recording.sensor.width, recording.sensor.height) == (width, height)
        assert recording.num_events == np.count_nonzero(inside)
        assert recording.span == (events.t[inside][0], events.t[inside][-1])
        start = data.draw(st.integers(0, recording.num_events))
        stop = data.draw(st.integers(start, recording.num_events))
        part = recording.read(start, stop)
        np.testing.assert_array_equal(part.t, events.t[inside][start:stop])
        np.testing.assert_array_equal(part.x, events.x[inside][start:stop] - left)
        np.testing.assert_array_equal(part.y, events.y[inside][start:stop] - top)
        expected = pictures[2][top : top + height, left : left + width]
        np.testing.assert_array_equal(recording.ground_truth.read_frame(2), expected)


VIEWS = {
    "downsample": View(downsample=2),
    "flip and turn": View(flip="vertical", rotate=90),
    "region": View(region=(2, 2, 16, 8), downsample=2, rotate=270),
}


@pytest.mark.parametrize("form", VIEWS)
def test_a_view_keeps_the_pictures_colours_and_their_depth(form, tmp_path):
    view = VIEWS[form]
    pictures = np.random.default_rng(0).integers(0, 65_536, (3, 12, 20, 3)).astype(np.float32) / 65_535
    truth = GroundTruth(
        np.array([0, 20_000, 40_000]), lambda i: pictures[i].mean(2), white=65_535.0, read_colour=lambda i: pictures[i]
    )
    whole = recording_of_events(make_events(2000), ground_truth=truth)
    write_recording(whole, tmp_path / "a.h5")
    left, top, width, height = view.region or (0, 0, 20, 12)
    part = pictures[1][top : top + height, left : left + width]
    channels = [by_hand(part[..., c], view.downsample, view.flip, view.rotate, np.mean) for c in range(3)]
    with open_recording(tmp_path / "a.h5", view=view) as recording:
        seen = [recording.ground_truth]
        seen += [view_module.seen_whole(view, whole).ground_truth] if view.region is None else []
        for placed in seen:
            assert placed.white == 65_535
            assert placed.read_colour(1).shape == (recording.sensor.height, recording.sensor.width, 3)
            np.testing.assert_allclose(placed.read_colour(1), np.stack(channels, 2), atol=2e-5)


def test_a_view_of_grey_pictures_claims_no_colour(written):
    with open_recording(written[0], view=View(flip="both")) as recording:
        assert recording.ground_truth.read_colour is None


def test_binning_a_sensor_that_does_not_divide_loses_no_event(written):
    path, events, _ = written
    with open_recording(path, view=View(region=(0, 0, 19, 11), downsample=4)) as recording:
        assert (recording.sensor.width, recording.sensor.height) == (5, 3)
        assert recording.num_events == np.count_nonzero((events.x < 19) & (events.y < 11))
        assert recording.ground_truth.read_frame(0).shape == (3, 5)


def test_a_changed_view_is_said(written):
    with open_recording(written[0], view=View(downsample=2, flip="both")) as recording:
        said = " ".join(remark.text for remark in recording.remarks)
        assert "2×2" in said
        assert "both" in said


def test_a_region_beyond_the_sensor_is_refused(written):
    with pytest.raises(RecordingError, match="beyond its sensor"):
        open_recording(written[0], view=View(region=(10, 0, 11, 5)))

"""What `etnet convert-events` and `etnet cut` write, opens as the same events and frames."""

from __future__ import annotations

import numpy as np
import pytest

from etnet.cli.main import main
from etnet.errors import RecordingError
from etnet.events.cut import events_between
from etnet.events.events import Events
from etnet.events.open import Assumptions, open_recording
from etnet.events.recording import GroundTruth, recording_of_events
from etnet.events.write import write_recording
from tests.events.containers import all_events, assert_same_events
from tests.real_data import real_file
from tests.strategies import make_events

TARGETS = {
    "event_utils": "a.h5",
    "dsec": "a.hdf5",
    "aedat4": "a.aedat4",
    "evt3": "a.raw",
    "mvsec": "b.hdf5",
    "es": "a.es",
    "text": "a.txt",
    "rpg": "folder",
    "csv": "a.csv",
    "npz": "a.npz",
}


@pytest.fixture
def with_frames(tmp_path):
    """A made-up recording with a frame every 5 ms, on disk and in memory."""
    events = make_events(4000)
    stamps = np.arange(int(events.t[0]), int(events.t[-1]), 5000)
    pictures = np.random.default_rng(0).integers(0, 256, (len(stamps), 12, 20)).astype(np.float32) / 255
    recording = recording_of_events(events, ground_truth=GroundTruth(stamps, lambda i: pictures[i]))
    write_recording(recording, tmp_path / "whole.h5")
    return tmp_path / "whole.h5", recording


@pytest.mark.real
@pytest.mark.parametrize("layout", TARGETS)
def test_a_real_recording_converted_there_and_back_is_the_same(layout, tmp_path):
    source, there, back = real_file("derived/slider_depth_0.5s_mvsec.hdf5"), tmp_path / TARGETS[layout], "back.h5"
    assert main(["convert-events", str(source), str(there), "--layout", layout]) == 0
    stated = ["--assume", "width=240,height=180"]
    assert main(["convert-events", str(there), str(tmp_path / back), *stated]) == 0
    with open_recording(source) as first, open_recording(tmp_path / back) as second:
        assert_same_events(all_events(first), all_events(second))
        start = all_events(first).t[0] if layout == "es" else 0  # it has no place for stamps since 1970
        np.testing.assert_array_equal(all_events(first).t - start, all_events(second).t)
        if layout == "event_utils":
            np.testing.assert_array_equal(
                first.ground_truth.stamps[: len(second.ground_truth)], second.ground_truth.stamps
            )


def test_cuts_that_share_a_border_make_the_whole_again(with_frames, tmp_path):
    path, recording = with_frames
    border, parts = f"{recording.span.duration / 3e6:.6f}", []
    assert main(["cut", str(path), str(tmp_path / "1.npz"), "--to", border]) == 0
    assert main(["cut", str(path), str(tmp_path / "2.npz"), "--from", border]) == 0
    for name in ("1.npz", "2.npz"):
        with open_recording(tmp_path / name) as part:
            parts.append(all_events(part))
    assert parts[0].t[-1] < recording.span.start + round(float(border) * 1e6) <= parts[1].t[0]
    assert_same_events(Events.concatenate(parts, recording.sensor), all_events(recording))


def test_a_cut_has_the_frames_around_its_events(with_frames, tmp_path):
    path, whole = with_frames
    begin, end = 0.0061, 0.0173
    assert main(["cut", str(path), str(tmp_path / "part.h5"), "--from", str(begin), "--to", str(end)]) == 0
    with open_recording(tmp_path / "part.h5") as part:
        assert_same_events(all_events(part), whole.read(*events_between(whole, begin, end)))
        # The one before the first event begins the first window.
        np.testing.assert_array_equal(part.ground_truth.stamps, whole.ground_truth.stamps[1:4])
        for i in range(3):
            np.testing.assert_array_equal(part.ground_truth.read_frame(i), whole.ground_truth.read_frame(i + 1))


def test_a_cut_at_a_frame_has_that_frame_though_no_event_has_its_stamp(with_frames, tmp_path):
    path, whole = with_frames
    border = int(whole.ground_truth.stamps[3]) - whole.span.start
    assert main(["cut", str(path), str(tmp_path / "part.h5"), "--to", f"{border / 1e6:.6f}"]) == 0
    with open_recording(tmp_path / "part.h5") as part:
        assert part.span.stop < whole.ground_truth.stamps[3]
        np.testing.assert_array_equal(part.ground_truth.stamps, whole.ground_truth.stamps[:4])


@pytest.mark.parametrize(("begin", "end"), [(0.02, 0.01), (-1.0, 0.1), (float("nan"), 1.0), (9e9, None), (0.0, 0.0)])
def test_a_cut_of_nothing_says_how_long_the_recording_is(begin, end):
    recording = recording_of_events(make_events(100))
    with pytest.raises(RecordingError, match=f"{recording.span.duration / 1e6:.6f} s"):
        events_between(recording, begin, end)


def test_a_cut_without_events_is_refused():
    events = make_events(100)
    t = events.t.copy()
    t[50:] += 1_000_000
    recording = recording_of_events(Events(events.x, events.y, t, events.p, events.sensor))
    with pytest.raises(RecordingError, match="no event"):
        events_between(recording, 0.5, 0.6)


def test_options_of_opening_apply_and_a_file_is_replaced_only_when_told(with_frames, tmp_path, capsys):
    path, whole = with_frames
    target = tmp_path / "small.npz"
    assert main(["convert-events", str(path), str(target), "--region", "0", "0", "10", "6"]) == 0
    with open_recording(target) as small:
        assert (small.sensor.width, small.sensor.height) == (10, 6)
    before = target.read_bytes()
    assert main(["convert-events", str(path), str(target)]) == 1
    assert "already" in capsys.readouterr().err
    assert target.read_bytes() == before
    assert main(["convert-events", str(path), str(target), "--overwrite"]) == 0
    with open_recording(target) as large:
        assert_same_events(all_events(large), all_events(whole))


def test_a_suffix_of_no_layout_is_told_the_layouts_and_to_overrules(with_frames, tmp_path, capsys):
    path, whole = with_frames
    assert main(["convert-events", str(path), str(tmp_path / "a.dat")]) == 1
    assert "event_utils" in capsys.readouterr().err
    assert main(["convert-events", str(path), str(tmp_path / "a.dat"), "--layout", "csv"]) == 0
    with open_recording(tmp_path / "a.dat", assume=Assumptions(width=20, height=12)) as back:
        assert_same_events(all_events(back), all_events(whole))

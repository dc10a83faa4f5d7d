"""What is written comes back the same, and a failure leaves nothing behind."""

from __future__ import annotations

from dataclasses import replace

import eventcv
import faery
import h5py
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from etnet.errors import RecordingError
from etnet.events.events import Events, Sensor
from etnet.events.open import Assumptions, open_recording
from etnet.events.recording import GroundTruth, Inertial, recording_of_events
from etnet.events.write import write_recording
from tests.events.containers import all_events, assert_same_events
from tests.real_data import real_file

LAYOUTS = {
    "event_utils": ".h5",
    "dsec": ".h5",
    "mvsec": ".hdf5",
    "aedat4": ".aedat4",
    "evt3": ".raw",
    "es": ".es",
    "text": ".txt",
    "rpg": "",
    "csv": ".csv",
    "npz": ".npz",
}


def random_events(rng: np.random.Generator, count: int, sensor: Sensor, first: int = 0) -> Events:
    """Uniform in space, sorted in time."""
    return Events(
        rng.integers(0, sensor.width, count).astype(np.uint16),
        rng.integers(0, sensor.height, count).astype(np.uint16),
        first + np.sort(rng.integers(0, 50 * count + 1, count)),
        rng.choice(np.array([-1, 1], np.int8), count),
        sensor,
    )


@pytest.mark.parametrize("layout", LAYOUTS)
@settings(max_examples=15, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    seed=st.integers(0, 2**32 - 1),
    count=st.integers(1, 400),
    first=st.sampled_from([0, 5, 3811, 1_468_939_802_003_811]),
)
def test_events_written_and_read_are_the_same(layout, tmp_path, seed, count, first):
    sensor = Sensor(240, 180)
    events = random_events(np.random.default_rng(seed), count, sensor, first)
    path = tmp_path / f"part{LAYOUTS[layout]}"
    said = write_recording(recording_of_events(events), path, layout, overwrite=True)
    has_moved = any("Event Stream has no place for a later beginning" in str(remark) for remark in said)
    assert has_moved == (layout == "es" and first > 10**9)
    with open_recording(path, assume=Assumptions(width=240, height=180)) as back:
        assert back.sensor == sensor
        found = all_events(back)
        assert_same_events(found, events)
        np.testing.assert_array_equal(found.t, events.t - (events.t[0] if has_moved else 0))


@pytest.mark.real
@pytest.mark.parametrize("layout", LAYOUTS)
def test_a_real_recording_survives_every_layout(layout, tmp_path):
    path = tmp_path / f"again{LAYOUTS[layout]}"
    with open_recording(real_file("derived/slider_depth_0.5s_mvsec.hdf5")) as recording:
        write_recording(recording, path, layout)
        with open_recording(path) as back:
            assert back.sensor == recording.sensor
            assert_same_events(all_events(back), all_events(recording))


PAUSES = ((0, 1000, 20_001_000, 20_002_000), (0, 12_000_000, 12_001_000, 17_001_000), (5, 60_000_005, 60_000_010))
"""Stamps over more than EVT3's clock counts, 16.78 s, with pauses in which it begins anew once, at its end, thrice."""


@pytest.mark.parametrize("layout", LAYOUTS)
@pytest.mark.parametrize("stamps", PAUSES)
def test_a_long_pause_is_as_long_when_read_again(layout, stamps, tmp_path):
    stamps = np.array([*stamps, *range(stamps[-1] + 5000, stamps[-1] + 20_000_000, 5000)], np.int64)
    random = random_events(np.random.default_rng(0), len(stamps), Sensor(240, 180))
    events = Events(random.x, random.y, stamps, random.p, random.sensor)
    path = tmp_path / f"pause{LAYOUTS[layout]}"
    write_recording(recording_of_events(events), path, layout)
    with open_recording(path, assume=Assumptions(width=240, height=180)) as back:
        assert_same_events(all_events(back), events)
        np.testing.assert_array_equal(all_events(back).t, stamps)
    if layout == "evt3":
        # Other readers have only the step of the clock from its end to 0 to tell a turn by.
        theirs = np.concatenate(list(faery.events_stream_from_file(path)))
        np.testing.assert_array_equal(theirs["t"].astype(np.int64), stamps)
        np.testing.assert_array_equal(eventcv.load(str(path)).numpy()[:, 2].astype(np.int64), stamps - stamps[0])


QUIET = [*((layout, 1000, 20) for layout in LAYOUTS), *((layout, 150, 600) for layout in LAYOUTS)]
"""Events, and seconds; a text has no place for its unit, and so little is not held to be a recording in seconds."""


@pytest.mark.parametrize(
    ("layout", "count", "seconds"), [one for one in QUIET if one[1] > 150 or one[0] not in ("text", "rpg")]
)
def test_a_quiet_recording_is_as_long_when_read_again(layout, count, seconds, tmp_path):
    sensor = Sensor(346, 260)
    random = random_events(np.random.default_rng(7), count, sensor)
    stamps = np.sort(np.random.default_rng(8).integers(0, seconds * 10**6 + 1, count))
    events = Events(random.x, random.y, stamps, random.p, sensor)
    path = tmp_path / f"quiet{LAYOUTS[layout]}"
    write_recording(recording_of_events(events), path, layout)
    with open_recording(path, assume=Assumptions(width=346, height=260)) as back:
        np.testing.assert_array_equal(all_events(back).t, stamps)


def test_another_reader_finds_the_same_events_in_an_event_stream_and_in_aedat4(tmp_path):
    events = random_events(np.random.default_rng(5), 3000, Sensor(61, 43), first=900)
    for name in ("a.es", "a.aedat4"):
        write_recording(recording_of_events(events), tmp_path / name)
        theirs = np.concatenate(list(faery.events_stream_from_file(tmp_path / name)))
        np.testing.assert_array_equal(theirs["t"].astype(np.int64), events.t)
        np.testing.assert_array_equal(theirs["x"], events.x)
        np.testing.assert_array_equal(theirs["y"], events.y)
        np.testing.assert_array_equal(theirs["on"], events.p > 0)


def _with_frames(count: int = 300) -> tuple[Events, GroundTruth]:
    events = random_events(np.random.default_rng(3), count, Sensor(20, 10))
    pictures = np.random.default_rng(4).integers(0, 256, (5, 10, 20)).astype(np.float32) / 255
    stamps = np.linspace(-10, int(events.t[-1]), 5).astype(np.int64)
    return events, GroundTruth(stamps, lambda i: pictures[i])


def test_frames_come_back_where_the_layout_has_them(tmp_path):
    events, truth = _with_frames()
    recording = recording_of_events(events, ground_truth=truth)
    start, stop = recording.index_at(int(truth.stamps[1])), recording.index_at(int(truth.stamps[3]) + 1)
    write_recording(recording, tmp_path / "cut.h5", start=start, stop=stop)
    with open_recording(tmp_path / "cut.h5") as back:
        assert_same_events(all_events(back), events[start:stop])
        first, last = int(events.t[start]), int(events.t[stop - 1])
        kept = [i for i, stamp in enumerate(truth.stamps) if stamp <= last]
        kept = [i for i in kept if i + 1 == len(truth) or truth.stamps[i + 1] > first]
        np.testing.assert_array_equal(back.ground_truth.stamps, truth.stamps[kept])
        for number, index in enumerate(kept):
            np.testing.assert_array_equal(back.ground_truth.read_frame(number), truth.read_frame(index))


def test_what_a_layout_cannot_hold_is_said(tmp_path):
    events, truth = _with_frames()
    remarks = write_recording(recording_of_events(events, ground_truth=truth), tmp_path / "a.npz")
    assert any("frames were not written" in remark.text for remark in remarks)


@pytest.mark.parametrize("layout", LAYOUTS)
def test_the_sensor_comes_back_or_that_it_does_not_is_said(layout, tmp_path):
    recording = recording_of_events(random_events(np.random.default_rng(0), 50, Sensor(61, 43)))
    recording = replace(recording, sensor=Sensor(99, 77))
    path = tmp_path / f"a{LAYOUTS[layout]}"
    said = write_recording(recording, path, layout)
    if layout == "csv":
        assert any("99×77" in str(remark) for remark in said)
    else:
        with open_recording(path) as back:
            assert back.sensor == recording.sensor


@pytest.mark.parametrize("layout", LAYOUTS)
def test_that_motion_is_not_written_is_said(layout, tmp_path):
    inertial = Inertial(np.arange(3), np.zeros((3, 3), np.float32), np.zeros((3, 3), np.float32))
    recording = recording_of_events(random_events(np.random.default_rng(0), 50, Sensor(61, 43)))
    path = tmp_path / f"a{LAYOUTS[layout]}"
    assert not any("motion" in str(remark) for remark in write_recording(recording, path, layout))
    said = write_recording(replace(recording, inertial=inertial), path, layout, overwrite=True)
    assert any("3 samples of the camera's motion" in str(remark) for remark in said)


def test_dsec_index_obeys_its_definition(tmp_path):
    events = random_events(np.random.default_rng(1), 500, Sensor(640, 480), first=77_000)
    write_recording(recording_of_events(events), tmp_path / "a.h5", "dsec")
    with h5py.File(tmp_path / "a.h5") as file:
        t, index = file["events/t"][:], file["ms_to_idx"][:].astype(int)
        assert index[0] == 0
        for ms in range(1, len(index)):
            assert t[index[ms]] >= 1000 * ms
            assert t[index[ms] - 1] < 1000 * ms


def test_an_existing_file_is_not_overwritten_unasked(tmp_path):
    events, _ = _with_frames()
    path = tmp_path / "a.csv"
    path.write_text("mine")
    with pytest.raises(RecordingError, match="already"):
        write_recording(recording_of_events(events), path)
    assert path.read_text() == "mine"


@pytest.mark.parametrize("layout", LAYOUTS)
def test_a_failure_leaves_no_file(layout, tmp_path):
    events, _ = _with_frames()
    recording = recording_of_events(events)

    def stop_here(fraction: float) -> None:
        raise RuntimeError("the user gave up")

    with pytest.raises(RecordingError, match="gave up"):
        write_recording(recording, tmp_path / f"a{LAYOUTS[layout]}", layout, progress=stop_here)
    assert list(tmp_path.iterdir()) == []


def test_an_unknown_suffix_names_the_layouts(tmp_path):
    events, _ = _with_frames()
    with pytest.raises(RecordingError, match="event_utils"):
        write_recording(recording_of_events(events), tmp_path / "a.xyz")

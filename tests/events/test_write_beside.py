"""What lies beside the events comes back where a layout has a place for it, and is called missing where it has none."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

from etnet.errors import EtnetError, RecordingError
from etnet.events.events import Sensor
from etnet.events.open import open_recording
from etnet.events.provenance import Provenance
from etnet.events.recording import GroundTruth, Recording, recording_of_events
from etnet.events.triggers import Triggers
from etnet.events.write import WITHOUT_PROVENANCE, write_recording
from tests.events.containers import all_events, assert_same_events
from tests.events.test_write import LAYOUTS, random_events

WITH_FRAMES = ("event_utils", "mvsec", "aedat4", "rpg")
WITH_COLOUR = ("event_utils", "aedat4", "rpg")
WITH_TRIGGERS = ("event_utils", "dsec", "mvsec", "aedat4", "evt3")
HEIGHT, WIDTH = 10, 20


def filmed(white: int, darkest_of: int = 1, has_colour: bool = False) -> Recording:
    """A recording with five frames of up to white / `darkest_of`."""
    events = random_events(np.random.default_rng(3), 300, Sensor(WIDTH, HEIGHT), first=50)
    shape = (5, HEIGHT, WIDTH, 3) if has_colour else (5, HEIGHT, WIDTH)
    values = np.random.default_rng(4).integers(0, white // darkest_of + 1, shape).astype(np.float32) / np.float32(white)
    stamps = np.linspace(20, int(events.t[-1]), 5).astype(np.int64)
    weights = np.array([0.114, 0.587, 0.299], np.float32)
    truth = GroundTruth(
        stamps,
        (lambda i: values[i] @ weights) if has_colour else (lambda i: values[i]),
        white=float(white),
        read_colour=(lambda i: values[i]) if has_colour else None,
    )
    return recording_of_events(events, ground_truth=truth)


@pytest.mark.parametrize("layout", WITH_FRAMES)
def test_a_whole_recording_keeps_the_frames_before_and_after_its_events(layout, tmp_path):
    recording = filmed(255)
    stamps = np.array([3, 9, 1000, int(recording.span.stop) + 1, int(recording.span.stop) + 33_000])
    truth = replace(recording.ground_truth, stamps=stamps)
    path = tmp_path / f"a{LAYOUTS[layout]}"
    write_recording(replace(recording, ground_truth=truth), path, layout)
    with open_recording(path) as back:
        np.testing.assert_array_equal(back.ground_truth.stamps, stamps)


@pytest.mark.parametrize("layout", WITH_FRAMES)
@pytest.mark.parametrize(("white", "darkest_of"), [(255, 1), (65_535, 1), (65_535, 500)])
def test_frames_keep_stamps_numbers_and_depth(layout, white, darkest_of, tmp_path):
    recording = filmed(white, darkest_of)
    path = tmp_path / f"a{LAYOUTS[layout]}"
    said = write_recording(recording, path, layout)
    assert not any("frames" in str(remark) for remark in said)
    with open_recording(path) as back:
        assert_same_events(all_events(back), all_events(recording))
        np.testing.assert_array_equal(back.ground_truth.stamps, recording.ground_truth.stamps)
        assert back.ground_truth.white == white
        for index in range(5):
            written = np.rint(recording.ground_truth.read_frame(index) * white)
            np.testing.assert_array_equal(np.rint(back.ground_truth.read_frame(index) * white), written)


@pytest.mark.parametrize("layout", LAYOUTS)
def test_colours_come_back_or_that_they_do_not_is_said(layout, tmp_path):
    recording = filmed(255, has_colour=True)
    path = tmp_path / f"a{LAYOUTS[layout]}"
    said = write_recording(recording, path, layout)
    assert any("frames were" in str(remark) for remark in said) == (layout not in WITH_COLOUR)
    if layout in WITH_COLOUR:
        with open_recording(path) as back:
            for index in range(5):
                truth, found = recording.ground_truth.read_colour(index), back.ground_truth.read_colour(index)
                np.testing.assert_array_equal(np.rint(found * 255), np.rint(truth * 255))
                np.testing.assert_allclose(
                    back.ground_truth.read_frame(index), recording.ground_truth.read_frame(index), atol=1e-6
                )


def test_frames_without_colours_have_none(tmp_path):
    write_recording(filmed(255), tmp_path / "a.h5")
    with open_recording(tmp_path / "a.h5") as back:
        assert back.ground_truth.read_colour is None


@pytest.mark.parametrize("layout", LAYOUTS)
def test_triggers_come_back_or_that_they_do_not_is_said(layout, tmp_path):
    recording = filmed(255)
    stamps = recording.span.start + np.array([0, 40, 40, 900, 2000])
    triggers = Triggers(stamps, np.array([0, 1, 0, 3, 0], np.int16), np.array([1, -1, 1, -1, 1], np.int8))
    path = tmp_path / f"a{LAYOUTS[layout]}"
    said = write_recording(replace(recording, triggers=triggers), path, layout)
    assert any("triggers were not written" in str(remark) for remark in said) == (layout not in WITH_TRIGGERS)
    if layout not in WITH_TRIGGERS:
        return
    with open_recording(path) as back:
        np.testing.assert_array_equal(back.triggers.stamps, stamps)
        np.testing.assert_array_equal(back.triggers.edges, triggers.edges)
        if layout == "aedat4":
            assert any("inputs were not written" in str(remark) for remark in said)
        else:
            np.testing.assert_array_equal(back.triggers.channels, triggers.channels)


def test_a_cut_keeps_the_triggers_in_its_stretch(tmp_path):
    recording = filmed(255)
    stamps = np.arange(0, 12_000, 1000)
    triggers = Triggers(stamps, np.zeros(12, np.int16), np.ones(12, np.int8))
    start, stop = recording.index_at(3000), recording.index_at(7000)
    whole = replace(recording, triggers=triggers)
    write_recording(whole, tmp_path / "a.h5", start=start, stop=stop, span=(3000, 7000))
    with open_recording(tmp_path / "a.h5") as back:
        np.testing.assert_array_equal(back.triggers.stamps, [3000, 4000, 5000, 6000, 7000])


def test_damaged_triggers_do_not_cost_the_events(tmp_path):
    import h5py

    write_recording(filmed(255), tmp_path / "a.h5")
    with h5py.File(tmp_path / "a.h5", "a") as file:
        file["triggers/t"], file["triggers/channel"], file["triggers/edge"] = [1, 2], [0], [1.5]
    with open_recording(tmp_path / "a.h5") as back:
        assert back.triggers is None
        assert back.num_events == 300
        assert any("the triggers were left out" in str(remark) for remark in back.remarks)


def test_flow_survives_the_layout_that_has_it(tmp_path):
    recording = filmed(255)
    flows = np.random.default_rng(6).normal(size=(5, 2, HEIGHT, WIDTH)).astype(np.float32)
    flows[0] = 0
    truth = replace(recording.ground_truth, read_flow=lambda i: flows[i])
    write_recording(replace(recording, ground_truth=truth), tmp_path / "a.h5")
    with open_recording(tmp_path / "a.h5") as back:
        for index in range(5):
            np.testing.assert_allclose(back.ground_truth.read_flow(index), flows[index], rtol=1e-5, atol=1e-6)
    said = write_recording(replace(recording, ground_truth=truth), tmp_path / "a.aedat4")
    assert any("flow was not written" in str(remark) for remark in said)


@pytest.mark.parametrize("layout", LAYOUTS)
def test_how_it_was_made_stays_with_the_recording(layout, tmp_path):
    made = Provenance("simulated from Zürich <1>.mp4", json.dumps({"pos_thres": 0.2, "seed": 7}), "a cut; & more")
    recording = replace(filmed(255), provenance=made)
    path = tmp_path / f"a{LAYOUTS[layout]}"
    write_recording(recording, path, layout)
    with open_recording(path) as back:
        if layout in WITHOUT_PROVENANCE:
            assert back.provenance is None
            return
        assert json.loads(back.provenance.parameters) == json.loads(made.parameters)
        assert back.provenance.remarks == made.remarks
        told = " ".join(map(str, back.remarks))
        assert '"pos_thres": 0.2' in told
        assert "a cut; & more" in told
        # Once more, in the form that every reader of this field knows.
        write_recording(back, tmp_path / "again.h5")
    with open_recording(tmp_path / "again.h5") as again:
        assert again.provenance.parameters == made.parameters


def test_a_folder_of_something_else_is_never_replaced(tmp_path):
    mine = tmp_path / "mine"
    mine.mkdir()
    (mine / "events.txt").write_text("0.1 1 1 1\n")
    (mine / "thesis.tex").write_text("years of work")
    with pytest.raises(RecordingError, match=r"thesis\.tex"):
        write_recording(filmed(255), mine, "rpg", overwrite=True)
    assert sorted(entry.name for entry in mine.iterdir()) == ["events.txt", "thesis.tex"]


def test_a_folder_is_replaced_on_request_alone_and_whole(tmp_path):
    write_recording(filmed(255), tmp_path / "a", "rpg")
    with pytest.raises(RecordingError, match="already"):
        write_recording(filmed(65_535), tmp_path / "a", "rpg")
    events = recording_of_events(random_events(np.random.default_rng(3), 300, Sensor(99, 77)))
    write_recording(events, tmp_path / "a", "rpg", overwrite=True)
    assert [entry.name for entry in tmp_path.iterdir()] == ["a"]
    with open_recording(tmp_path / "a") as back:
        assert back.ground_truth is None
        assert back.sensor == Sensor(99, 77)
    (tmp_path / "file.txt").write_text("mine")
    with pytest.raises(EtnetError):
        write_recording(events, tmp_path / "file.txt" / "a", "rpg")


def test_a_sensor_that_a_layout_cannot_count_is_refused(tmp_path):
    events = random_events(np.random.default_rng(0), 50, Sensor(40_000, 20))
    for layout in ("event_utils", "aedat4", "evt3"):
        with pytest.raises(RecordingError, match="does not fit"):
            write_recording(recording_of_events(events), tmp_path / f"a{LAYOUTS[layout]}", layout)

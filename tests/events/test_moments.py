"""Moments come from what people have: tables of every spelling, Kalibr's folder, triggers, a camera's frames."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from etnet.errors import RecordingError
from etnet.events.moments import divided, moments_of_frames, moments_of_triggers, read_moments
from etnet.events.recording import GroundTruth, Span, recording_of_events
from etnet.events.triggers import Triggers
from tests.strategies import make_events

EPOCH = 1_403_636_579_763_555
"""µs."""
SPAN = Span(EPOCH, EPOCH + 10_000_000)
NANOSECONDS = [(EPOCH + 1_000_000 * i) * 1000 + 584 for i in range(3)]

TABLES = {
    "EuRoC": ("#timestamp [ns],filename\n", "{ns},{ns}.png\n"),
    "named µs": ("frame,stamp_us\n", "7,{us}\n"),
    "its own unit in the name": ("id,t_us,note\n", "7,{us},x\n"),
    "seconds with fractions": ("", "{s}\n"),
    "images.txt": ("", "{s} images/frame.png\n"),
    "bare ns": ("", "{ns}\n"),
    "bare µs": ("# made by hand\n", "{us}\n"),
    "seconds named": ("time (s);name\n", "{s};a\n"),
    "quoted": ('"timestamp","name"\n', '"{ns}","a"\n'),
    "our own stamps.csv": ("frame,t_stop_us,t_start_us,num_events\n", "0,{us},0,5\n"),
    "a former stamps.csv of ours": ("frame,stamp_us,start_us,num_events\n", "0,{us},0,5\n"),
}


@pytest.mark.parametrize("kind", list(TABLES))
def test_stamps_of_every_table_are_those_that_went_in(kind, tmp_path):
    head, row = TABLES[kind]
    path = tmp_path / "calib.csv"
    rows = [row.format(ns=ns, us=ns // 1000, s=f"{ns // 10**9}.{ns % 10**9:09d}") for ns in NANOSECONDS]
    path.write_text(head + "".join(rows))
    found = read_moments(path, SPAN)
    is_exact = "us" not in row
    np.testing.assert_array_equal(
        found.nanoseconds, NANOSECONDS if is_exact else [ns // 1000 * 1000 for ns in NANOSECONDS]
    )
    np.testing.assert_array_equal(found.stamps, [ns // 1000 + is_exact for ns in NANOSECONDS])


def test_a_folder_of_pictures_gives_the_moments_of_their_names(tmp_path):
    for ns in NANOSECONDS[::-1]:
        (tmp_path / f"{ns}.png").write_bytes(b"")
    (tmp_path / "notes.txt").write_text("x")
    np.testing.assert_array_equal(read_moments(tmp_path, SPAN).nanoseconds, NANOSECONDS)


def test_a_stated_unit_wins(tmp_path):
    path = tmp_path / "a.csv"
    path.write_text("1\n2\n3\n")
    assert read_moments(path, SPAN, "ms").stamps.tolist() == [1000, 2000, 3000]


@pytest.mark.parametrize(
    "text", ["", "# nothing\n", "t\n1\nx\n", "1\nnan\n", "1e400\n", "1e999999\n", "1e999980\n", "\x00\x01\n"]
)
def test_what_is_no_table_of_stamps_is_one_line(text, tmp_path):
    path = tmp_path / "a.csv"
    path.write_text(text)
    with pytest.raises(RecordingError) as told:
        read_moments(path, SPAN)
    assert "\n" not in str(told.value)


def test_moments_are_ascending_and_each_is_there_once(tmp_path):
    path = tmp_path / "a.csv"
    path.write_text("30\n10\n10\n20\n")
    found = read_moments(path, Span(0, 100))
    assert found.stamps.tolist() == [10, 20, 30]
    assert "3 of them different" in found.said


def test_moments_outside_the_events_are_left_out_and_told(tmp_path):
    path = tmp_path / "a.csv"
    path.write_text("5\n50\n500\n")
    found = read_moments(path, Span(0, 100), "us").within(Span(10, 100))
    assert found.stamps.tolist() == [50]
    assert "2 outside" in found.said


def test_moments_of_triggers_and_frames():
    triggers = Triggers(np.array([5, 9]), np.array([0, 1], np.int16), np.array([1, -1], np.int8))
    assert moments_of_triggers(triggers, "a").stamps.tolist() == [5, 9]
    with pytest.raises(RecordingError, match="no such triggers"):
        moments_of_triggers(triggers.chosen(channel=3), "a")
    truth = GroundTruth(np.array([3, 4]), lambda i: np.zeros((2, 2), np.float32))
    assert moments_of_frames(truth, "a").stamps.tolist() == [3, 4]
    with pytest.raises(RecordingError, match="no frames"):
        moments_of_frames(None, "a")


def test_divided_moments_hold_the_given_ones_and_as_many_between():
    events = make_events(100)
    recording = recording_of_events(replace(events, t=events.t + EPOCH - int(events.t[0])))
    stamps = np.array([EPOCH + 1000, EPOCH + 2001, EPOCH + 5000])
    found = divided(stamps, recording, 4)
    assert set(stamps.tolist()) <= set(found.tolist())
    assert len(found) == 12
    assert divided(stamps, recording, 1).tolist() == stamps.tolist()

"""What is odd in a file is mended and said, or refused with the remedy."""

from __future__ import annotations

import os
import socket

import numpy as np
import pytest

from etnet.errors import RecordingError
from etnet.events import cache
from etnet.events.formats import paged
from etnet.events.formats.columns import BLOCK
from etnet.events.open import Assumptions, open_recording
from tests.events.containers import all_events
from tests.real_data import real_file
from tests.strategies import make_events


def save(path, **columns):
    np.savez(path, **columns)
    return path


def columns_of(events) -> dict:
    return {"x": events.x, "y": events.y, "t": events.t, "p": events.p, "width": 20, "height": 12}


def said(recording) -> str:
    return "\n".join(map(str, recording.remarks))


@pytest.mark.parametrize("coding", ["0/1", "bool", "±1", "float"])
def test_every_usual_polarity_coding_becomes_plus_and_minus_one(coding, tmp_path):
    events = make_events(100)
    stored = {
        "0/1": (events.p > 0).astype(np.uint8),
        "bool": events.p > 0,
        "±1": events.p,
        "float": events.p.astype(float),
    }
    path = save(tmp_path / "a.npz", **columns_of(events) | {"p": stored[coding]})
    called = {"0/1": "0/1", "bool": "as booleans", "±1": "−1/+1", "float": "−1/+1"}
    with open_recording(path) as recording:
        np.testing.assert_array_equal(all_events(recording).p, events.p)
        assert f"detected: polarity is coded {called[coding]}" in said(recording)


@pytest.mark.parametrize(("row", "coding"), [("0.1 1 2 -1\n0.2 3 4 1\n", "−1/+1"), ("0.1 1 2 0\n0.2 3 4 1\n", "0/1")])
def test_the_polarity_coding_of_text_is_told(row, coding, tmp_path):
    (tmp_path / "a.txt").write_text(row)
    with open_recording(tmp_path / "a.txt") as recording:
        assert f"detected: polarity is coded {coding}" in said(recording)
        assert all_events(recording).p.tolist() == [-1, 1]


def test_an_unusual_polarity_coding_is_refused_and_can_be_allowed(tmp_path):
    events = make_events(100)
    path = save(tmp_path / "a.npz", **columns_of(events) | {"p": np.arange(100) % 4})
    with pytest.raises(RecordingError, match="--polarity positive"):
        open_recording(path)
    with open_recording(path, assume=Assumptions(polarity="positive")) as recording:
        np.testing.assert_array_equal(all_events(recording).p, np.where(np.arange(100) % 4, 1, -1))
        assert "assumed: every polarity above 0 is ON, as stated" in said(recording)
    path = save(tmp_path / "b.npz", **columns_of(events))
    with open_recording(path, assume=Assumptions(polarity="inverted")) as recording:
        np.testing.assert_array_equal(all_events(recording).p, -events.p)
        assert "assumed: ON and OFF are swapped, as stated" in said(recording)


@pytest.mark.parametrize(("unit", "scale"), [("s", 1e-6), ("ms", 1e-3), ("us", 1), ("ns", 1000)])
def test_any_unit_of_time_can_be_stated(unit, scale, tmp_path):
    events = make_events(100)
    path = save(tmp_path / "a.npz", **columns_of(events) | {"t": events.t * scale})
    with open_recording(path, assume=Assumptions(time_unit=unit)) as recording:
        np.testing.assert_array_equal(all_events(recording).t, events.t)


def test_units_that_values_tell_are_found_and_said(tmp_path):
    events = make_events(100)
    epoch = 1_700_000_000_000_000_000 + events.t * 1000
    for stored, unit in ((events.t / 1e6, "s"), (events.t, "us"), (epoch, "ns")):
        path = save(tmp_path / f"{unit}.npz", **columns_of(events) | {"t": stored})
        with open_recording(path) as recording:
            np.testing.assert_array_equal(np.diff(all_events(recording).t), np.diff(events.t))
            assert f"assumed: time unit {unit}" in said(recording)


def shuffled(step: int):
    """Events of which one comes `step` µs too late."""
    events = make_events(100, duration=10**6)
    t = np.arange(100) * 10_000
    t[50] = t[49] - step
    return events, t


@pytest.mark.parametrize("suffix", [".npz", ".txt"])
def test_time_that_runs_back_is_refused_naming_the_event_and_sorted_on_demand(suffix, tmp_path):
    events, t = shuffled(200_000)
    path = tmp_path / f"a{suffix}"
    if suffix == ".npz":
        save(path, **columns_of(events) | {"t": t})
    else:
        rows = zip(t, events.x, events.y, events.p, strict=True)
        path.write_text("".join(f"{int(a) / 1e6:.6f} {b} {c} {int(d > 0)}\n" for a, b, c, d in rows))
    with pytest.raises(RecordingError, match=r"event 50.*--sort"), open_recording(path) as recording:
        all_events(recording)
    with open_recording(path, assume=Assumptions(sort=True, width=20, height=12)) as recording:
        order = np.argsort(t, kind="stable")
        found = all_events(recording)
        np.testing.assert_array_equal(found.t, t[order])
        np.testing.assert_array_equal(found.x, events.x[order])
        assert "repaired: time ran back 1 times, first at event 50" in said(recording)


@pytest.mark.parametrize("is_short", [True, False])
@pytest.mark.parametrize("place", [BLOCK - 1, BLOCK, BLOCK + 1, 2 * BLOCK])
def test_a_step_back_is_found_where_two_looks_meet(place, is_short, tmp_path, monkeypatch):
    monkeypatch.setattr(paged, "SHORT", paged.SHORT if is_short else 0)
    num_events = 2 * BLOCK + 5
    events, t = make_events(num_events), np.arange(num_events) * 1000
    t[place] -= 2500
    path = save(tmp_path / "a.npz", **columns_of(events) | {"t": t})
    with pytest.raises(RecordingError, match=f"event {place} .*--sort"), open_recording(path) as recording:
        all_events(recording)


def test_a_stamp_that_is_no_time_is_named_wherever_it_stands(tmp_path):
    num_events = 2 * BLOCK
    events, t = make_events(num_events), np.arange(num_events) / 1e6
    t[BLOCK + 7] = np.nan
    path = save(tmp_path / "a.npz", **columns_of(events) | {"t": t})
    with pytest.raises(RecordingError, match=f"stamp of event {BLOCK + 7} is nan"):
        open_recording(path)


def test_small_steps_back_of_a_decoded_format_are_sorted_and_said(tmp_path):
    path = tmp_path / "a.txt"
    path.write_text("0.001 1 1 1\n0.002 2 2 0\n0.001990 3 3 1\n0.003 4 4 1\n")
    with open_recording(path) as recording:
        assert all_events(recording).x.tolist() == [1, 3, 2, 4]
        assert "repaired: time ran back" in said(recording)


def test_stray_events_beyond_a_stated_sensor_are_dropped_and_many_are_refused(tmp_path):
    path = tmp_path / "a.txt"
    path.write_text("20 12\n" + "".join(f"0.{i:06d} 3 4 1\n" for i in range(500)) + "0.5 25 4 1\n0.6 3 4 1\n")
    with open_recording(path) as recording:
        assert recording.num_events == 501
        assert "repaired: 1 events beyond the sensor 20×12" in said(recording)
    with pytest.raises(RecordingError, match="--drop-outside"):
        open_recording(path, assume=Assumptions(width=2, height=2))
    path.write_text("20 12\n" + "0.1 25 4 1\n" * 5 + "0.6 3 4 1\n" * 5)
    with open_recording(path, assume=Assumptions(drop_outside=True)) as recording:
        assert recording.num_events == 5


def test_of_a_long_paged_file_an_event_beyond_the_sensor_is_named(tmp_path, monkeypatch):
    monkeypatch.setattr(paged, "SHORT", 0)
    events = make_events(100)
    x = events.x.copy()
    x[70] = 33
    path = save(tmp_path / "a.npz", **columns_of(events) | {"x": x})
    with open_recording(path) as recording, pytest.raises(RecordingError, match=r"event 70 is at \(33"):
        all_events(recording)
    with open_recording(path, assume=Assumptions(drop_outside=True)) as recording:
        assert recording.num_events == 99


@pytest.mark.parametrize("stray", [33, -1, 70_000])
def test_one_stray_of_a_short_file_is_dropped_and_said_in_every_format(stray, tmp_path):
    events = make_events(200)
    x = events.x.astype(np.int32)
    x[70] = stray
    path = save(tmp_path / "a.npz", **columns_of(events) | {"x": x})
    with open_recording(path) as recording:
        assert recording.num_events == 199
        assert "repaired: 1 events beyond the sensor 20×12" in said(recording)


def test_dropping_more_than_strays_is_asked_for_and_loud(tmp_path):
    events = make_events(200)
    x = np.where(np.arange(200) < 50, -events.x.astype(np.int32) - 1, events.x)
    path = save(tmp_path / "a.npz", **columns_of(events) | {"x": x})
    with pytest.raises(RecordingError, match=r"so are 50 of 200.*--drop-outside"):
        open_recording(path)
    with open_recording(path, assume=Assumptions(drop_outside=True)) as recording:
        assert recording.num_events == 150
        assert "advice: --drop-outside left out 50 of 200 events (25.0%)" in said(recording)


@pytest.mark.parametrize(
    ("name", "content", "match"),
    [
        ("a.txt", b"", "empty"),
        ("a.xyz", b"\x00\x01\x02\x03", "no known format"),
        ("a.txt", b"0.1 1 1 1\n0.2 hello 1 1\n", "line 2"),
        ("a.raw", b"% evt 4.0\n% end\n\x00\x00", "EVT version 4.0"),
        ("a.bin", b"1234567", "multiple of 5"),
        ("a.h5", b"\x89HDF\r\n\x1a\n" + b"\0" * 100, "cannot read"),
        ("a.npy", b"\x93NUMPY\x01\x00v\x00", "cannot read"),
        ("a.bag", b"#ROSBAG V2.0\n" + b"\0" * 50, "cannot read"),
        ("a.mcap", b"\x89MCAP0\r\n" + b"\x06" * 30, "cannot read"),
    ],
)
def test_a_file_that_cannot_be_read_says_what_and_why(name, content, match, tmp_path):
    (tmp_path / name).write_bytes(content)
    with pytest.raises(RecordingError, match=match) as caught:
        open_recording(tmp_path / name)
    assert name in str(caught.value)
    assert "\n" not in str(caught.value)


def test_missing_files_and_things_that_are_no_files_are_refused(tmp_path):
    with pytest.raises(RecordingError, match="no such file"):
        open_recording(tmp_path / "nothing.h5")
    with pytest.raises(RecordingError, match="an empty folder"):
        open_recording(tmp_path)
    os.mkfifo(tmp_path / "pipe.txt")
    with pytest.raises(RecordingError, match="neither a file nor a folder"):
        open_recording(tmp_path / "pipe.txt")
    with socket.socket(socket.AF_UNIX) as listener:
        listener.bind(str(tmp_path / "socket.raw"))
        with pytest.raises(RecordingError, match="neither a file nor a folder"):
            open_recording(tmp_path / "socket.raw")


def test_events_beyond_the_cap_lie_in_scratch_files_that_go_away(tmp_path, monkeypatch):
    monkeypatch.setattr(cache, "MEMORY_CAP", 1000)
    monkeypatch.setenv("TMPDIR", str(tmp_path))
    monkeypatch.setattr("tempfile.tempdir", None)
    path = tmp_path / "a.txt"
    rows = [f"0.{i:06d} {i % 20} {i % 12} {i % 2}" for i in range(90_000)]
    rows[70_000], rows[70_001] = rows[70_001], rows[70_000]
    path.write_text("20 12\n" + "\n".join(rows) + "\n")
    recording = open_recording(path)
    folders = list(tmp_path.glob("etnet-*"))
    assert len(folders) == 1
    assert recording.read(80_000, 80_003).t.tolist() == [80_000, 80_001, 80_002]
    assert (np.diff(all_events(recording).t) == 1).all()
    recording.close()
    assert not folders[0].exists()


def test_a_disk_that_is_too_small_is_said_before_it_is_full(tmp_path, monkeypatch):
    monkeypatch.setattr(cache, "MEMORY_CAP", 100)
    monkeypatch.setattr(cache.shutil, "disk_usage", lambda _: type("Usage", (), {"free": 0}))
    path = tmp_path / "a.txt"
    path.write_text("".join(f"0.{i:06d} 1 2 1\n" for i in range(100)))
    with pytest.raises(RecordingError, match="TMPDIR"):
        open_recording(path)


@pytest.mark.real
def test_an_aedat4_description_that_is_no_text_is_refused_before_the_library_ends_the_process(tmp_path):
    content = real_file("aedat4/test_data_gray16.aedat4").read_bytes()
    path = tmp_path / "a.aedat4"
    path.write_bytes(content.replace(b"</node>", b"</\xe65de>", 1))
    with pytest.raises(RecordingError, match="header cannot be read"):
        open_recording(path)

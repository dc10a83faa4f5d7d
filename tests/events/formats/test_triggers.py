"""Edges on a camera's trigger inputs come out of every format that holds them: stamp, input, edge."""

from __future__ import annotations

import struct
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import eventcv
import faery
import h5py
import numpy as np
import pytest

from etnet.events.cache import FrameCache, Scratch
from etnet.events.formats.aedat import aedat4
from etnet.events.formats.base import Remarks
from etnet.events.formats.prophesee import raw as prophesee
from etnet.events.open import open_recording
from etnet.events.recording import recording_of_events
from etnet.events.triggers import Triggers
from etnet.events.write import write_recording
from tests.real_data import real_file
from tests.strategies import make_events

Edge = tuple[int, int, int]
"""t in µs, input, +1 or −1."""

EVENTS = [(1000 * i, i % 60, i % 30, i % 2) for i in range(40)]
EDGES: list[Edge] = [(500, 0, 1), (7_000, 0, -1), (7_000, 3, 1), (39_500, 1, 1)]
PERIODS = {"2.0": 1 << 34, "2.1": 1 << 34, "3.0": 1 << 24}


def raw_words(version: str, events: Sequence[tuple[int, int, int, int]], edges: Sequence[Edge]) -> bytes:
    """Time words before each event and trigger, all in the order of time."""
    rows = [(t, 0, x, y, p) for t, x, y, p in events] + [(t, 1, channel, edge, 0) for t, channel, edge in edges]
    words: list[int] = []
    for t, is_edge, a, b, p in sorted(rows):
        rising = int(b > 0)
        if version == "2.0":
            low = (t & 63) << 22
            words += [0x8 << 28 | (t >> 6) & 0xFFFFFFF]
            words += [0xA << 28 | low | a << 8 | rising if is_edge else p << 28 | low | a << 11 | b]
        elif version == "2.1":
            low = (t & 63) << 54
            words += [0x8 << 60 | ((t >> 6) & 0xFFFFFFF) << 32]
            pixel = p << 60 | low | (a & ~31) << 43 | b << 32 | 1 << (a & 31)
            words += [0xA << 60 | low | a << 40 | rising << 32 if is_edge else pixel]
        else:
            words += [0x8 << 12 | (t >> 12) & 0xFFF, 0x6 << 12 | t & 0xFFF]
            words += [0xA << 12 | a << 8 | rising] if is_edge else [b, 0x2 << 12 | p << 11 | a]
    kind = {"2.0": "<u4", "2.1": "<u8", "3.0": "<u2"}[version]
    return f"% evt {version}\n% geometry 64x32\n% end\n".encode() + np.array(words, np.uint64).astype(kind).tobytes()


def found(recording) -> list[Edge]:
    triggers = recording.triggers
    return list(zip(triggers.stamps.tolist(), triggers.channels.tolist(), triggers.edges.tolist(), strict=True))


@pytest.mark.parametrize("begin", ["at 0", "before a turn of the clock"])
@pytest.mark.parametrize("is_large", [False, True])
@pytest.mark.parametrize("version", ["2.0", "2.1", "3.0"])
def test_triggers_of_raw_files_beside_unchanged_events(tmp_path: Path, monkeypatch, version, is_large, begin):
    monkeypatch.setenv("ETNET_CACHE", str(tmp_path / "cache"))
    monkeypatch.setattr(prophesee, "INDEXED_BYTES", 0 if is_large else 64 << 20)
    shift = 0 if begin == "at 0" else PERIODS[version] - 20_000
    events, edges = [(t + shift, *rest) for t, *rest in EVENTS], [(t + shift, *rest) for t, *rest in EDGES]
    with_triggers, without = tmp_path / "a.raw", tmp_path / "b.raw"
    with_triggers.write_bytes(raw_words(version, events, edges))
    without.write_bytes(raw_words(version, events, []))
    for _ in range(2):  # the second time from the index
        with open_recording(with_triggers) as recording, open_recording(without) as plain:
            assert found(recording) == edges
            assert any("4 triggers (3 rising, 1 falling) on input 0, 1, 3" in r.text for r in recording.remarks)
            assert plain.triggers is None
            ours, theirs = recording.read(0, recording.num_events), plain.read(0, plain.num_events)
            for axis in "xytp":
                np.testing.assert_array_equal(getattr(ours, axis), getattr(theirs, axis))


def test_triggers_before_a_streams_first_time_are_none(tmp_path: Path):
    for version, word, kind in (("2.0", 0xA << 28, "<u4"), ("2.1", 0xA << 60, "<u8"), ("3.0", 0xA << 12, "<u2")):
        content = raw_words(version, EVENTS, EDGES[:1])
        head, data = content[: content.index(b"% end\n") + 6], content[content.index(b"% end\n") + 6 :]
        path = tmp_path / f"{version}.raw"
        path.write_bytes(head + np.array([word], kind).tobytes() + data)
        with open_recording(path) as recording:
            assert found(recording) == EDGES[:1]


def test_triggers_of_aedat_3_tell_their_input_and_edge(tmp_path: Path):
    def packet(kind: int, words: list[tuple[int, int]]) -> bytes:
        content = np.array(words, "<u4").tobytes()
        return struct.pack("<hhiiiiii", kind, 1, 8, 4, 1, len(words), len(words), len(words)) + content

    events = packet(1, [(x << 17 | y << 2 | p << 1 | 1, t) for t, x, y, p in EVENTS])
    kinds = {2: (0, 1), 3: (0, -1), 4: (0, 0), 6: (1, 1), 7: (1, -1), 8: (1, 0), 9: (2, 1), 10: (2, -1), 11: (2, 0)}
    # A reset of the clock, and a trigger that is marked as invalid.
    special = packet(0, [(kind << 1 | 1, 100 * kind) for kind in (1, *kinds)] + [(2 << 1, 5_000)])
    path = tmp_path / "a.aedat"
    path.write_bytes(b"#!AER-DAT3.1\r\n#Format: RAW\r\n#Source 1: DAVIS240C\r\n#!END-HEADER\r\n" + events + special)
    with open_recording(path) as recording:
        assert found(recording) == [((1 << 31) + 100 * kind, *rest) for kind, rest in kinds.items()]
        assert any("2 special events" in remark.text for remark in recording.remarks)


def test_triggers_of_aedat_2_have_no_edge(tmp_path: Path):
    words = [(y << 22 | x << 12 | p << 11, t) for t, x, y, p in EVENTS] + [(1 << 10, 40_000), (1 << 10, 41_000)]
    path = tmp_path / "a.aedat"
    path.write_bytes(b"#!AER-DAT2.0\r\n# AEChip: Davis240C\r\n" + np.array(words, ">u4").tobytes())
    with open_recording(path) as recording:
        assert found(recording) == [(40_000, 0, 0), (41_000, 0, 0)]


def test_triggers_of_aedat_4_are_the_edges_of_its_input_alone():
    records = np.array([(5, 1), (6, 2), (7, 3), (8, 9), (9, 0)], [("t", "<u8"), ("source", "u1")])
    events = np.array([(1, 2, 3, True), (9, 4, 5, False)], [("t", "<u8"), ("x", "<u2"), ("y", "<u2"), ("on", "?")])
    packets = [{"stream_id": 0, "events": events}, {"stream_id": 1, "triggers": records}]
    others = aedat4._Others(FrameCache(Scratch("a")))
    decoder = iter(packets)
    while aedat4._next_events(decoder, 0, {1}, others) is not None:
        pass
    triggers = others.triggers.triggers(Remarks())
    assert triggers.stamps.tolist() == [5, 6, 7]
    assert triggers.edges.tolist() == [1, -1, 0]
    assert others.num_marks == 2


@pytest.mark.real
def test_a_real_cameras_triggers_lie_within_its_events():
    with open_recording(real_file("rosbag/event_camera_msgs_evt3_person_2.1s.bag")) as recording:
        triggers = recording.triggers
        assert len(triggers) == 4157
        assert recording.span.start - 1_000 <= triggers.stamps[0]
        assert triggers.stamps[-1] <= recording.span.stop + 1_000
        assert set(triggers.edges.tolist()) == {-1, 1}


def triggered(edges: list[Edge], events) -> object:
    stamps, channels, signs = (np.array(column) for column in zip(*sorted(edges), strict=True))
    triggers = Triggers(stamps.astype(np.int64), channels.astype(np.int16), signs.astype(np.int8))
    return replace(recording_of_events(events), triggers=triggers)


@pytest.mark.parametrize("block", [1 << 20, 50])
@pytest.mark.parametrize("pause", [0, 9_000_000, 40_000_000])
def test_triggers_come_back_from_evt3_and_leave_every_reader_its_events(tmp_path: Path, monkeypatch, pause, block):
    monkeypatch.setattr("etnet.events.formats.prophesee.trigger_words._BLOCK", block)
    events = make_events(3_000, duration=200_000)
    t = events.t + 77
    t[1500:] += pause
    events = replace(events, t=t)
    rng = np.random.default_rng(0)
    stamps = np.unique(np.append(rng.integers(t[0], t[-1] + 1, 200), [t[0], t[0] + 1, t[1499] + 1, t[1500], t[-1]]))
    edges = [(int(stamp), int(rng.integers(0, 16)), int(rng.choice([-1, 1]))) for stamp in stamps]
    edges = sorted([*edges, (edges[5][0], 1, 1)])
    outside = [(int(t[0]) - 5, 0, 1), (int(t[-1]) + 5, 0, 1)]
    path, plain = tmp_path / "a.raw", tmp_path / "b.raw"
    remarks = write_recording(triggered(edges + outside, events), path)
    write_recording(recording_of_events(events), plain)
    assert any(f"{len(edges)} triggers among the events were written" in remark.text for remark in remarks)
    with open_recording(path) as back:
        assert sorted(found(back)) == edges
        read = back.read(0, back.num_events)
        for axis in "xytp":
            np.testing.assert_array_equal(getattr(read, axis), getattr(events, axis))
    theirs, without = (np.concatenate(list(faery.events_stream_from_file(each))) for each in (path, plain))
    np.testing.assert_array_equal(theirs, without)
    np.testing.assert_array_equal(eventcv.load(str(path)).numpy(), eventcv.load(str(plain)).numpy())


def test_a_layout_without_triggers_says_so(tmp_path: Path):
    remarks = write_recording(triggered([(5, 0, 1), (6, 0, -1)], make_events(100)), tmp_path / "a.npz")
    assert any("2 triggers were not written" in remark.text for remark in remarks)


@pytest.mark.parametrize("is_readable", [True, False])
def test_triggers_of_metavision_hdf5(tmp_path: Path, is_readable: bool):
    path = tmp_path / "a.h5"
    events = np.array(EVENTS, [("t", "<i8"), ("x", "<u2"), ("y", "<u2"), ("p", "<i2")])
    fields = [("p", "<i2"), ("t", "<i8"), ("id", "<i2")] if is_readable else [("q", "<i2")]
    rows = [(int(edge > 0), t, channel) if is_readable else (1,) for t, channel, edge in EDGES]
    with h5py.File(path, "w") as file:
        file["CD/events"] = events
        file["EXT_TRIGGER/events"] = np.array(rows, fields)
        file.attrs["geometry"] = "64x32"
    with open_recording(path) as recording:
        if is_readable:
            assert found(recording) == EDGES
        else:
            assert recording.triggers is None
            assert any("4 triggers, which cannot be read" in remark.text for remark in recording.remarks)


def test_triggers_are_chosen_by_input_and_edge():
    triggers = triggered(EDGES, make_events(10)).triggers
    assert triggers.chosen(channel=0).stamps.tolist() == [500, 7_000]
    assert triggers.chosen(edge=1).stamps.tolist() == [500, 7_000, 39_500]
    assert triggers.chosen(channel=0, edge=-1).stamps.tolist() == [7_000]

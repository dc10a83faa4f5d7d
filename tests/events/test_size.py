"""Large files are indexed once and read by slice, as if they had been decoded whole; any doubt makes the index anew."""

from __future__ import annotations

import os
import threading
import time
from dataclasses import replace
from itertools import pairwise

import faery
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from etnet.events import index_store
from etnet.events.formats import paged
from etnet.events.formats.prophesee import index as raw_index
from etnet.events.formats.prophesee import indexed as indexed_raw
from etnet.events.formats.prophesee import raw as prophesee
from etnet.events.formats.prophesee.evt2_evt3 import EVT, Notes, State
from etnet.events.index_store import index_folder, index_path, load_index, save_index
from etnet.events.open import Assumptions, open_recording
from etnet.events.recording import recording_of_events
from etnet.events.write import write_recording
from tests.events.containers import all_events, assert_same_events
from tests.events.formats.test_prophesee import evt3
from tests.real_data import real_file
from tests.strategies import make_events

REAL = (
    "derived/davis346_aprilgrid_0.5s_evt2.raw",
    "derived/davis346_aprilgrid_0.5s_evt3.raw",
    "prophesee/evt2_640x480_rotating_dot_0.05s.raw",
    "prophesee/evt3_1280x720_night_lights_cut.raw",
)


@pytest.fixture(autouse=True)
def small_is_large(tmp_path, monkeypatch):
    """Files of a few kilobytes are indexed, in blocks of a few hundred bytes."""
    monkeypatch.setenv("ETNET_CACHE", str(tmp_path / "cache"))
    monkeypatch.setattr(prophesee, "INDEXED_BYTES", 0)
    monkeypatch.setattr(raw_index, "BLOCK_BYTES", 1 << 13)
    monkeypatch.setattr(indexed_raw, "HELD_BYTES", 1 << 18)
    monkeypatch.setattr(paged, "LONG", 0)


def slow_evt3(words):
    """The format's words one after the other, as its description has them."""
    turns, high, low, y, base, on, last, events = 0, None, 0, 0, 0, 0, 0, []
    for word in (int(each) for each in words):
        kind, value = word >> 12, word & 0xFFF
        if kind == 8:
            turns += high is not None and value - high < -2048
            high, low = value, 0
        elif kind == 6:
            low = value
        if kind in (6, 8):
            last = max(last, (((turns << 12) | (high or 0)) << 12) | low)
        elif kind == 0:
            y = value & 0x7FF
        elif kind == 3:
            base, on = value & 0x7FF, value >> 11
        elif kind == 2 and high is not None:
            events.append((value & 0x7FF, y, last, value >> 11))
        elif kind in (4, 5):
            size = 12 if kind == 4 else 8
            if high is not None:
                events += [(base + bit, y, last, on) for bit in range(size) if value >> bit & 1]
                base += size
    return np.array(events, np.int64).reshape(-1, 4)


@settings(max_examples=60, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), cuts=st.lists(st.integers(0, 300), max_size=4), has_vectors=st.booleans())
def test_evt3_words_in_blocks_are_read_as_one_after_the_other(seed, cuts, has_vectors):
    rng = np.random.default_rng(seed)
    kinds = np.array([0, 2, 6, 8, 7, 10, 14, 3, 4, 5] if has_vectors else [0, 2, 6, 8, 10])
    words = (rng.choice(kinds, 300) << 12 | rng.integers(0, 4096, 300)).astype("<u2")
    bounds = [0, *sorted(cuts), 300]
    state, skimmed, notes, told, found, num_skimmed = State(), State(), Notes(), Notes(), [], 0
    for start, stop in pairwise(bounds):
        decoded, state = EVT["3.0"].decode(words[start:stop], state, notes)
        num, skimmed = EVT["3.0"].skim(words[start:stop], skimmed, told)
        num_skimmed += num
        found.append(np.stack([decoded.x, decoded.y, decoded.t, decoded.p], 1).astype(np.int64))
    np.testing.assert_array_equal(np.concatenate(found), slow_evt3(words))
    assert (skimmed, told, num_skimmed) == (state, notes, sum(map(len, found)))
    np.testing.assert_array_equal(told.triggers.rows, notes.triggers.rows)


@settings(max_examples=40, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), cut=st.integers(0, 200))
def test_evt2_words_in_blocks_are_read_as_one_after_the_other(seed, cut):
    rng = np.random.default_rng(seed)
    words = (rng.choice([0, 1, 8, 10, 14], 200).astype(np.uint32) << 28 | rng.integers(0, 1 << 28, 200)).astype("<u4")
    turns, high, last, wanted = 0, None, 0, []
    for word in (int(each) for each in words):
        kind, value = word >> 28, word & 0xFFFFFFF
        if kind == 8:
            turns += high is not None and value - high < -(1 << 27)
            high = value
        elif kind < 2 and high is not None:
            last = max(last, (((turns << 28) | high) << 6) | value >> 22)
            wanted.append((value >> 11 & 0x7FF, value & 0x7FF, last, kind))
    first, state = EVT["2.0"].decode(words[:cut], State(), Notes())
    second, _ = EVT["2.0"].decode(words[cut:], state, Notes())
    found = [np.stack([d.x, d.y, d.t, d.p], 1).astype(np.int64) for d in (first, second)]
    np.testing.assert_array_equal(np.concatenate(found), np.array(wanted, np.int64).reshape(-1, 4))


@pytest.mark.real
@pytest.mark.parametrize("name", REAL)
def test_an_indexed_file_is_as_an_independent_reader_has_it(name):
    path = real_file(name)
    theirs = np.concatenate(list(faery.events_stream_from_file(path, dimensions_fallback=(2048, 2048))))
    with open_recording(path) as recording:
        assert recording.num_events == len(theirs)
        assert recording.span == (int(theirs["t"][0]), int(theirs["t"][-1]))
        rng = np.random.default_rng(0)
        bounds = np.sort(rng.integers(0, len(theirs) + 1, (20, 2)), 1)
        for start, stop in [(0, len(theirs)), (0, 0), *bounds.tolist()]:
            events, part = recording.read(start, stop), theirs[start:stop]
            for ours, theirs_of_it in ((events.x, part["x"]), (events.y, part["y"]), (events.t, part["t"])):
                np.testing.assert_array_equal(ours, theirs_of_it)
            np.testing.assert_array_equal(events.p > 0, part["on"])
        stamps = [*rng.integers(*recording.span, 30).tolist(), *recording.span, recording.span.stop + 1]
        for t in [*stamps, *theirs["t"][:: len(theirs) // 30].tolist()]:
            assert recording.index_at(int(t)) == int(np.searchsorted(theirs["t"], t))


@pytest.fixture
def raw(tmp_path):
    """A made-up EVT3 file of some dozen blocks, and its events."""
    events = make_events(60_000, duration=30_000_000)
    write_recording(recording_of_events(events), tmp_path / "a.raw")
    return tmp_path / "a.raw", events


def test_the_index_is_made_once(raw, monkeypatch):
    path, events = raw
    with open_recording(path) as recording:
        assert_same_events(all_events(recording), events)
    assert len(list(index_folder().iterdir())) == 1
    monkeypatch.setitem(EVT, "3.0", replace(EVT["3.0"], skim=lambda *_: pytest.fail("it was made again")))
    with open_recording(path) as recording:
        assert_same_events(all_events(recording), events)


@pytest.mark.parametrize("damage", ["flip", "cut", "empty", "junk"])
def test_a_damaged_index_is_made_anew(raw, damage):
    path, events = raw
    open_recording(path).close()
    (index,) = index_folder().iterdir()
    sound = index.read_bytes()
    place = len(sound) // 2
    flipped = sound[:place] + bytes([sound[place] ^ 4]) + sound[place + 1 :]
    index.write_bytes({"flip": flipped, "cut": sound[:place], "empty": b"", "junk": b"\x00" * 5000}[damage])
    with open_recording(path) as recording:
        assert_same_events(all_events(recording), events)
    assert index.read_bytes() == sound


def test_an_index_belongs_to_size_time_and_content(tmp_path):
    path = tmp_path / "file"
    path.write_bytes(bytes(200_000))
    os.utime(path, ns=(1, 1))
    names = [index_path(path, "a"), index_path(path, "b")]
    os.utime(path, ns=(1, 2))
    names.append(index_path(path, "a"))
    path.write_bytes(bytes(199_999) + b"\x01")
    os.utime(path, ns=(1, 1))
    names.append(index_path(path, "a"))
    path.write_bytes(bytes(200_001))
    os.utime(path, ns=(1, 1))
    names.append(index_path(path, "a"))
    assert len(set(names)) == len(names)


def test_many_writers_leave_a_whole_index(tmp_path):
    path, arrays = tmp_path / "folder" / "a.index", {"stamps": np.arange(50_000)}
    writers = [threading.Thread(target=lambda: [save_index(path, arrays) for _ in range(5)]) for _ in range(4)]
    for writer in writers:
        writer.start()
    while any(writer.is_alive() for writer in writers):
        found = load_index(path)
        assert found is None or np.array_equal(found["stamps"], arrays["stamps"])
    assert load_index(path) is not None
    assert [each.name for each in path.parent.iterdir()] == ["a.index"]


def test_the_folder_of_indices_does_not_grow_without_end(tmp_path, monkeypatch):
    monkeypatch.setattr(index_store, "MAX_FILES", 3)
    forgotten = tmp_path / "a.unfinished"
    forgotten.write_bytes(b"half")
    os.utime(forgotten, (1, 1))
    for number in range(6):
        path = tmp_path / f"{number}.index"
        save_index(path, {"stamps": np.arange(3)})
        os.utime(path, (number + 10, number + 10))
    save_index(tmp_path / "new.index", {"stamps": np.arange(3)})
    assert sorted(each.name for each in tmp_path.glob("*.*")) == ["4.index", "5.index", "new.index"]


def test_a_folder_that_cannot_be_written_keeps_nothing_and_the_file_opens(raw, tmp_path):
    (tmp_path / "cache").write_text("a file where the folder would be")
    path, events = raw
    with open_recording(path) as recording:
        assert_same_events(all_events(recording), events)


def test_indices_after_a_silent_stretch_do_not_depend_on_what_was_asked_before(tmp_path, monkeypatch):
    monkeypatch.setattr(raw_index, "BLOCK_BYTES", 1 << 9)
    # Two seconds with events, ten without, two with: words of time alone fill whole blocks.
    stamps = np.array([*range(0, 2_000_000, 5000), *range(12_000_000, 14_000_000, 5000)])
    path = tmp_path / "silent.raw"
    path.write_bytes(evt3(stamps.tolist(), 14_000_000))
    with open_recording(path) as recording:
        start, stop = recording.source.bracket(7_000_000)
        assert start == stop
        for t in range(0, 14_000_000, 50_000):
            assert recording.index_at(t) == np.searchsorted(stamps, t)


def test_without_patience_a_part_is_shown_and_the_whole_the_next_time(raw):
    path, events = raw
    with open_recording(path, patience=0.0) as recording:
        part = all_events(recording)
        assert 0 < len(part) < len(events)
        assert_same_events(part, events[: len(part)])
        assert recording.span.stop == part.t[-1]
        assert any("only the first" in remark.text for remark in recording.remarks)
    wait_for(lambda: any(index_folder().glob("*.index")))
    with open_recording(path, patience=0.0) as recording:
        assert_same_events(all_events(recording), events)
        assert not any("only the first" in remark.text for remark in recording.remarks)


@pytest.fixture
def gate(monkeypatch):
    """Indices go on in the background once this is set."""
    opened, version = threading.Event(), EVT["3.0"]

    def skim(*of_it):
        if threading.current_thread().name.startswith("index"):
            assert opened.wait(20)
        return version.skim(*of_it)

    monkeypatch.setitem(EVT, "3.0", replace(version, skim=skim))
    return opened


def test_who_opens_a_file_whose_index_grows_gets_what_is_there_at_once(raw, gate):
    path, events = raw
    with open_recording(path, patience=0.0) as first:
        with open_recording(path, patience=60.0) as second:
            assert second.growth is first.growth
            assert_same_events(all_events(second), all_events(first))
        assert 0 < first.growth.share < 1
        gate.set()
        wait_for(lambda: first.growth.is_over)
        assert first.growth.share == 1
        assert_same_events(all_events(first), events[: first.num_events])
    with open_recording(path, patience=0.0) as whole:
        assert whole.growth is None
        assert_same_events(all_events(whole), events)


def test_a_part_becomes_whole_though_its_index_cannot_be_kept(raw, tmp_path):
    (tmp_path / "cache").write_text("a file where the folder would be")
    path, events = raw
    with open_recording(path, patience=0.0) as part:
        wait_for(lambda: part.growth.is_over)
    with open_recording(path, patience=0.0) as whole:
        assert_same_events(all_events(whole), events)


def test_an_index_that_breaks_off_is_over_and_the_part_stays_readable(raw, gate, monkeypatch):
    path, _ = raw
    with open_recording(path, patience=0.0) as part:
        monkeypatch.setattr(raw_index, "save_index", lambda *_: (_ for _ in ()).throw(OSError("the disk is gone")))
        gate.set()
        wait_for(lambda: part.growth.is_over)
        assert len(all_events(part)) == part.num_events


@pytest.mark.parametrize("layout", ["event_utils", "dsec"])
def test_a_long_hdf5_file_gets_its_index_in_the_background(layout, tmp_path, monkeypatch):
    events = make_events(250_000)
    path = tmp_path / "a.h5"
    write_recording(recording_of_events(events), path, layout)
    stamps = [*np.random.default_rng(0).integers(0, 50_001, 40).tolist(), 0, 50_000]
    wanted = [int(np.searchsorted(events.t, t)) for t in stamps]
    with open_recording(path) as recording:
        assert [recording.index_at(t) for t in stamps] == wanted
        wait_for(lambda: recording.source.bracket(25_000) is not None)
        assert [recording.index_at(t) for t in stamps] == wanted
    assert len(list(index_folder().iterdir())) == 1
    with open_recording(path) as recording:
        start, stop = recording.source.bracket(25_000)
        assert start <= np.searchsorted(events.t, 25_000) <= stop < len(events)
        assert [recording.index_at(t) for t in stamps] == wanted


@pytest.mark.parametrize("place", [0, -1])
def test_a_kept_index_of_other_stamps_is_made_again(place, tmp_path):
    events, path = make_events(250_000), tmp_path / "a.h5"
    write_recording(recording_of_events(events), path, "dsec")
    with open_recording(path) as recording:
        wait_for(lambda: recording.source.bracket(25_000) is not None)
    (kept,) = index_folder().iterdir()
    stamps = load_index(kept)["stamps"]
    stamps[place] -= 5
    save_index(kept, {"stamps": np.sort(stamps)})
    with open_recording(path) as recording:
        wait_for(lambda: recording.source.bracket(25_000) is not None)
        for t in (0, 25_000, 49_999):
            assert recording.index_at(t) == np.searchsorted(events.t, t)
    assert load_index(kept)["stamps"].tolist() == events.t[:: 1 << 16].tolist()


@pytest.mark.parametrize("kind", ["columns", "pieces"])
def test_a_long_recording_in_a_folder_gets_its_index_each_time(kind, tmp_path):
    events, folder = make_events(250_000), tmp_path / "rec"
    folder.mkdir()
    for axis in "xytp" if kind == "columns" else "":
        np.save(folder / f"{axis}.npy", getattr(events, axis))
    for number in range(2) if kind == "pieces" else ():
        part = events[125_000 * number : 125_000 * (number + 1)]
        np.savez(folder / f"events_{number}.npz", **{axis: getattr(part, axis) for axis in "xytp"})
    for _ in range(2):
        with open_recording(folder, assume=Assumptions(width=20, height=12)) as recording:
            wait_for(lambda source=recording.source: source.bracket(25_000) is not None)
            assert_same_events(all_events(recording), events)
            for t in (0, 1, 25_000, 49_999, 50_001):
                assert recording.index_at(t) == np.searchsorted(events.t, t)
    assert not index_folder().exists()


def test_a_file_closes_while_its_index_is_being_made(tmp_path, monkeypatch):
    from etnet.events.formats import stamp_index

    monkeypatch.setattr(stamp_index, "_PAUSE", 0.05)
    write_recording(recording_of_events(make_events(700_000)), tmp_path / "a.h5", "dsec")
    open_recording(tmp_path / "a.h5").close()
    assert not any(thread.name == "index of a.h5" for thread in threading.enumerate())


def wait_for(is_done, seconds=20.0):
    """Until it is true."""
    end = time.monotonic() + seconds
    while not is_done():
        assert time.monotonic() < end, "it did not come"
        time.sleep(0.01)

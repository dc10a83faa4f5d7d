"""What is recorded is what came; a kill at any moment leaves a file that opens up to the last flush."""

import json
import os
import random
import re
import signal
import subprocess
import sys
import time
from contextlib import closing

import aedat
import h5py
import numpy as np
import pytest

from etnet.errors import RecordingError, WindowError
from etnet.events.events import Sensor
from etnet.events.formats.hdf5 import journal
from etnet.events.open import open_recording
from etnet.live import buffer as buffer_module
from etnet.live import windows as windows_module
from etnet.live.buffer import EVENT_BYTES, Keep
from etnet.live.hdf5_writer import Hdf5Writer
from etnet.live.log import log_of, windows_as_cut
from etnet.live.record import Recorder, check_recordable
from etnet.live.recording import LiveRecording
from etnet.live.source import Packet, Setting
from etnet.live.windows import KeptWindows, LiveWindows
from etnet.windows import ByCount, Window
from tests import strategies
from tests.live.sources import GivenPackets, cut_up, edges_at, frames_at, make_events, same
from tests.strategies import SMALL

SUFFIXES = (".aedat4", ".h5")


def _recorded(path, packets, **options):
    live = LiveRecording(GivenPackets(packets))
    with Recorder(live, path, first=0, **options):
        for packet in packets:
            live._take(packet)
    return open_recording(path)


@pytest.mark.parametrize("flushes", [True, False])
def test_a_quiet_source_is_as_long_when_it_is_read_again(tmp_path, flushes):
    events = strategies.make_events(150, Sensor(346, 260), duration=600 * 10**6)
    with closing(Hdf5Writer(tmp_path / "a.h5", events.sensor, "a quiet room")) as writer:
        writer.add_events(events)
        if flushes:
            writer.flush()
    with open_recording(tmp_path / "a.h5") as recording:
        assert np.array_equal(recording.read(0, 150).t, events.t)


FULL = """
import resource, sys
from pathlib import Path
from tests.live.killed_writer import write_for_ever
resource.setrlimit(resource.RLIMIT_FSIZE, (150_000, 150_000))
try:
    write_for_ever(Path(sys.argv[1]))
except OSError as error:
    sys.exit(error.strerror)
"""


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_a_full_disk_is_an_error_and_no_crash_and_leaves_what_was_flushed(tmp_path, suffix):
    path = tmp_path / f"live{suffix}"
    ended = subprocess.run([sys.executable, "-c", FULL, str(path)], capture_output=True, text=True)
    assert ended.returncode == 1, ended.stderr[-2000:]
    assert "File too large" in ended.stderr
    flushed = int(ended.stdout.split()[-1])
    assert flushed > 0
    with open_recording(path) as recording:
        assert recording.num_events >= flushed
        assert same(recording.read(0, flushed), make_events(200_000, duration=200_000)[:flushed])


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_the_file_holds_the_events_and_frames_that_came(tmp_path, suffix):
    events, frames = make_events(5000), frames_at([0, 17_000, 33_000, 60_000])
    packets = [Packet(part.events, frames=tuple(f for f in frames if f.stamp // 10_000 == number))
               for number, part in enumerate(cut_up(events, 700))]  # fmt: skip
    with _recorded(tmp_path / f"live{suffix}", packets) as recording:
        assert recording.sensor == SMALL
        assert same(recording.read(0, recording.num_events), events)
        assert recording.ground_truth is not None
        assert list(recording.ground_truth.stamps) == [0, 17_000, 33_000, 60_000]
        for index, frame in enumerate(frames):
            pixels = np.rint(recording.ground_truth.read_frame(index) * 255).astype(np.uint8)
            assert np.array_equal(pixels, frame.pixels)


def test_triggers_lie_in_both_files(tmp_path):
    events, triggers = make_events(100), edges_at([100, 2_000, 30_000, 30_001])
    packets = [Packet(events[:50]), Packet(events[50:], triggers=triggers)]
    for suffix in SUFFIXES:
        _recorded(tmp_path / f"live{suffix}", packets).close()
    with h5py.File(tmp_path / "live.h5") as file:
        for name, column in (("t", triggers.stamps), ("channel", triggers.channels), ("edge", triggers.edges)):
            assert np.array_equal(np.asarray(file[f"triggers/{name}"]), column)
    read = [packet["triggers"] for packet in aedat.Decoder(tmp_path / "live.aedat4") if "triggers" in packet]
    assert np.array_equal(np.concatenate(read)["t"], triggers.stamps)
    assert list(np.concatenate(read)["source"]) == [2, 3, 1, 2], "falling, a pulse, rising"


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_a_recording_that_begins_later_holds_only_what_came_then(tmp_path, suffix):
    events = make_events(1000)
    live = LiveRecording(GivenPackets([]))
    live._take(Packet(events[:400], frames=frames_at([10])))
    with Recorder(live, tmp_path / f"live{suffix}"):
        live._take(Packet(events[400:], frames=frames_at([int(events.t[500])])))
    with open_recording(tmp_path / f"live{suffix}") as recording:
        assert same(recording.read(0, 600), events[400:])
        assert recording.ground_truth is not None
        assert len(recording.ground_truth) == 1


def test_settings_losses_and_faults_stand_in_the_log(tmp_path):
    path = tmp_path / "live.h5"
    packets = [Packet(make_events(10), num_lost=2, notes=("a fault",), changed=(Setting("refr", 3, 0, 9),))]
    _recorded(path, packets).close()
    lines = [json.loads(line) for line in log_of(path).read_text().splitlines()]
    assert lines[0] == {"live": 1, "source": "given", "sensor": [20, 12]}
    assert any(line.get("note") == "a fault" for line in lines)
    assert any(line.get("setting") == ["refr", 3] for line in lines)
    assert any(line.get("lost_packets") == 2 for line in lines)


class _Settable(GivenPackets):
    """A source with a number, a switch and a choice."""

    threshold = 3

    def settings(self):
        return (
            Setting("threshold", self.threshold, 0, 9),
            Setting("limiter", 1, 0, 1, is_switch=True),
            Setting("polarity", 2, 0, 2, ("both", "on", "off")),
        )


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_all_settings_stand_in_the_log_and_the_file_as_they_were_when_recording_began(tmp_path, suffix):
    path, source = tmp_path / f"live{suffix}", _Settable([])
    live = LiveRecording(source)
    source.threshold = 5
    live._take(Packet(make_events(10), changed=source.settings()[:1]))
    with Recorder(live, path):
        source.threshold = 7
        live._take(Packet(make_events(10), changed=source.settings()[:1]))
    lines = [json.loads(line) for line in log_of(path).read_text().splitlines()]
    told = [tuple(line["setting"]) for line in lines if "setting" in line]
    assert told == [("threshold", 5), ("limiter", True), ("polarity", "off"), ("threshold", 7)]
    begun = {"threshold": 5, "limiter": True, "polarity": "off"}
    if suffix == ".h5":
        with h5py.File(path) as file:
            assert json.loads(str(file.attrs["settings"])) == begun
    else:
        header = path.read_bytes()[:8_000].decode("utf-8", "replace")
        assert json.loads(re.findall(r'<attr key="settings" type="string">(.*?)</attr>', header)[0]) == begun
        assert aedat.Decoder(path) is not None, "another reader takes the header"
    with open_recording(path) as recording:
        assert recording.num_events == 10


def test_a_note_however_long_leaves_a_log_that_is_read(tmp_path):
    path, events = tmp_path / "live.h5", make_events(100)
    live = LiveRecording(GivenPackets([]))
    windows = LiveWindows(live, ByCount(50))
    with Recorder(live, path, first=0) as recorder:
        recorder.follow(windows.kept, "count=50", 1)
        live._take(Packet(events, notes=('"\x00' * 5_000,)))
        windows.take(timeout=0)
    with open_recording(path) as recording:
        assert len(windows_as_cut(recording).windows) == 1


def test_windows_that_are_forgotten_are_not_written_down_as_others(tmp_path, monkeypatch):
    monkeypatch.setattr(windows_module, "GONE", 100)
    kept, path = KeptWindows(), tmp_path / "live.h5"
    for number in range(10_000):
        kept.append(Window(number, 1_000 + number, 1_001 + number, number, number + 1), 1, first_held=1_000 + number)
    assert kept.first_known > 0
    live = LiveRecording(GivenPackets([]))
    with Recorder(live, path, first=0) as recorder:
        recorder.follow(kept, "count=1", 1)
        live._take(Packet(make_events(10)))
    assert not [line for line in log_of(path).read_text().splitlines() if '"window"' in line]


def test_a_disk_that_is_too_slow_costs_events_that_are_counted(tmp_path, monkeypatch):
    monkeypatch.setattr(buffer_module, "BLOCK", 64)
    events = make_events(3000)
    live = LiveRecording(GivenPackets([]), Keep(num_bytes=4 * 64 * EVENT_BYTES))
    recorder = Recorder(live, tmp_path / "live.h5", first=0)
    for packet in cut_up(events, 100):
        live._take(packet)
    recorder.stop()
    assert recorder.num_missing > 0
    assert recorder.num_events == 3000 - recorder.num_missing
    with open_recording(tmp_path / "live.h5") as recording:
        assert same(recording.read(recording.num_events - 64, recording.num_events), events[3000 - 64 :])


def test_events_that_leave_while_others_are_written_are_counted_once(tmp_path, monkeypatch):
    monkeypatch.setattr(buffer_module, "BLOCK", 64)
    monkeypatch.setattr(Recorder, "_run", lambda _: None)  # its rounds are gone by hand
    events, path = make_events(3000), tmp_path / "live.h5"
    live = LiveRecording(GivenPackets([]), Keep(num_bytes=4 * 64 * EVENT_BYTES))
    recorder = Recorder(live, path, first=0)
    live._take(Packet(events[:100]))
    extent, stale = live.extent, [live.extent()]
    for packet in cut_up(events[100:], 100):
        live._take(packet)
    monkeypatch.setattr(live, "extent", lambda: stale.pop() if stale else extent())
    recorder._catch_up(is_last=False)
    assert recorder.num_missing == 100, "of those that the round knew"
    recorder._catch_up(is_last=True)
    recorder._writer.close()
    recorder._log.close()
    assert recorder.num_missing == live.extent().first_held
    assert recorder.num_events == 3000 - recorder.num_missing


def test_a_disk_that_fails_is_one_sentence_and_the_camera_goes_on(tmp_path, monkeypatch):
    def full(self, events):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(Hdf5Writer, "add_events", full)
    live = LiveRecording(GivenPackets([]))
    recorder = Recorder(live, tmp_path / "live.h5", first=0)
    live._take(Packet(make_events(10)))
    with pytest.raises(RecordingError, match=r"live\.h5: recording ended, the disk failed \(No space left"):
        recorder.stop()
    assert "the disk failed" in live.notes[-1].text
    live._take(Packet(make_events(10)))
    assert live.extent().num_events == 20


def test_nothing_is_overwritten_unasked_and_other_suffixes_are_refused(tmp_path):
    (tmp_path / "there.h5").write_bytes(b"")
    with pytest.raises(RecordingError, match="is there already"):
        check_recordable(tmp_path / "there.h5", overwrite=False)
    check_recordable(tmp_path / "there.h5", overwrite=True)
    with pytest.raises(RecordingError, match=r'no layout for "\.mp4"'):
        check_recordable(tmp_path / "live.mp4", overwrite=False)


def test_what_is_replayed_is_not_recorded_to(tmp_path):
    (tmp_path / "there.h5").write_bytes(b"")
    (tmp_path / "link.h5").symlink_to(tmp_path / "there.h5")
    for name in ("there.h5", "link.h5"):
        with pytest.raises(RecordingError, match="is the recording that is replayed; choose another name"):
            check_recordable(tmp_path / name, overwrite=True, source=str(tmp_path / "there.h5"))
    check_recordable(tmp_path / "there.h5", overwrite=True, source="tcp:7777")


def test_windows_come_back_as_they_were_cut_from_the_first_event_of_the_file(tmp_path):
    events, path = make_events(1000), tmp_path / "live.aedat4"
    live = LiveRecording(GivenPackets([]))
    windows = LiveWindows(live, ByCount(60))
    live._take(Packet(events[:200]))
    windows.take(timeout=0)
    with Recorder(live, path) as recorder:
        recorder.follow(windows.kept, "ByCount(60)", 2)
        for packet in cut_up(events[200:], 130):
            live._take(packet)
            windows.take(timeout=0)
    with open_recording(path) as recording:
        as_cut = windows_as_cut(recording)
    assert as_cut.downsample == 2
    kept = [window for window in windows.kept if window.start >= 200]
    assert [(w.start + 200, w.stop + 200, w.t_start, w.t_stop) for w in as_cut.windows] == [
        (w.start, w.stop, w.t_start, w.t_stop) for w in kept
    ]


@pytest.mark.parametrize(
    ("line", "said"),
    [
        ("nonsense\n", "wanted one JSON object"),
        ("[" * 5000 + "\n", "wanted one JSON object"),
        ('{"window": [1, 2]}\n', "holds no window"),
        ('{"window": [5, 2, 0, 0, 1]}\n', "runs backwards"),
        ('{"window": [0, "1", 0, 0, 1]}\n', "whole number"),
        ('{"live": 1}\n', "holds no windows"),
    ],
)
def test_a_damaged_log_is_one_sentence(tmp_path, line, said):
    path = tmp_path / "live.h5"
    with _recorded(path, cut_up(make_events(10), 10)) as recording:
        log_of(path).write_text(line)
        with pytest.raises((RecordingError, WindowError), match=said):
            windows_as_cut(recording)


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_a_kill_at_any_moment_leaves_all_up_to_the_last_flush(tmp_path, suffix):
    chance = random.Random(suffix)
    events = make_events(200_000, duration=200_000)
    for number in range(2):
        path = tmp_path / f"killed{number}{suffix}"
        code = (
            "import pathlib; from tests.live.killed_writer import write_for_ever; "
            f"write_for_ever(pathlib.Path({str(path)!r}))"
        )
        with subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, text=True) as process:
            assert process.stdout is not None
            process.stdout.readline()
            time.sleep(chance.uniform(0.0, 0.3))
            os.kill(process.pid, signal.SIGKILL)
            flushed = [int(line) for line in process.stdout.read().splitlines()] or [500]
        with open_recording(path) as recording:
            assert recording.num_events >= flushed[-1]
            assert same(recording.read(0, recording.num_events), events[: recording.num_events])
            assert recording.ground_truth is not None
            assert len(recording.ground_truth) >= flushed[-1] // 500


class _Killed(BaseException):
    """In place of a kill, at a chosen write."""


@pytest.mark.parametrize("fatal", range(8))
def test_an_hdf5_file_whose_writer_dies_within_a_commit_opens_as_before_or_after_it(tmp_path, monkeypatch, fatal):
    path, events = tmp_path / "live.h5", make_events(2000)
    writer = Hdf5Writer(path, SMALL, "killed")
    writer.add_events(events[:1000])
    writer.flush()
    writer.add_events(events[1000:])
    writer.add_frame(frames_at([5])[0], 0)
    plain, num_writes, is_committing = journal._write_all, 0, []

    def dying(file, content, place):
        nonlocal num_writes
        num_writes += bool(is_committing)
        if num_writes > fatal:
            raise _Killed
        plain(file, content, place)

    commit = writer._raw.commit
    monkeypatch.setattr(journal, "_write_all", dying)
    monkeypatch.setattr(writer._raw, "commit", lambda: (is_committing.append(True), commit()))
    with pytest.raises(_Killed):
        writer.flush()
    assert journal.journal_of(path).is_file(), "the commit had begun"
    monkeypatch.setattr(journal, "_write_all", plain)
    with open_recording(path) as recording:
        assert recording.num_events in (1000, 2000)
        assert same(recording.read(0, recording.num_events), events[: recording.num_events])
    assert not journal.journal_of(path).exists()
    os.close(writer._raw._file)


def test_a_journal_that_was_not_finished_is_no_commit(tmp_path):
    path = tmp_path / "live.h5"
    _recorded(path, cut_up(make_events(10), 10)).close()
    journal.journal_of(path).write_bytes(b"etnetH5J" + bytes(30))
    assert not journal.restore(path)
    with open_recording(path) as recording:
        assert recording.num_events == 10

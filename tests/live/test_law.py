"""A recorded file replayed with the windows as they were cut gives the live frames, to the bit."""

import threading
from dataclasses import replace

import numpy as np
import pytest
import torch

from etnet.events.events import Sensor
from etnet.events.open import open_recording
from etnet.events.opened_as import View
from etnet.events.recording import MemorySource, recording_of_events
from etnet.live import replay as replay_module
from etnet.live.binning import binned, fitting_downsample
from etnet.live.log import windows_as_cut
from etnet.live.pace import fitting_policy, measured_step
from etnet.live.reconstruct import reconstruct_live
from etnet.live.record import Recorder
from etnet.live.recording import LiveRecording
from etnet.live.replay import Replay
from etnet.live.windows import LiveWindows
from etnet.nets.presets import build_model
from etnet.playback.playback import Playback
from etnet.reconstruction import reconstruct
from etnet.windows import ByCount, ByDensity, ByDuration
from tests.live.sources import GivenPackets, cut_up, make_events, same, taken_in, wait_for

MODEL = build_model("tiny")
SENSOR = Sensor(40, 28)


def _played(events, is_looped=False, speed=1.0) -> LiveRecording:
    return LiveRecording(Replay(recording_of_events(events), speed, is_looped))


@pytest.mark.parametrize("suffix", [".h5", ".aedat4"])
@pytest.mark.parametrize(("policy", "downsample"), [(ByDensity(0.3), 1), (ByDuration(15_000), 2)])
def test_the_recorded_file_and_its_windows_give_the_live_frames_to_the_bit(tmp_path, suffix, policy, downsample):
    path, frames = tmp_path / f"live{suffix}", []
    live = _played(make_events(12_000, SENSOR, duration=300_000), is_looped=True, speed=2.0)
    windows = LiveWindows(live, policy, Sensor(SENSOR.width // downsample, SENSOR.height // downsample))
    with Recorder(live, path, first=0) as recorder, live:
        recorder.follow(windows.kept, repr(policy), downsample)
        for live_step in reconstruct_live(MODEL, windows, downsample, lambda: len(frames) >= 25):
            frames.append(live_step.step.frame)
    with open_recording(path, view=View(downsample=downsample)) as recording:
        as_cut = windows_as_cut(recording)
        assert as_cut.downsample == downsample
        assert len(as_cut.windows) == len(frames)
        for (_, step), frame in zip(reconstruct(MODEL, recording, as_cut.windows), frames, strict=True):
            assert torch.equal(step.frame, frame)
        playback = Playback(MODEL, recording, as_cut.windows)
        for index in (20, 3, 24, 0):
            assert torch.equal(playback.at(index).frame, frames[index])


def test_the_kept_windows_give_the_live_frames_while_the_camera_goes_on():
    live, frames = _played(make_events(12_000, SENSOR, duration=300_000), is_looped=True, speed=2.0), []
    windows = LiveWindows(live, ByCount(400))
    with live:
        for live_step in reconstruct_live(MODEL, windows, is_stopped=lambda: len(frames) >= 15):
            frames.append(live_step.step.frame)
        playback = Playback(MODEL, live.recording(), windows.kept)
        for index in (14, 2, 8):
            assert torch.equal(playback.at(index).frame, frames[index])


def test_a_slow_network_gets_every_event_in_fewer_windows():
    events = make_events(6_000, SENSOR, duration=300_000)
    live = _played(events, speed=10.0)
    windows, seen = LiveWindows(live, ByCount(100)), 0
    with live:
        for live_step in reconstruct_live(MODEL, windows):
            assert live_step.window.start == seen
            seen = live_step.window.stop
    assert seen == 6_000
    assert windows.num_merged > 0
    assert sum(windows.kept.num_merged(i) for i in range(len(windows.kept))) == 60


def test_a_replay_goes_at_its_own_speed_and_round_and_round():
    events = make_events(500, duration=50_000)
    live = _played(events, is_looped=True)
    with live:
        wait_for(lambda: live.extent().num_events >= 1600)
        read = live.recording().read(0, 1500)
        assert (np.diff(read.t) >= 0).all()
        assert same(type(events)(read.x[:500], read.y[:500], read.t[:500], read.p[:500], read.sensor), events)
        assert np.array_equal(np.diff(read.t[500:1000]), np.diff(events.t))


class _Counted(MemorySource):
    """Counts how often it is read."""

    num_reads = 0

    def read(self, start, stop):
        _Counted.num_reads += 1
        return super().read(start, stop)


@pytest.mark.parametrize("ahead", [1, 700, 1 << 16])
def test_a_replay_hands_over_every_event_whatever_it_reads_ahead(monkeypatch, ahead):
    monkeypatch.setattr(replay_module, "AHEAD", ahead)
    events = make_events(9_000, SENSOR, duration=300_000)
    plain = recording_of_events(events)
    packets = list(Replay(plain, speed=0, packet_us=1_000).packets(lambda: False))
    at = 0
    for packet in packets:
        assert same(packet.events, events[at : at + len(packet.events)])
        assert packet.until is not None
        assert len(packet.events) == 0 or packet.events.t[-1] < packet.until
        at += len(packet.events)
        assert at == len(events) or events.t[at] >= packet.until
    assert at == len(events)


def test_a_replayed_file_is_read_once_for_many_packets():
    events = make_events(9_000, SENSOR, duration=300_000)
    recording = replace(recording_of_events(events), source=_Counted(events))
    packets = list(Replay(recording, speed=0, packet_us=1_000).packets(lambda: False))
    assert len(packets) >= 300
    assert _Counted.num_reads <= 3


def test_a_replay_as_fast_as_it_goes_gives_the_same_events_and_frames():
    from tests.live.test_record import SMALL, frames_at

    events, frames = make_events(5000), frames_at([-3_000, 10_000, 20_000, 61_000])
    from etnet.events.recording import GroundTruth

    truth = GroundTruth(np.array([f.stamp for f in frames]), lambda i: frames[i].pixels.astype(np.float32) / 255)
    live = LiveRecording(Replay(recording_of_events(events, ground_truth=truth), speed=0))
    with live:
        wait_for(lambda: live.is_over)
    recording = live.recording()
    assert recording.sensor == SMALL
    assert same(recording.read(0, 5000), events)
    assert recording.ground_truth is not None
    assert list(recording.ground_truth.stamps) == [-3_000, 10_000, 20_000, 61_000]
    pixels = np.rint(recording.ground_truth.read_frame(3) * 255).astype(np.uint8)
    assert np.array_equal(pixels, frames[3].pixels)


def test_a_binned_live_recording_grows_and_loses_no_event():
    events = make_events(300, SENSOR)
    live = taken_in(cut_up(events, 100), SENSOR)
    seen = binned(live.recording(), 4)
    assert seen.sensor == Sensor(10, 7)
    read = seen.read(0, 300)
    assert np.array_equal(read.x, events.x // 4)
    assert np.array_equal(read.t, events.t)


def test_large_sensors_are_binned_until_they_fit():
    sizes = {(240, 180): 1, (346, 260): 1, (640, 480): 2, (1280, 720): 4, (347, 260): 2}
    for (width, height), factor in sizes.items():
        assert fitting_downsample(Sensor(width, height)) == factor


def test_windows_are_chosen_so_that_a_step_fits_and_that_is_said():
    sensor = Sensor(200, 100)
    assert fitting_policy(0.1, 20_000, sensor).policy == ByDensity(0.35)
    dense = fitting_policy(0.1, 100_000, sensor)
    assert isinstance(dense.policy, ByDensity)
    assert 0.62 < dense.policy.events_per_pixel < 0.65
    assert "a step takes 100 ms at 200×100, 0.10 Mev/s" in dense.said
    assert fitting_policy(0.08, 10_000_000, sensor).policy == ByDuration(100_000)
    assert "merged" not in dense.said


def test_a_busy_moment_at_the_start_makes_no_windows_of_seconds_for_the_rest():
    """The clock says that the first steps took seconds each; the fastest counts, and what is chosen stays short."""
    times = iter([0, 9, 9, 20, 20, 21.5, 21.5, 40])
    assert measured_step(MODEL, SENSOR, lambda: next(times)) == 1.5
    slow = fitting_policy(1.5, 10_000_000, SENSOR)
    assert slow.policy == ByDuration(125_000)
    assert slow.said.endswith("windows of 125 ms; they are merged while a step is slower")


def test_a_step_that_becomes_slow_gets_its_windows_merged_and_when_it_is_fast_again_they_come_one_by_one():
    gate = threading.Semaphore(0)
    events = make_events(6_000, SENSOR, duration=300_000)
    live = LiveRecording(GivenPackets(cut_up(events, 100), SENSOR, gate))
    windows, merged = LiveWindows(live, ByCount(100)), []

    def hand_over(num_packets):
        """While a step runs, so many packets come."""
        before = live.extent().num_events
        for _ in range(num_packets):
            gate.release()
        wait_for(lambda: live.extent().num_events == before + 100 * num_packets)

    with live:
        hand_over(1)
        for number, live_step in enumerate(reconstruct_live(MODEL, windows, is_stopped=lambda: len(merged) >= 12)):
            merged.append(live_step.num_merged)
            hand_over(7 if 4 <= number < 7 else 1)
    assert merged == [1, 1, 1, 1, 1, 7, 7, 7, 1, 1, 1, 1]
    assert [window.start for window in windows.kept[1:]] == [window.stop for window in windows.kept[:-1]]

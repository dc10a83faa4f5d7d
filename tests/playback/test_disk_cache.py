"""The cache on disk: bit for bit what was given, within its budget, and never of another run."""

import dataclasses
import errno
from pathlib import Path

import pytest
import torch

from etnet.cli.main import main
from etnet.events.recording import Growth, Recording, recording_of_events
from etnet.files import cannot_write
from etnet.nets.base import State
from etnet.nets.fingerprint import weights_sha256
from etnet.nets.intervention import Intervention
from etnet.nets.presets import build_model
from etnet.nets.runtime import Runtime, apply_runtime, contract_of
from etnet.playback import disk_cache
from etnet.playback.disk_cache import STATE_SPACING, DiskCache, RunCache
from etnet.playback.playback import Playback
from etnet.playback.run_key import recording_key, run_cache, run_key, windows_key
from etnet.windows import ByCount, ByDuration, plan_windows
from tests.live.sources import wait_for
from tests.strategies import make_events

NUM_WINDOWS = 40
PATHS = [Runtime(), Runtime("fp32", "by_heads", True, True), Runtime("bf16", "tiled", True, True)]


def _recording(num_events: int = NUM_WINDOWS * 50) -> Recording:
    return recording_of_events(make_events(num_events))


def _model(runtime: Runtime = PATHS[0]):
    model = build_model("tiny")
    apply_runtime(model, runtime)
    return model


def _playback(folder: Path, model=None, recording: Recording | None = None) -> tuple[Playback, DiskCache]:
    recording, disk = recording or _recording(), DiskCache(folder)
    return Playback(model or _model(), recording, plan_windows(recording, ByCount(50)), disk=disk), disk


class Unwilling:
    """Stands before a network and fails where it is asked to compute."""

    def __init__(self, playback: Playback) -> None:
        self.encoded = self.decoded = 0
        model, encode, decode = playback.model, playback.model.encode, playback.model.decode

        def counted_encode(*arguments):
            self.encoded += 1
            return encode(*arguments)

        def counted_decode(*arguments):
            self.decoded += 1
            return decode(*arguments)

        model.encode, model.decode = counted_encode, counted_decode


@pytest.mark.parametrize("runtime", PATHS, ids=str)
def test_after_a_restart_frames_and_far_seeks_are_there_bit_for_bit(tmp_path, runtime):
    first, disk = _playback(tmp_path, _model(runtime))
    truth = [first.at(index).frame for index in range(NUM_WINDOWS)]
    disk.flush()

    again, disk = _playback(tmp_path, _model(runtime))
    counted = Unwilling(again)
    assert again.cached().frames != ()
    for index in (NUM_WINDOWS - 1, 3, 20):
        frame = again.frame(index)
        assert frame is not None
        assert torch.equal(frame, truth[index])
    assert (counted.encoded, counted.decoded) == (0, 0)

    for path in tmp_path.glob("*/*.frame"):
        path.unlink()
    fresh, _ = _playback(tmp_path, _model(runtime))
    counted = Unwilling(fresh)
    assert torch.equal(fresh.at(NUM_WINDOWS - 1).frame, truth[-1])
    assert counted.encoded < STATE_SPACING
    assert counted.decoded == 1
    assert torch.equal(fresh.at(17).frame, truth[17])


def test_a_frame_on_disk_is_not_decoded_again(tmp_path):
    first, disk = _playback(tmp_path)
    step = first.at(5)
    disk.flush()
    again, _ = _playback(tmp_path)
    counted = Unwilling(again)
    other = again.at(5)
    assert torch.equal(other.frame, step.frame)
    assert all(torch.equal(a, b) for a, b in zip(other.state, step.state, strict=True))
    assert counted.decoded == 0


def test_a_frame_is_the_same_without_torch(tmp_path):
    first, disk = _playback(tmp_path)
    frame = first.at(3).frame
    disk.flush()
    recording = _recording()
    windows = plan_windows(recording, ByCount(50))
    run = run_cache(DiskCache(tmp_path), _model(), recording, windows)
    assert run is not None
    array = run.frame_array(3)
    assert array is not None
    assert (array == frame.numpy()).all()
    assert run.frame_array(4) is None


def test_those_who_hold_one_run_find_what_another_of_them_wrote(tmp_path):
    first, disk = _playback(tmp_path)
    other = run_cache(disk, first.model, first.recording, first.windows)
    assert other is not None
    first.at(2)
    disk.flush()
    assert 2 in other.frames


def test_another_run_finds_nothing(tmp_path):
    def _key(model, recording, windows, contract):
        return run_key(recording, windows, weights_sha256(model), contract)

    model, recording = _model(), _recording()
    windows, contract = plan_windows(recording, ByCount(50)), contract_of(model)
    key = _key(model, recording, windows, contract)
    other_weights = build_model("tiny", torch.Generator().manual_seed(3))
    others = [
        _key(other_weights, recording, windows, contract),
        _key(model, _recording(NUM_WINDOWS * 50 - 1), windows, contract),
        _key(model, recording, plan_windows(recording, ByCount(51)), contract),
        _key(model, recording, windows[:-1], contract),
        _key(model, recording, windows, dataclasses.replace(contract, threads=contract.threads + 1)),
        _key(model, recording, windows, dataclasses.replace(contract, isa="none")),
        _key(model, recording, windows, dataclasses.replace(contract, runtime=Runtime(packed=True))),
    ]
    assert key == _key(_model(), _recording(), plan_windows(_recording(), ByCount(50)), contract)
    assert len({key, *others}) == len(others) + 1


def test_one_event_that_differs_is_another_recording():
    events = make_events(500)
    other = dataclasses.replace(events, p=-events.p)
    assert recording_key(recording_of_events(events)) != recording_key(recording_of_events(other))
    recording = recording_of_events(events)
    assert windows_key(plan_windows(recording, ByDuration(1000))) != windows_key(
        plan_windows(recording, ByDuration(1000, 500))
    )


def test_a_change_of_the_runtime_leaves_the_cache_alone(tmp_path):
    playback, disk = _playback(tmp_path)
    playback.at(2)
    disk.flush()
    apply_runtime(playback.model, PATHS[2])
    assert playback.cached().frames == (range(2, 3),)
    playback.at(4)
    disk.flush()
    assert {path.name for path in tmp_path.glob("*/*.frame")} == {"2.frame"}
    assert not _playback(tmp_path, _model(PATHS[2]))[0].has_frame(2)


def test_what_is_changed_or_grows_is_not_kept(tmp_path):
    playback, disk = _playback(tmp_path)
    playback.at(2, intervention=Intervention(without_context=True))
    playback.branch(1, Intervention(zeroed_levels=frozenset({1}))).at(3)
    disk.flush()
    assert not list(tmp_path.glob("*/3.frame"))
    assert not list(tmp_path.glob("*/2.frame"))
    growing = dataclasses.replace(_recording(), growth=Growth())
    assert run_cache(disk, _model(), growing, plan_windows(growing, ByCount(50))) is None


def test_a_disk_that_is_full_for_a_moment_is_written_to_again(tmp_path, monkeypatch):
    plain, failed = disk_cache.write_atomically, []

    def full(path, content, flushes=True):
        if path.suffix == ".frame" and not failed:
            failed.append(path)
            raise cannot_write(path, OSError(errno.ENOSPC, "No space left on device"))
        plain(path, content, flushes)

    monkeypatch.setattr(disk_cache, "write_atomically", full)
    run = DiskCache(tmp_path).run("k", "a run")
    run.put_frame(0, torch.zeros(1, 1, 2, 3))
    run.put_frame(1, torch.ones(1, 1, 2, 3))
    wait_for(lambda: run.frames == {1}, 10)
    assert failed


def test_a_state_whose_file_goes_between_two_looks_is_made_again_from_the_beginning(tmp_path, monkeypatch):
    first, disk = _playback(tmp_path)
    index = STATE_SPACING + 2
    truth = first.at(index).frame
    disk.flush()
    for path in tmp_path.glob("*/*.frame"):
        path.unlink()
    again, _ = _playback(tmp_path)
    again.budget_bytes = 64  # no state fits: each look reads the file
    plain, looks = RunCache.state, []

    def once(run, index):
        found = None if index in looks else plain(run, index)
        looks.append(index)
        return found

    monkeypatch.setattr(RunCache, "state", once)
    assert torch.equal(again.at(index).frame, truth)
    assert STATE_SPACING - 1 in looks


def test_a_damaged_file_is_one_that_is_not_there(tmp_path):
    first, disk = _playback(tmp_path)
    truth = first.at(3).frame
    disk.flush()
    path = next(tmp_path.glob("*/3.frame"))
    content = bytearray(path.read_bytes())
    for spoilt in (content[:-9], b"", bytes([*content[:40], content[40] ^ 1, *content[41:]])):
        path.write_bytes(spoilt)
        again, other = _playback(tmp_path)
        assert again.frame(3) is None
        assert torch.equal(again.at(3).frame, truth)
        other.flush()


def test_the_budget_holds_and_the_least_recently_used_go_first(tmp_path):
    disk = DiskCache(tmp_path, budget_bytes=40_000)
    old, new = disk.run("old", "old"), disk.run("new", "new")
    for index in range(10):
        old.put_frame(index, torch.full((1, 1, 20, 30), float(index)))
        disk.flush()
    for index in range(10):
        new.put_frame(index, torch.full((1, 1, 20, 30), float(index)))
        disk.flush()
    assert sum(path.stat().st_size for path in tmp_path.glob("*/*.*")) <= 41_000
    frame = DiskCache(tmp_path).run("new", "new").frame(9)
    assert frame is not None
    assert torch.equal(frame, torch.full((1, 1, 20, 30), 9.0))
    assert disk.run("old", "old").frame(0) is None
    new.put_frame(77, torch.zeros(1, 1, 200, 300))
    disk.flush()
    assert new.frame(77) is None


def test_what_made_room_for_others_is_not_said_to_be_held(tmp_path):
    disk = DiskCache(tmp_path, budget_bytes=40_000)
    first, second = disk.run("first", "first"), disk.run("second", "second")
    for index in range(STATE_SPACING + 4):
        first.put_frame(index, torch.full((1, 1, 20, 30), float(index)))
        disk.flush()
        first.put_state(index, State((torch.full((1, 2, 20, 30), float(index)),)))
        disk.flush()
    assert first.states == {STATE_SPACING - 1}
    for index in range(20):
        second.put_frame(index, torch.full((1, 1, 20, 30), float(index)))
        disk.flush()
    for run, name in ((first, "first"), (second, "second")):
        assert run.frames == {int(path.stem) for path in (tmp_path / name).glob("*.frame")}
        assert run.states == {int(path.stem) for path in (tmp_path / name).glob("*.state")}
    assert 0 not in second.frames
    second.put_frame(0, torch.zeros(1, 1, 20, 30))  # once more: it is made and kept again
    disk.flush()
    assert 0 in second.frames


def test_a_frame_whose_file_is_gone_is_not_held_once_it_was_looked_for(tmp_path):
    disk = DiskCache(tmp_path)
    run = disk.run("key", "title")
    run.put_frame(2, torch.zeros(1, 1, 20, 30))
    disk.flush()
    assert run.frames == {2}
    (tmp_path / "key" / "2.frame").unlink()
    assert run.frame_array(2) is None
    assert run.frames == frozenset()


def test_a_state_comes_back_in_its_dtype_and_memory_format(tmp_path):
    disk = DiskCache(tmp_path)
    run = disk.run("key", "title")
    last = torch.randn(1, 4, 5, 6).contiguous(memory_format=torch.channels_last)
    state = State(
        (last, torch.randn(1, 4, 5, 6), torch.randn(1, 2, 3, 4).bfloat16(), *(last.clone() for _ in range(9)))
    )
    run.put_state(STATE_SPACING - 1, state)
    run.put_state(STATE_SPACING, state)
    disk.flush()
    assert run.states == {STATE_SPACING - 1}
    found = disk.run("key", "title").state(STATE_SPACING - 1)
    assert found is not None
    assert len(found) == len(state)
    for a, b in zip(found, state, strict=True):
        assert torch.equal(a, b)
        assert (a.stride(), a.dtype) == (b.stride(), b.dtype)


def test_a_folder_that_cannot_be_written_breaks_nothing(tmp_path):
    (tmp_path / "file").write_text("in the way")
    playback, disk = _playback(tmp_path / "file" / "below")
    playback.at(1)
    disk.flush()
    assert playback.has_frame(1)
    assert disk.runs() == ()


def test_a_full_queue_drops_and_never_waits(tmp_path, monkeypatch):
    disk = DiskCache(tmp_path)
    monkeypatch.setattr(disk, "_writer", object())
    for _ in range(100):
        disk.later(lambda: 0)
    assert disk._jobs.qsize() == disk_cache._WAITING


def test_the_command_lists_and_clears(tmp_path, monkeypatch, capsys):
    monkeypatch.setenv("ETNET_CACHE", str(tmp_path))
    playback, disk = _playback(tmp_path / "frames")
    playback.at(0)
    disk.flush()
    assert main(["cache"]) == 0
    assert "events · etnet · 40 windows" in capsys.readouterr().out
    assert main(["cache", "--recording", "nothing"]) == 1
    assert main(["cache", "--clear"]) == 0
    assert disk.runs() == ()
    capsys.readouterr()
    assert main(["cache"]) == 0
    assert "0.0 MB" in capsys.readouterr().out

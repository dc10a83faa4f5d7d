"""Frames on disk: there before the network is, the same to the bit, never another network's, never a visitor's own."""

import subprocess
import sys
import threading
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from app.catalogue.models import ModelEntry
from app.engine.engine import Engine
from app.engine.kept_frames import as_ranges
from app.engine.requests import FrameRequest, Ready
from etnet.events.denoise import Cleaning
from etnet.events.events import Sensor
from etnet.nets.presets import build_model
from etnet.nets.runtime import Runtime, apply_runtime, default_runtime
from etnet.playback.disk_cache import DiskCache
from tests.app.fakes import CountingModel, Inbox, Notes, Shelf, hold, recording_of, request, sequential

NUM_WINDOWS = 40


@dataclass
class ShelfOnDisk(Shelf):
    """A shelf whose network lies in a file, as weights do."""

    file: Path = Path()

    def model(self, model_id):
        return ModelEntry(model_id, model_id, "", True, None, self.warm_up, self.file)


@pytest.fixture(autouse=True)
def own_cache(tmp_path, monkeypatch):
    monkeypatch.setenv("ETNET_CACHE", str(tmp_path / "cache"))


@pytest.fixture
def weights(tmp_path):
    path = tmp_path / "weights.safetensors"
    path.write_bytes(b"anything")
    return path


@pytest.fixture
def start(tmp_path, weights):
    """Starts a viewer's engine on the same cache."""
    running = []

    def begin(load=None, threads=1, keeps=bool, budget=64 << 20, prefetches=False):
        shelf, disk = ShelfOnDisk(file=weights), DiskCache(tmp_path / "frames")
        load = load or shelf.load
        engine = Engine(shelf, budget, threads=threads, load=load, prefetches=prefetches, disk=disk, keeps=keeps)
        running.append((engine, shelf))
        return engine, shelf, disk

    yield begin
    for engine, shelf in running:
        if shelf.model_instance.gate is not None:
            shelf.model_instance.gate.release(10_000)
        engine.stop()


def ask(engine, index, visitor="ada"):
    engine.request(visitor, request(index), inbox := Inbox())
    return inbox.ready(index)


def network(runtime):
    apply_runtime(model := build_model("tiny"), runtime)
    return model


def fill(start, indices, **more):
    engine, _, disk = start(**more)
    for index in indices:
        ask(engine, index)
    disk.flush()
    engine.stop()


def test_a_frame_of_an_earlier_start_is_there_before_the_network_is(start):
    fill(start, range(8))
    may_load = threading.Event()
    shelf = Shelf()

    def load(*_):
        assert may_load.wait(20)
        return shelf.model_instance

    engine, _, _ = start(load)
    try:
        engine.request("ada", request(5), inbox := Inbox())
        ready = inbox.ready(5)
        assert np.array_equal(ready.frame, sequential(shelf, 5))
        assert ready.is_exact
        assert engine.cached(request(5)).frames == (range(8),)
    finally:
        may_load.set()
    inbox.wait(lambda reply: reply is not ready and reply.request.index == 5)
    later = inbox.replies[-1]
    assert later.key == ready.key  # nothing has to be drawn again
    assert shelf.model_instance.decodes <= 2  # the trial steps alone


def test_a_kept_frames_state_is_called_as_warm_as_when_it_was_made(start):
    sparse, made = recording_of(NUM_WINDOWS, Sensor(64, 48)), {}
    engine, shelf, disk = start()
    shelf.recordings["r"] = sparse
    for index in (0, 3, 30):
        made[index] = ask(engine, index)
    disk.flush()
    engine.stop()
    assert made[30].is_cold, "too few events came by then"
    engine, shelf, _ = start()
    shelf.recordings["r"] = sparse
    engine._kept.name(request(0))
    for index, ready in made.items():
        kept = engine._kept.find(request(index))
        told = kept.is_cold, kept.num_seen, kept.warm_up
        assert told == (ready.is_cold, ready.num_seen, ready.warm_up)


def test_what_an_earlier_run_made_under_another_contract_is_not_shown_beside_what_is_made_now(start):
    fill(start, range(8), load=lambda *_: network(default_runtime()))
    may_load, model = threading.Event(), network(Runtime(attention="plain"))

    def load(*_):
        assert may_load.wait(20)
        return model

    engine, _, _ = start(load)
    try:
        former = ask(engine, 6)
        assert ask(engine, 6).key == former.key
        engine.request("bob", request(5), inbox := Inbox())
        shown = inbox.ready(5)
    finally:
        may_load.set()
    now = inbox.wait(lambda reply: isinstance(reply, Ready) and reply.contract != shown.contract)
    assert now.contract.runtime == model.runtime
    assert [ask(engine, index).contract for index in (5, 6, 7)] == [now.contract] * 3


@pytest.mark.parametrize(
    "runtime", [default_runtime(), Runtime(attention="plain")], ids=["as loaded", "of another size"]
)
def test_nothing_is_noted_that_the_next_start_would_not_come_to_itself(start, runtime):
    fill(start, range(3), load=lambda *_: network(runtime))
    engine, _, _ = start()
    engine._kept.name(request(1))
    assert (engine._kept.find(request(1)) is None) == (runtime != default_runtime())


def test_with_the_cache_on_any_order_gives_the_sequential_run(start):
    walk = np.random.default_rng(0)
    for _ in range(3):
        engine, shelf, disk = start(budget=64 << 10)
        for index in walk.integers(0, NUM_WINDOWS, 15):
            ready = ask(engine, int(index))
            assert np.array_equal(ready.frame, sequential(shelf, int(index)))
            assert ready.is_exact
        disk.flush()
        engine.stop()


def test_a_kept_frame_waits_for_nobodys_step(start):
    fill(start, range(8))
    engine, shelf, _ = start()
    ask(engine, 3)
    gate = hold(shelf.model_instance)
    engine.request("bob", request(30), Inbox())
    assert shelf.model_instance.entered.acquire(timeout=10)
    engine.request("ada", request(6), inbox := Inbox())
    assert [reply.request.index for reply in inbox.replies] == [6]
    gate.release(100)


@pytest.mark.parametrize("change", ["weights", "threads", "recording", "cleaning"])
def test_another_run_finds_nothing(start, weights, change):
    fill(start, range(8))
    if change == "weights":
        weights.write_bytes(b"something else")
    engine, shelf, _ = start(threads=2 if change == "threads" else 1)
    if change == "recording":
        shelf.recordings["r"] = recording_of(NUM_WINDOWS, seed=1)
    wanted = request(5, cleaning=Cleaning(support_within=5000)) if change == "cleaning" else request(5)
    engine._kept.name(wanted)
    assert engine._kept.find(wanted) is None


@dataclass(frozen=True, slots=True)
class Frame:
    """A job that makes one frame."""

    request: FrameRequest

    def run(self, loaded, cancelled):
        loaded.playback.at(self.request.index, cancelled=cancelled)
        yield True, 1.0


def test_what_a_job_made_before_any_request_is_found_at_the_next_start(start):
    engine, shelf, disk = start()
    engine.job("ada", "slot", Frame(request(5)), notes := Notes())
    notes.whole()
    disk.flush()
    engine.stop()
    engine, _, _ = start()
    engine._kept.name(request(5))
    assert np.array_equal(engine._kept.find(request(5)).frame, sequential(shelf, 5))


def test_what_a_visitor_uploads_is_not_kept(start, tmp_path):
    fill(start, range(3), keeps=lambda recording_id: False)
    assert not list((tmp_path / "frames").glob("*/*"))


def test_a_cache_that_cannot_be_written_breaks_nothing(start, tmp_path):
    (tmp_path / "frames").write_bytes(b"a file where the folder should be")
    engine, shelf, _ = start()
    assert np.array_equal(ask(engine, 3).frame, sequential(shelf, 3))


def test_notes_that_are_damaged_are_none(start, tmp_path):
    fill(start, range(3))
    (tmp_path / "frames" / "notes.json").write_text('{"a": 3, "b": {"weights": 1}}')
    engine, shelf, _ = start()
    assert np.array_equal(ask(engine, 2).frame, sequential(shelf, 2))


def test_finding_them_needs_no_torch():
    program = "import app.engine.engine, app.engine.kept_frames, sys; sys.exit('torch' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", program], check=False).returncode == 0


def test_ranges_are_half_open_and_in_order():
    assert as_ranges([5, 1, 2, 7, 6]) == (range(1, 3), range(5, 8))
    assert as_ranges([]) == ()


def test_a_frame_that_is_not_finite_is_an_error_at_this_start_and_at_the_next(start):
    class Damaged(CountingModel):
        def decode(self, pyramid, probe=None, intervention=None):
            frame, attention = super().decode(pyramid, probe, intervention)
            return frame * float("nan"), attention

    for _ in range(2):
        engine, _, disk = start(load=lambda entry, precision, device: Damaged())
        inbox = Inbox()
        engine.request("ada", request(3), inbox)
        assert "is not finite" in inbox.failed().message
        disk.flush()
        again = Inbox()
        engine.request("bob", request(3), again)
        assert "is not finite" in again.failed().message
        assert inbox.of(Ready) == again.of(Ready) == []
        engine.stop()

"""Frames of a recording whose beginning has left, and a network that is slower than its source: no thread, no clock."""

import time
from dataclasses import dataclass, replace
from threading import Condition
from types import SimpleNamespace

import numpy as np
import pytest

from app.catalogue.cut import with_cut
from app.engine import live
from app.engine.jobs import JobQueue
from app.engine.live import LiveSteps
from app.engine.playbacks import PlaybackCache
from app.engine.queue import RequestQueue
from app.engine.replies import cold_frame, ready_of
from app.engine.requests import FrameRequest
from etnet.errors import ModelError, RecordingError, WindowError
from etnet.events.edit import EventEdit
from etnet.live.buffer import Extent
from etnet.reconstruction import window_voxel
from etnet.windows import plan_windows
from tests.app.fakes import POLICY, CountingModel, Shelf, recording_of, request

NUM_WINDOWS, WARM_UP = 40, 5
LAST = NUM_WINDOWS - 1


class Leaving:
    """A live recording: the events of its first `num_gone` windows have left; those of its last can always be read."""

    def __init__(self):
        self.whole, self.num_gone = recording_of(NUM_WINDOWS), 0
        self.cut = tuple(plan_windows(self.whole, POLICY))
        self.num_events = self.whole.num_events
        self.recording = with_cut(replace(self.whole, source=self), POLICY, self.cut, self.extent)

    def extent(self):
        held = self.num_events if self.num_gone >= NUM_WINDOWS else self.cut[self.num_gone].start
        span, last = self.whole.span, self.cut[-1]
        stamp = self.cut[min(self.num_gone, LAST)].t_start
        return Extent(self.num_events, held, span.start, span.stop, stamp, span.stop, range(last.start, last.stop))

    def read(self, start, stop):
        if not self.extent().is_there(start, stop):
            raise RecordingError("gone: what came before has left the buffer")
        return self.whole.read(start, stop)

    def close(self):
        """Nothing is held open."""


class SlowModel(CountingModel):
    """While it takes a step, seconds pass and events leave."""

    def __init__(self):
        super().__init__()
        self.on_step = lambda: None

    def encode(self, voxel, state=None, intervention=None):
        made = super().encode(voxel, state, intervention)
        if voxel.shape[-2:] != (96, 128):
            self.on_step()
        return made


@pytest.fixture
def source():
    return Leaving()


def playbacks_of(source, model, warm_up=WARM_UP):
    shelf = Shelf({"r": source.recording}, model, warm_up)
    return PlaybackCache(shelf, 64 << 20, "cpu", None, shelf.load)


def begun_at(source, first, held=10):
    """What began near the newest window, though more than that is held."""
    source.num_gone = held
    loaded = playbacks_of(source, CountingModel()).loaded(request(LAST))
    loaded.playback.first = first
    loaded.playback.at(LAST)
    return loaded


def cold(loaded, index, **more):
    return cold_frame(loaded, request(index, **more), time.perf_counter(), lambda: False)


@pytest.mark.parametrize(("index", "seen"), [(10, 0), (12, 2), (15, WARM_UP), (LAST, WARM_UP)])
def test_a_memory_is_as_warm_as_what_it_has_seen_since_it_was_empty(source, index, seen):
    loaded = begun_at(source, first=10)
    ready = ready_of(loaded, request(index), loaded.playback.at(index).frame, None, time.perf_counter())
    assert (ready.began_at, ready.num_seen, ready.is_cold) == (10, seen, seen < WARM_UP)


@pytest.mark.parametrize(("index", "began_at"), [(34, 29), (20, 15), (11, 10), (10, 10)])
def test_a_moment_that_is_held_is_shown_though_the_network_began_later(source, index, began_at):
    loaded = begun_at(source, first=35)
    assert not loaded.reaches(index)
    ready = cold(loaded, index)
    assert (ready.began_at, ready.num_seen, ready.is_cold) == (began_at, index - began_at, index - began_at < WARM_UP)
    assert not ready.is_exact
    windows = source.cut[began_at : index + 1]
    seen = sum(window_voxel(loaded.playback.model, source.whole, window).sum(0) for window in windows)
    assert np.allclose(ready.frame, (seen / 100).numpy(), atol=1e-6)


def test_what_has_left_is_gone_and_a_change_there_says_what_it_needs(source):
    loaded = begun_at(source, first=35)
    with pytest.raises(WindowError, match="gone: what came before"):
        cold(loaded, 9)
    changed = EventEdit(invert=1.0)
    with pytest.raises(WindowError, match="a change needs the way"):
        cold(loaded, 20, edit=changed)
    with pytest.raises(ModelError, match="can begin at window 35"):
        loaded.playing(request(20, edit=changed))


@dataclass(frozen=True)
class Looking:
    """Looks at one window."""

    request: FrameRequest

    def run(self, loaded, cancelled):
        yield loaded.playback.at(self.request.index).frame.shape, 1.0


def test_a_question_about_a_moment_before_the_network_began_is_answered_in_words(source):
    playbacks, told = playbacks_of(source, CountingModel()), []
    loaded = playbacks.loaded(request(LAST))
    loaded.playback.first = 35
    loaded.playback.at(LAST)
    jobs = JobQueue(playbacks, Condition())
    jobs.put("somebody", "looking", Looking(request(20)), lambda slot, result: told.append(result))
    jobs.work(lambda: False)
    assert "the memory was empty at window 35" in told[-1].trouble


def test_the_newest_window_is_shown_when_all_else_has_left(source):
    loaded = playbacks_of(source, CountingModel()).loaded(request(LAST))
    source.num_gone = NUM_WINDOWS
    assert cold(loaded, LAST).began_at == LAST


class Steps:
    """The live side of the engine over a source whose last window was taken; each step of the network takes a second,
    in which `leave` windows leave."""

    def __init__(self, source, leave, warm_up, monkeypatch):
        self.now, self.notes, self.done, model = 0.0, [], [], SlowModel()
        monkeypatch.setattr(live, "time", SimpleNamespace(monotonic=lambda: self.now, perf_counter=time.perf_counter))
        self.playbacks, self.book = playbacks_of(source, model, warm_up), RequestQueue()
        windows = SimpleNamespace(
            kept=source.cut, policy=POLICY, take=lambda timeout: source.cut[-1], is_full=lambda: False
        )
        told = SimpleNamespace(buffer=SimpleNamespace(changed=Condition()), note=self.notes.append)
        feed = SimpleNamespace(id="r", windows=windows, live=told, finished=lambda index: None)
        self.steps = LiveSteps(feed, "m", "fp32", self.playbacks, self.book)

        def passes():
            self.now, source.num_gone = self.now + 1.0, source.num_gone + leave

        self.model, self.passes = model, passes
        model.on_step = passes

    def turns(self, most, between=lambda: None):
        """How many turns the network needs until the window's image is there."""
        for number in range(1, most + 1):
            self.steps.work(lambda loaded, request, step, began: self.done.append((loaded, request.index)))
            if self.done:
                return number
            between()
        return None


@pytest.fixture
def stepping(source, monkeypatch):
    made = []

    def begin(leave, warm_up=WARM_UP):
        made.append(Steps(source, leave, warm_up, monkeypatch))
        return made[-1]

    yield begin
    for each in made:
        each.steps.stop()


@pytest.mark.parametrize("is_asked", [False, True])
def test_a_network_that_makes_way_for_others_does_not_follow_what_leaves_along_all_that_is_held(
    source, stepping, is_asked
):
    source.num_gone, steps = 5, stepping(leave=2)
    steps.book.put("another", request(0, "elsewhere"), lambda reply: None)
    ask = lambda: steps.playbacks.reaching(request(LAST - 1))  # noqa: E731
    assert steps.turns(NUM_WINDOWS, ask if is_asked else lambda: None) == 1 + (WARM_UP + 1)
    (loaded, index), *_ = steps.done
    assert (loaded.playback.first, index) == (LAST - WARM_UP, LAST)
    assert steps.notes == []


def test_another_network_that_comes_to_the_window_meanwhile_goes_on_from_where_it_is(source, stepping):
    source.num_gone, steps = 5, stepping(leave=2)
    other = request(LAST, model="n")
    steps.model.on_step = lambda: None
    loaded = steps.playbacks.loaded(other)
    loaded.playback.at(LAST - 1)
    steps.model.on_step = steps.passes
    steps.book.put("another", request(0, "elsewhere"), lambda reply: None)
    assert steps.turns(1) is None
    steps.book.put("somebody", other, lambda reply: None)
    assert steps.turns(1) == 1
    assert steps.done == [(loaded, LAST)]


@pytest.mark.parametrize(("leave", "first"), [(1, 1), (7, 34), (12, 38), (10, LAST), (60, LAST)])
def test_a_network_that_is_overtaken_on_the_way_from_near_begins_nearer_and_is_no_fault(source, stepping, leave, first):
    source.num_gone, steps = 1, stepping(leave)
    assert steps.turns(1) == 1
    (loaded, index), *_ = steps.done
    assert index == LAST
    assert steps.notes == []
    assert loaded.playback.first == first

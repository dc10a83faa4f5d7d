"""Frames of a live recording whose beginning has left: what is claimed of them."""

import time
from dataclasses import dataclass, replace
from threading import Condition

import numpy as np
import pytest

from app.catalogue.cut import with_cut
from app.engine.jobs import JobQueue
from app.engine.playbacks import PlaybackCache
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

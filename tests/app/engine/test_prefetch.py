"""What the engine does while nobody waits."""

import threading
import time

import numpy as np
import pytest

from app.engine.playbacks import PlaybackCache
from app.engine.prefetch import Prefetcher, windows_ahead
from app.engine.queue import RequestQueue
from etnet.errors import WindowError
from tests.app.fakes import Inbox, hold, request, sequential


def test_idle_time_prepares_what_comes_next(shelf, make_engine):
    engine, inbox = make_engine(prefetches=True), Inbox()
    engine.request("ada", request(3), inbox)
    inbox.ready(3)
    deadline = time.monotonic() + 10
    while (report := engine.cached(request(3))) is None or not any(27 in held for held in report.frames):
        assert time.monotonic() < deadline
        time.sleep(0.01)
    again = Inbox()
    engine.request("ada", request(9), again)
    assert np.array_equal(again.ready(9).frame, sequential(shelf, 9))
    assert len(again.replies) == 1  # at once: nothing had to be replayed


def test_what_is_prepared_says_how_long_a_step_takes(shelf, make_engine):
    engine, inbox = make_engine(prefetches=True), Inbox()
    gate = hold(shelf.model_instance)
    engine.request("ada", request(3), inbox)
    gate.release(1)
    deadline = time.monotonic() + 10
    while not engine._playbacks.held_keys():
        assert time.monotonic() < deadline
    engine._playbacks.held(request(3)).pace.note_whole(60_000.0)
    gate.release(10_000)
    inbox.ready(3)
    while engine.status(request(3)).step_milliseconds > 6_000:
        assert time.monotonic() < deadline
        time.sleep(0.01)


def test_preparing_ends(shelf, make_engine):
    engine, inbox = make_engine(budget=64 << 10, prefetches=True), Inbox()
    engine.request("ada", request(3), inbox)
    inbox.ready(3)
    steps, quiet_since, deadline = -1, time.monotonic(), time.monotonic() + 20
    while time.monotonic() < quiet_since + 0.5:
        assert time.monotonic() < deadline, "it goes on and on"
        if steps != (steps := shelf.model_instance.decodes):
            quiet_since = time.monotonic()
        time.sleep(0.01)


def test_a_request_interrupts_preparing(shelf, make_engine):
    engine, inbox = make_engine(prefetches=True), Inbox()
    model = shelf.model_instance
    engine.request("ada", request(0), inbox)
    gate = hold(model)
    gate.release(1)  # for window 0 itself, unless it is done already
    assert model.entered.acquire(timeout=10)
    engine.request("bob", request(0), bob := Inbox())
    gate.release(2)
    bob.ready(0)


def test_a_model_can_be_prepared_before_anybody_asks(shelf, make_engine):
    loaded = threading.Event()
    load = shelf.load
    shelf.load = lambda *given: (loaded.set(), load(*given))[1]
    engine = make_engine()
    engine.prepare("m", "fp32")
    assert loaded.wait(10)
    inbox = Inbox()
    engine.request("ada", request(0), inbox)
    inbox.ready(0)


def test_preparing_a_model_that_is_missing_harms_nobody(make_engine):
    engine, inbox = make_engine(), Inbox()
    engine.prepare("missing", "fp32")
    engine.request("ada", request(0), inbox)
    inbox.ready(0)


def test_for_one_who_plays_frames_are_prepared_in_play_order():
    tasks = list(windows_ahead(10, 100, num_states=20, stride=3))
    assert tasks[:4] == [("frame", 13), ("frame", 16), ("frame", 19), ("frame", 22)]
    assert next(windows_ahead(10, 12, num_states=20, stride=3))[0] == "state"


class Counted(RequestQueue):
    """Counts how often the last requests are asked for."""

    num_asked = 0

    def last_turns(self):
        self.num_asked += 1
        return super().last_turns()


def test_what_comes_next_is_planned_once_for_each_request_and_playback(shelf):
    book, playbacks = Counted(), PlaybackCache(shelf, 64 << 20, "cpu", 1, shelf.load)
    prefetcher = Prefetcher(playbacks, book)
    book.put("ada", request(3), lambda reply: None)
    assert [prefetcher.has_work() for _ in range(5)] == [False] * 5
    assert book.num_asked == 1
    playbacks.loaded(request(3)).state_bytes = 1_000
    assert [prefetcher.has_work() for _ in range(5)] == [True] * 5
    assert book.num_asked == 2
    made = []
    while prefetcher.has_work():
        prefetcher.work(lambda: False, lambda prepared, loaded: made.append(prepared.index))
    assert set(range(4, 12)) <= set(made)
    assert book.num_asked == 2
    book.drop("ada")
    assert not prefetcher.has_work()
    assert book.num_asked == 3


def test_where_a_step_would_take_too_long_nothing_is_prepared(shelf):
    book, playbacks = RequestQueue(), PlaybackCache(shelf, 64 << 20, "cpu", 1, shelf.load, longest_step=1e-6)
    prefetcher = Prefetcher(playbacks, book)
    book.put("ada", request(3), lambda reply: None)
    for _ in range(2):
        with pytest.raises(WindowError, match="would take about"):
            playbacks.loaded(request(3))
        assert not prefetcher.has_work()
    assert playbacks.held_keys() == frozenset()

import gc
import threading
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np
import pytest

from app.engine.engine import Engine
from app.engine.jobs import JobResult, num_bytes
from app.engine.requests import FrameRequest, Ready
from app.session.jobs import JobNews, VisitorJobs
from app.state.view_state import ViewState
from etnet.errors import ModelError
from tests.app.fakes import Inbox, Notes, Shelf, hold, request

LOG: list[tuple[str, int]] = []
"""What the jobs below did, in order."""


@dataclass(frozen=True, slots=True)
class Counting:
    """Counts to `length`, one encode at a time."""

    request: FrameRequest
    length: int = 3
    name: str = "counting"
    breaks: bool = False

    def run(self, loaded, cancelled):
        for done in range(1, self.length + 1):
            if self.breaks:
                raise ModelError("this cannot be counted")
            loaded.playback.model.encode(next(loaded.playback.model.parameters()).new_zeros(1, 5, 16, 24))
            LOG.append((self.name, done))
            yield done, done / self.length


@dataclass(frozen=True, slots=True)
class Ordered(Counting):
    """The same, as a file that somebody ordered."""

    is_ordered: ClassVar[bool] = True


@pytest.fixture
def shelf():
    LOG.clear()
    return Shelf()


@pytest.fixture
def engine(shelf):
    engine = Engine(shelf, 64 << 20, threads=1, load=shelf.load, prefetches=False)
    yield engine
    if shelf.model_instance.gate is not None:
        shelf.model_instance.gate.release(10_000)
    engine.stop()


def test_an_answer_grows_until_it_is_whole(engine):
    notes = Notes()
    engine.job("ada", "slot", Counting(request(3)), notes)
    assert notes.whole().value == 3
    assert notes.shares == pytest.approx([1 / 3, 2 / 3, 1.0])


def test_a_known_answer_comes_at_once_and_is_not_computed_twice(engine):
    notes, again = Notes(), Notes()
    engine.job("ada", "slot", Counting(request(3)), notes)
    notes.whole()
    engine.job("bob", "slot", Counting(request(3)), again)
    assert [result.is_whole for _, result in again.replies] == [True]
    assert len(LOG) == 3


def test_a_request_is_served_between_two_stretches(engine, shelf):
    notes, inbox = Notes(), Inbox()
    engine.request("ada", request(0), inbox)
    inbox.ready(0)
    gate = hold(shelf.model_instance)
    engine.job("ada", "slot", Counting(request(0), 50), notes)
    shelf.model_instance.entered.acquire(timeout=10)
    engine.request("ada", request(1), inbox)
    gate.release(3)  # one stretch, the request's encode, one stretch more
    inbox.ready(1)
    assert len(LOG) <= 2


def test_a_file_that_was_ordered_gets_its_turns_though_somebody_always_waits(engine):
    notes, inspector, ends = Notes(), Notes(), threading.Event()

    def again(reply):
        if isinstance(reply, Ready) and not ends.is_set():
            engine.request("ada", request((reply.request.index + 1) % 40), again)  # asked while the engine hands over

    engine._recent.find = lambda wanted: None  # each frame is computed, or taken from the playback, on its thread
    engine.request("ada", request(0), again)
    engine.job("bob", "inspector", Counting(request(0), 5, "inspector"), inspector)
    engine.job("cyd", "file", Ordered(request(0), 5, "file"), notes)
    try:
        assert notes.whole().value == 5
        assert inspector.replies == [], "nobody but who ordered a file holds others up"
    finally:
        ends.set()
    inspector.whole()


def test_of_files_that_were_ordered_at_once_the_first_is_there_long_before_the_last(engine, shelf):
    """In turns alone all four would be whole at turn 37 and after; nobody waits much longer than in turns."""
    gate, length = hold(shelf.model_instance), 10
    told = {name: Notes() for name in ("a", "b", "c", "d")}
    for name, notes in told.items():
        engine.job(name, "file", Ordered(request(0), length, name), notes)
    shelf.model_instance.entered.acquire(timeout=60)
    gate.release(1000)
    for notes in told.values():
        notes.whole()
    ends = sorted(LOG.index((name, length)) + 1 for name in told)
    assert ends[0] <= 2 * length
    assert sum(ends) < 4 * 30
    assert ends[-1] == 4 * length


def test_of_what_was_forgotten_meanwhile_no_answer_is_kept(engine, shelf):
    notes = Notes()
    gate = hold(shelf.model_instance)
    engine.job("ada", "slot", Counting(request(0), 2), notes)
    shelf.model_instance.entered.acquire(timeout=10)
    engine.forget("r")
    gate.release(10)
    assert notes.whole().value == 2
    assert engine._jobs._kept.nbytes == 0


def test_a_newer_question_replaces_the_slots_former_one(engine, shelf):
    old, new = Notes(), Notes()
    gate = hold(shelf.model_instance)
    engine.job("ada", "slot", Counting(request(0), 50, "old"), old)
    shelf.model_instance.entered.acquire(timeout=10)
    engine.job("ada", "slot", Counting(request(0), 2, "new"), new)
    gate.release(10)
    assert new.whole().value == 2
    assert sum(name == "old" for name, _ in LOG) == 1
    assert old.replies == []


def test_slots_take_turns(engine, shelf):
    gate = hold(shelf.model_instance)
    one, two = Notes(), Notes()
    engine.job("ada", "a", Counting(request(0), 3, "one"), one)
    engine.job("bob", "b", Counting(request(0), 3, "two"), two)
    gate.release(100)
    one.whole(), two.whole()
    names = [name for name, _ in LOG]
    assert names[1:4] in (["two", "one", "two"], ["one", "two", "one"])


def test_a_visitor_who_leaves_costs_nothing_more(engine, shelf):
    gate = hold(shelf.model_instance)
    engine.job("ada", "slot", Counting(request(0), 50), Notes())
    shelf.model_instance.entered.acquire(timeout=10)
    engine.drop("ada")
    gate.release(5)
    inbox = Inbox()
    engine.request("bob", request(0), inbox)
    inbox.ready(0)
    assert len(LOG) == 1


@pytest.mark.parametrize(("job", "words"), [
    (Counting(request(3), breaks=True), "cannot be counted"),
    (Counting(request(999)), "window 999 does not exist"),
    (Counting(request(0, recording="nowhere")), "no such recording"),
])  # fmt: skip
def test_what_cannot_be_answered_is_said(engine, job, words):
    notes = Notes()
    engine.job("ada", "slot", job, notes)
    _, result = notes.wait(lambda reply: reply[1].trouble)
    assert words in result.trouble
    assert not result.is_whole


def test_a_job_begins_no_step_that_would_take_too_long(make_engine, shelf):
    notes = Notes()
    make_engine(longest_step=1e-6).job("ada", "slot", Counting(request(3)), notes)
    _, result = notes.wait(lambda reply: reply[1].trouble)
    assert "would take about" in result.trouble
    assert shelf.model_instance.encodes == 0


def test_a_playback_that_a_job_needs_first_is_told_as_a_requests_is(engine):
    notes = Notes()
    engine.job("ada", "slot", Counting(request(3)), notes)
    notes.whole()
    assert engine._published.pace(request(3)) is engine._playbacks.held(request(3)).pace
    assert engine.status(request(3)).precision == "fp32"


class Recorder:
    def __init__(self):
        self.calls = []

    def job(self, visitor, slot, job, tell):
        self.calls.append(("job", slot, job))
        self.tell = tell

    def drop_job(self, visitor, slot):
        self.calls.append(("drop", slot))


def test_only_what_changed_is_asked():
    engine, news = Recorder(), []
    asked = VisitorJobs(engine, "ada", news.append)
    one, two = Counting(request(1)), Counting(request(2))
    asked.want({"a": one})
    asked.want({"a": one})
    asked.want({"a": two})
    asked.want({})
    assert engine.calls == [("job", "a", one), ("job", "a", two), ("drop", "a")]


def test_while_windows_pass_nobody_is_asked_what_is_wanted_unless_more_than_the_window_changes():
    engine, told = Recorder(), []
    asked = VisitorJobs(engine, "ada", lambda news: None)
    one, two = Counting(request(1)), Counting(request(2))
    wanted = {"a": one, "b": one}

    def jobs():
        told.append(dict(wanted))
        return wanted

    state = ViewState(recording_id="r")
    asked.ask(state, False, jobs)
    for index in range(1, 5):
        asked.ask(replace(state, index=index), True, jobs)
    assert len(told) == 1
    wanted = {"a": two}
    asked.ask(replace(state, index=5, tab="another"), True, jobs)
    assert engine.calls == [("job", "a", one), ("job", "b", one), ("drop", "b")], "no new question in a drag"
    asked.ask(replace(state, index=5, tab="another"), False, jobs)
    assert engine.calls[-1] == ("job", "a", two)


def test_while_a_source_is_followed_only_what_no_window_changes_is_asked():
    engine, news = Recorder(), []
    asked = VisitorJobs(engine, "ada", news.append)
    pinned = Counting(request(1))
    asked.want({"a": Counting(request(4))})
    for index in (5, 5, 6, 6, 7):
        asked.follow({"a": Counting(request(index)), "pin": pinned}, index)
    assert engine.calls == [("job", "a", Counting(request(4))), ("job", "pin", pinned)]
    asked.follow({"a": Counting(request(8))}, 8)
    assert engine.calls[-1] == ("drop", "pin")


def test_news_of_a_question_that_is_no_longer_asked_is_no_news():
    engine, news = Recorder(), []
    asked = VisitorJobs(engine, "ada", news.append)
    one, two = Counting(request(1)), Counting(request(2))
    asked.want({"a": one})
    engine.tell("a", JobResult(one, 5, 0.5))
    assert asked.take(news[0])
    assert asked.results["a"].value == 5
    asked.want({"a": two})
    assert not asked.take(JobNews("a", JobResult(one, 6, 1.0, True)))
    assert asked.results["a"].value == 5  # the last answer stays until there is a new one


def test_bytes_of_an_answer_are_those_of_its_arrays():
    assert num_bytes({"a": [np.zeros(10, np.float32), (np.zeros(2),)]}) == 40 + 16
    assert num_bytes(JobResult(Counting(request(0)), np.zeros(100, np.uint8))) >= 100


ENDED = threading.Semaphore(0)


@dataclass(frozen=True, slots=True)
class Holding:
    """Holds something until it is not wanted any more."""

    request: FrameRequest

    def run(self, loaded, cancelled):
        try:
            while True:
                yield cancelled(), 0.5
        finally:
            ENDED.release()


@pytest.mark.parametrize("leave", ["drop the slot", "drop the visitor", "ask something else"])
def test_what_a_job_holds_is_let_go_when_nobody_wants_it_and_not_with_the_next_sweep(engine, leave):
    notes = Notes()
    gc.disable()
    try:
        engine.job("ada", "slot", Holding(request(3)), notes)
        notes.wait(lambda reply: reply[1].share == 0.5)
        match leave:
            case "drop the slot":
                engine.drop_job("ada", "slot")
            case "drop the visitor":
                engine.drop("ada")
            case _:
                engine.job("ada", "slot", Counting(request(3)), notes)
        assert ENDED.acquire(timeout=5)
    finally:
        gc.enable()

import gc
import threading
from dataclasses import dataclass

import numpy as np
import pytest

from app.engine import Engine
from app.studies import Finding, num_bytes
from app.studying import Found, Studying
from app.wishes import Wish
from etnet.errors import ModelError

from .fakes import Inbox, Shelf, hold, wish

LOG: list[tuple[str, int]] = []
"""What the studies below did, in order."""


@dataclass(frozen=True, slots=True)
class Counting:
    """Counts to `length`, one encode at a time."""

    wish: Wish
    length: int = 3
    name: str = "counting"
    breaks: bool = False

    def run(self, stage, cancelled):
        for done in range(1, self.length + 1):
            if self.breaks:
                raise ModelError("this cannot be counted")
            stage.playback.model.encode(next(stage.playback.model.parameters()).new_zeros(1, 5, 16, 24))
            LOG.append((self.name, done))
            yield done, done / self.length


class Notes(Inbox):
    """Takes findings."""

    def __call__(self, slot, finding):
        super().__call__((slot, finding))

    def whole(self):
        return self.wait(lambda reply: reply[1].is_whole)[1]

    @property
    def shares(self):
        return [finding.share for _, finding in self.replies]


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
    engine.study("ada", "slot", Counting(wish(3)), notes)
    assert notes.whole().value == 3
    assert notes.shares == pytest.approx([1 / 3, 2 / 3, 1.0])


def test_a_known_answer_comes_at_once_and_is_not_computed_twice(engine):
    notes, again = Notes(), Notes()
    engine.study("ada", "slot", Counting(wish(3)), notes)
    notes.whole()
    engine.study("bob", "slot", Counting(wish(3)), again)
    assert [finding.is_whole for _, finding in again.replies] == [True]
    assert len(LOG) == 3


def test_a_wish_is_granted_between_two_stretches(engine, shelf):
    notes, inbox = Notes(), Inbox()
    engine.request("ada", wish(0), inbox)
    inbox.ready(0)
    gate = hold(shelf.model_instance)
    engine.study("ada", "slot", Counting(wish(0), 50), notes)
    shelf.model_instance.entered.acquire(timeout=10)
    engine.request("ada", wish(1), inbox)
    gate.release(3)  # one stretch, the wish's encode, one stretch more
    inbox.ready(1)
    assert len(LOG) <= 2


def test_a_newer_question_replaces_the_slots_former_one(engine, shelf):
    old, new = Notes(), Notes()
    gate = hold(shelf.model_instance)
    engine.study("ada", "slot", Counting(wish(0), 50, "old"), old)
    shelf.model_instance.entered.acquire(timeout=10)
    engine.study("ada", "slot", Counting(wish(0), 2, "new"), new)
    gate.release(10)
    assert new.whole().value == 2
    assert sum(name == "old" for name, _ in LOG) == 1
    assert old.replies == []


def test_slots_take_turns(engine, shelf):
    gate = hold(shelf.model_instance)
    one, two = Notes(), Notes()
    engine.study("ada", "a", Counting(wish(0), 3, "one"), one)
    engine.study("bob", "b", Counting(wish(0), 3, "two"), two)
    gate.release(100)
    one.whole(), two.whole()
    names = [name for name, _ in LOG]
    assert names[1:4] in (["two", "one", "two"], ["one", "two", "one"])


def test_a_visitor_who_leaves_costs_nothing_more(engine, shelf):
    gate = hold(shelf.model_instance)
    engine.study("ada", "slot", Counting(wish(0), 50), Notes())
    shelf.model_instance.entered.acquire(timeout=10)
    engine.drop("ada")
    gate.release(5)
    inbox = Inbox()
    engine.request("bob", wish(0), inbox)
    inbox.ready(0)
    assert len(LOG) == 1


@pytest.mark.parametrize(("study", "words"), [
    (Counting(wish(3), breaks=True), "cannot be counted"),
    (Counting(wish(999)), "window 999 does not exist"),
    (Counting(wish(0, recording="nowhere")), "no such recording"),
])  # fmt: skip
def test_what_cannot_be_answered_is_said(engine, study, words):
    notes = Notes()
    engine.study("ada", "slot", study, notes)
    _, finding = notes.wait(lambda reply: reply[1].trouble)
    assert words in finding.trouble
    assert not finding.is_whole


class Recorder:
    def __init__(self):
        self.calls = []

    def study(self, visitor, slot, study, tell):
        self.calls.append(("study", slot, study))
        self.tell = tell

    def drop_study(self, visitor, slot):
        self.calls.append(("drop", slot))


def test_only_what_changed_is_asked():
    engine, letters = Recorder(), []
    studying = Studying(engine, "ada", letters.append)
    one, two = Counting(wish(1)), Counting(wish(2))
    studying.want({"a": one})
    studying.want({"a": one})
    studying.want({"a": two})
    studying.want({})
    assert engine.calls == [("study", "a", one), ("study", "a", two), ("drop", "a")]


def test_news_of_a_question_that_is_no_longer_asked_is_no_news():
    engine, letters = Recorder(), []
    studying = Studying(engine, "ada", letters.append)
    one, two = Counting(wish(1)), Counting(wish(2))
    studying.want({"a": one})
    engine.tell("a", Finding(one, 5, 0.5))
    assert studying.take(letters[0])
    assert studying.findings["a"].value == 5
    studying.want({"a": two})
    assert not studying.take(Found("a", Finding(one, 6, 1.0, True)))
    assert studying.findings["a"].value == 5  # the last answer stays until there is a new one


def test_bytes_of_an_answer_are_those_of_its_arrays():
    assert num_bytes({"a": [np.zeros(10, np.float32), (np.zeros(2),)]}) == 40 + 16
    assert num_bytes(Finding(Counting(wish(0)), np.zeros(100, np.uint8))) >= 100


ENDED = threading.Semaphore(0)


@dataclass(frozen=True, slots=True)
class Holding:
    """Holds something until it is not wanted any more."""

    wish: Wish

    def run(self, stage, cancelled):
        try:
            while True:
                yield cancelled(), 0.5
        finally:
            ENDED.release()


@pytest.mark.parametrize("leave", ["drop the slot", "drop the visitor", "ask something else"])
def test_what_a_study_holds_is_let_go_when_nobody_wants_it_and_not_with_the_next_sweep(engine, leave):
    notes = Notes()
    gc.disable()
    try:
        engine.study("ada", "slot", Holding(wish(3)), notes)
        notes.wait(lambda reply: reply[1].share == 0.5)
        match leave:
            case "drop the slot":
                engine.drop_study("ada", "slot")
            case "drop the visitor":
                engine.drop("ada")
            case _:
                engine.study("ada", "slot", Counting(wish(3)), notes)
        assert ENDED.acquire(timeout=5)
    finally:
        gc.enable()

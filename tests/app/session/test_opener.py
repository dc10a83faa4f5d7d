"""Plans that are passed over while a recording opens cost no thread and no work."""

import threading

from app.engine.denoised import CleanedRecordings
from app.session.loader import Opened, Opener, Plan, Unopened
from etnet.errors import RecordingError
from etnet.windows import ByCount
from tests.app.catalogue.test_videos import until
from tests.app.stand_ins import recording

WHOLE = recording()


class Slow:
    """A catalogue whose recordings open when they are let."""

    def __init__(self):
        self.asked, self.let, self.fails = [], {"a": threading.Event(), "c": threading.Event()}, 0

    def open(self, recording_id, progress):
        self.asked.append(recording_id)
        assert self.let[recording_id].wait(60)
        if self.fails:
            self.fails -= 1
            raise RecordingError("it failed")
        return WHOLE


def opener_of(catalogue):
    told = []
    return Opener(catalogue, CleanedRecordings(), told.append), told


def test_many_plans_for_a_recording_that_is_being_opened_are_one_thread_and_the_last_is_answered():
    catalogue = Slow()
    opener, told = opener_of(catalogue)
    opener.want(Plan("a", ByCount(99)))
    until(lambda: catalogue.asked)
    for count in range(100, 130):
        opener.want(Plan("a", ByCount(count)))
    assert sum(thread.name == "opening" for thread in threading.enumerate()) == 1
    catalogue.let["a"].set()
    until(lambda: told and not opener._at_work)
    assert [(type(letter), letter.plan) for letter in told] == [(Opened, Plan("a", ByCount(129)))]
    assert len(catalogue.asked) == 2


def test_to_and_fro_between_two_that_open_is_a_thread_for_each_and_one_answer():
    catalogue = Slow()
    opener, told = opener_of(catalogue)
    one, other = Plan("a", ByCount(100)), Plan("c", ByCount(100))
    for _ in range(10):
        opener.want(other)
        opener.want(one)
    until(lambda: len(catalogue.asked) == 2)
    catalogue.let["c"].set()
    until(lambda: opener._at_work == {"a"})
    assert told == []
    catalogue.let["a"].set()
    until(lambda: not opener._at_work)
    assert [letter.plan for letter in told] == [one]
    opener.heard(one)
    opener.want(other)  # what was passed over is opened when it is asked for again
    until(lambda: not opener._at_work)
    assert [letter.plan for letter in told] == [one, other]


def test_a_failure_is_told_once_and_not_where_the_same_is_tried_again():
    catalogue = Slow()
    opener, told = opener_of(catalogue)
    one, other = Plan("a", ByCount(100)), Plan("c", ByCount(100))
    catalogue.fails = 1
    opener.want(one)
    until(lambda: catalogue.asked)
    opener.want(other)
    opener.want(one)
    catalogue.let["a"].set()
    until(lambda: opener._at_work == {"c"})
    assert [type(letter) for letter in told] == [Opened]
    catalogue.fails = 1
    opener.heard(one)
    opener.want(one)
    until(lambda: opener._at_work == {"c"})
    assert [type(letter) for letter in told] == [Opened, Unopened]
    catalogue.let["c"].set()
    until(lambda: not opener._at_work)

"""Jobs about all of a recording that is still being made: they see what there is when they begin."""

from dataclasses import dataclass, replace
from typing import ClassVar

import pytest

from app.engine.engine import Engine
from app.engine.requests import FrameRequest
from etnet.events.recording import recording_of_events
from etnet.windows import ByCount
from tests.app.fakes import Inbox, Notes, Shelf, recording_of, request

WHOLE = recording_of(40)


class Growing:
    """Of `WHOLE` as many windows are there as a test says; it is one more until nothing can change the last one."""

    def __init__(self, num_windows):
        self.grow(num_windows)

    def grow(self, num_windows):
        events = WHOLE.read(0, 50 * num_windows)
        made = recording_of_events(events, "growing")
        self.recording = made if num_windows == 40 else replace(made, latest=lambda: self.recording)


@dataclass(frozen=True, slots=True)
class HowMany:
    """How many windows a job is given, and how many another run beside it has."""

    is_ordered: ClassVar[bool] = False
    request: FrameRequest

    def run(self, loaded, cancelled):
        beside = loaded.beside(replace(self.request, policy=ByCount(100)))
        yield (len(loaded.windows), len(beside.windows)), 1.0


@dataclass(frozen=True, slots=True)
class Ordered(HowMany):
    is_ordered: ClassVar[bool] = True


@pytest.fixture
def growing():
    return Growing(10)


@pytest.fixture
def engine(growing):
    shelf = Shelf()
    shelf.recordings["r"] = growing.recording
    made = Engine(shelf, 64 << 20, threads=1, load=shelf.load, prefetches=False)
    yield made
    made.stop()


def answer(engine, job):
    notes = Notes()
    engine.job("ada", "slot", job, notes)
    return notes.whole().value


def test_a_job_sees_all_windows_that_there_are_though_it_is_asked_at_the_first_one(engine, growing):
    inbox = Inbox()
    engine.request("ada", request(0), inbox)
    inbox.ready(0)
    assert answer(engine, HowMany(request(0))) == (10, 5)
    growing.grow(30)
    assert answer(engine, HowMany(request(1))) == (30, 15)


def test_a_file_of_a_part_is_made_anew_when_it_is_ordered_again_and_one_of_the_whole_is_kept(engine, growing):
    assert answer(engine, Ordered(request(0))) == (10, 5)
    growing.grow(20)
    assert answer(engine, Ordered(request(0))) == (20, 10)
    growing.grow(40)
    assert answer(engine, Ordered(request(0))) == (40, 20)
    assert engine._jobs._kept.nbytes > 0

"""Cleaned recordings are made once for all, and nobody waits for another's."""

import threading

import pytest

from app.engine import denoised
from app.engine.denoised import CleanedRecordings
from etnet.errors import RecordingError
from etnet.events.denoise import Cleaning
from tests.app.fakes import recording_of

CLEANING = Cleaning(support_within=5_000)
PATIENCE = 20


class Pass:
    """Stands for the pass over one recording's events, which takes as long as a test likes; others' take no time."""

    def __init__(self, slow):
        self.slow, self.made = slow, []
        self.begun, self.may_end = threading.Event(), threading.Event()

    def __call__(self, recording, cleaning):
        self.made.append(recording)
        if recording is self.slow:
            self.begun.set()
            assert self.may_end.wait(PATIENCE)
        return f"{recording.name}, cleaned"


@pytest.fixture
def slow(monkeypatch):
    one = Pass(recording_of(2))
    monkeypatch.setattr(denoised, "cleaned", one)
    yield one
    one.may_end.set()


def asked(shared, recording, num=1):
    """As many threads that ask, and what they are given."""
    given = []
    threads = [
        threading.Thread(target=lambda: given.append(shared.of(recording, CLEANING)), daemon=True) for _ in range(num)
    ]
    for thread in threads:
        thread.start()
    return threads, given


def test_who_wants_another_recording_does_not_wait_for_the_one_that_is_being_made(slow):
    shared, other = CleanedRecordings(), recording_of(2, seed=1)
    (first,), given = asked(shared, slow.slow)
    assert slow.begun.wait(PATIENCE)
    (second,), others = asked(shared, other)
    second.join(PATIENCE)
    assert others == ["recording 1, cleaned"]
    assert given == []
    slow.may_end.set()
    first.join(PATIENCE)
    assert given == ["recording 0, cleaned"]


def test_one_that_several_ask_for_at_once_is_made_once(slow):
    shared = CleanedRecordings()
    threads, given = asked(shared, slow.slow, 4)
    assert slow.begun.wait(PATIENCE)
    slow.may_end.set()
    for thread in threads:
        thread.join(PATIENCE)
    assert len(given) == 4
    assert slow.made == [slow.slow]


def test_what_is_forgotten_while_it_is_made_is_not_kept(slow):
    shared = CleanedRecordings()
    (thread,), given = asked(shared, slow.slow)
    assert slow.begun.wait(PATIENCE)
    shared.forget(slow.slow)
    slow.may_end.set()
    thread.join(PATIENCE)
    assert len(given) == 1
    assert (shared._made, shared._making) == ({}, {})


def test_of_what_cannot_be_cleaned_nothing_is_held(monkeypatch):
    def fails(recording, cleaning):
        raise RecordingError("no event is left after cleaning")

    monkeypatch.setattr(denoised, "cleaned", fails)
    shared = CleanedRecordings()
    with pytest.raises(RecordingError, match="no event is left"):
        shared.of(recording_of(2), CLEANING)
    assert (shared._made, shared._making) == ({}, {})


def test_the_newest_few_are_held(monkeypatch):
    made = []
    monkeypatch.setattr(denoised, "cleaned", lambda recording, cleaning: made.append(recording) or "cleaned")
    shared, recordings = CleanedRecordings(), [recording_of(2, seed=seed) for seed in range(denoised.KEPT + 1)]
    for recording in (*recordings, *recordings[1:], recordings[0]):
        shared.of(recording, CLEANING)
    assert made == [*recordings, recordings[0]]

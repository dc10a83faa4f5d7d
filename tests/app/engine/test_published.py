"""Frames that were given lately are at hand for everybody, within a budget, and never dearer than they were."""

from dataclasses import replace

import numpy as np

from app.engine.engine import Engine
from app.engine.published import RecentFrames
from tests.app.conftest import BUDGET
from tests.app.fakes import Inbox, Shelf, hold, request


def _given(index, is_approximate=False):
    shelf, inbox = Shelf(), Inbox()
    engine = Engine(shelf, BUDGET, threads=1, load=shelf.load, prefetches=False)
    try:
        engine.request("ada", request(index), inbox)
        return replace(inbox.ready(index), is_approximate=is_approximate)
    finally:
        engine.stop()


def test_a_frame_that_was_given_is_given_again_while_the_model_is_busy():
    shelf, first, again = Shelf(), Inbox(), Inbox()
    engine = Engine(shelf, BUDGET, threads=1, load=shelf.load, prefetches=False)
    engine.request("ada", request(5), first)
    given = first.ready(5)
    gate = hold(shelf.model_instance)
    engine.request("bob", request(20), Inbox())
    engine.request("ada", request(5), again)
    reply = again.replies[0]
    assert np.array_equal(reply.frame, given.frame)
    assert reply.is_exact
    assert len(again.replies) == 1
    gate.release(10_000)
    engine.stop()


def test_the_oldest_go_when_there_is_no_room():
    replies = [_given(index) for index in (1, 2, 3)]
    recent = RecentFrames(largest=2 * replies[0].frame.nbytes)
    for reply in replies:
        recent.keep(reply)
    assert recent.find(request(1)) is None
    assert recent.find(request(2)) is not None
    assert recent.find(request(3)) is not None


def test_a_preview_is_never_kept_as_a_frame():
    recent = RecentFrames()
    recent.keep(_given(4, is_approximate=True))
    assert recent.find(request(4)) is None

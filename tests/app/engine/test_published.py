"""Frames that were given lately are at hand for everybody, within a budget, and never dearer than they were."""

from dataclasses import replace

import numpy as np
import pytest

from app.engine.engine import Engine
from app.engine.published import RecentFrames
from etnet.events.edit import EventEdit
from etnet.nets.intervention import Intervention
from tests.app.conftest import BUDGET
from tests.app.fakes import Inbox, Shelf, hold, request

CHANGES = ({"intervention": Intervention(uniform_attention=True)}, {"edit": EventEdit(invert=0.5), "since": 2})


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


@pytest.mark.parametrize("change", CHANGES, ids=["in the decoding", "in the memory"])
def test_what_one_visitor_changes_leaves_the_others_frames_exact_and_their_requests_leave_the_changed_ones_inexact(
    change,
):
    shelf, ada, bob = Shelf(), Inbox(), Inbox()
    engine = Engine(shelf, BUDGET, threads=1, load=shelf.load, prefetches=False)
    try:
        for index in (2, 6):  # what was told last is once one visitor's doing, once the other's
            engine.request("bob", request(index), bob)
            bob.ready(index)
            assert (engine.cached(request(0)).is_exact, engine.cached(request(0, **change)).is_exact) == (True, False)
            engine.request("ada", request(index + 1, **change), ada)
            assert not ada.ready(index + 1).is_exact
            assert (engine.cached(request(0)).is_exact, engine.cached(request(0, **change)).is_exact) == (True, False)
    finally:
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

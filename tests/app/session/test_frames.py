"""Replies come late, out of order and for requests that were given up: what is on show is never older or worse."""

from dataclasses import replace

import numpy as np

from app.engine.requests import Failed, FrameRequest, Ready, Working
from app.session.frames import NewestFrames
from app.state.view_state import ViewState
from etnet.events.cleaning import Cleaning
from etnet.windows import ByCount
from tests.app.stand_ins import CONTRACT

REQUEST = FrameRequest("a", "m", "fp32", ByCount(9), 5)


def ready(request, is_approximate=False):
    frame = np.zeros((2, 2), np.float32)
    return Ready(request, frame, None, 1.0, not is_approximate, is_approximate, False, CONTRACT, 5)


def test_a_preview_never_replaces_the_exact_frame_of_its_window():
    answers = NewestFrames()
    answers.ask(REQUEST)
    exact = ready(REQUEST)
    assert answers.take(exact)
    assert not answers.take(ready(REQUEST, is_approximate=True))
    assert answers.ready is exact
    assert answers.index == 5


def test_a_preview_is_shown_but_is_no_finished_picture():
    answers = NewestFrames()
    answers.ask(REQUEST)
    answers.take(ready(REQUEST, is_approximate=True))
    assert answers.ready is not None
    assert answers.index is None


def test_with_a_pixel_chosen_the_picture_alone_is_not_all_that_is_awaited():
    answers, state = NewestFrames(), ViewState("a", "m", index=5)
    answers.ask(REQUEST)
    assert not answers.shows(state)
    answers.take(ready(REQUEST))
    assert answers.shows(state)
    chosen, asked = replace(state, query=(1, 1)), replace(REQUEST, wants_attention=True)
    assert not answers.shows(chosen)
    answers.ask(asked)
    answers.take(ready(asked, is_approximate=True))
    assert not answers.shows(chosen)
    answers.take(ready(asked))  # of a network without attention: there is none to wait for
    assert answers.shows(chosen)
    assert not answers.shows(replace(chosen, index=6))


def test_work_and_failure_of_a_request_given_up_are_no_news():
    answers = NewestFrames()
    answers.ask(REQUEST)
    answers.ask(replace(REQUEST, index=6))
    assert not answers.take(Working(REQUEST, 1, 2, "replaying"))
    assert not answers.take(Failed(REQUEST, "no"))
    assert answers.take(Failed(replace(REQUEST, index=6), "no"))


def test_another_recordings_picture_is_never_shown():
    answers = NewestFrames()
    answers.ask(REQUEST)
    answers.take(ready(REQUEST))
    answers.ask(replace(REQUEST, recording_id="b"))
    assert answers.ready is None
    assert not answers.take(ready(REQUEST))


def test_the_same_request_is_asked_once():
    answers = NewestFrames()
    assert answers.ask(REQUEST)
    assert not answers.ask(REQUEST)
    assert answers.ask(replace(REQUEST, wants_attention=True))


def test_the_badge_belongs_to_the_picture_when_filter_windows_or_network_change():
    answers = NewestFrames()
    first = FrameRequest("a", "m", "fp32", ByCount(100), 5)
    answers.ask(first)
    answers.take(ready(first))
    assert answers.ready.is_exact
    answers.ask(replace(first, cleaning=Cleaning(True)))
    assert answers.ready.is_former
    assert not answers.ready.is_exact
    answers.take(ready(replace(first, cleaning=Cleaning(True))))
    assert not answers.ready.is_former


def test_a_reply_on_its_way_never_replaces_what_was_at_hand_for_a_newer_request():
    answers, newer = NewestFrames(), replace(REQUEST, index=1)
    answers.ask(REQUEST)  # its reply is under way
    answers.ask(newer)
    at_hand = ready(newer)
    answers.take(at_hand)
    assert not answers.take(ready(REQUEST))
    assert not answers.take(ready(REQUEST, is_approximate=True))
    assert answers.ready is at_hand
    answers.ask(replace(REQUEST, index=7))  # a visitor who goes on is shown what comes meanwhile
    assert answers.take(ready(REQUEST))


def test_a_late_reply_without_attention_does_not_take_away_the_attention_that_is_there():
    answers, asked = NewestFrames(), replace(REQUEST, wants_attention=True)
    answers.ask(asked)
    with_attention = replace(ready(asked), attention=object())
    answers.take(with_attention)
    assert not answers.take(ready(REQUEST))
    assert answers.ready is with_attention
    answers.ask(REQUEST)  # nobody looks at the maps any more
    answers.take(Working(REQUEST, 1, 2, "replaying"))
    assert answers.take(ready(REQUEST))
    assert answers.ready is with_attention
    assert answers.working is None

"""Where a page returns to when a recording cannot be opened."""

from dataclasses import replace

import pytest

from app.session import standing
from app.session.standing import SAID_FOR, SETTLED, Standing
from app.state.view_state import ViewState


@pytest.fixture
def clock(monkeypatch):
    now = [100.0]
    monkeypatch.setattr(standing.time, "monotonic", lambda: now[0])
    return now


OPEN = ViewState(recording_id="open", model_id="m")
ASKED = replace(OPEN, recording_id="broken", workspace="recording")


def test_a_refused_recording_is_known_until_another_one_is_open_and_its_reason_is_said_for_a_while(clock):
    page = Standing()
    page.note(OPEN)
    before = page.returned(ASKED, "open", "it has no events")
    assert (before.recording_id, before.workspace) == ("open", "recording")
    page.note(before)
    assert (page.refused.recording_id, page.refused.why) == ("broken", "it has no events")
    clock[0] += SAID_FOR + 1
    assert (page.refused.recording_id, page.refused.why) == ("broken", "")
    page.note(replace(OPEN, recording_id="another"))
    assert page.refused.recording_id == ""


def test_a_page_that_returned_is_drawn_once_more_when_no_hand_is_on_it_and_once_when_it_is_silent(clock):
    page = Standing()
    page.note(OPEN)
    page.returned(ASKED, "open", "no")
    due = []
    for _ in range(400):
        clock[0] += 0.1
        if page.is_due(clock[0]):
            due.append(clock[0] - 100.0)
    assert due == [pytest.approx(SETTLED, abs=0.11), pytest.approx(SAID_FOR, abs=0.11)]

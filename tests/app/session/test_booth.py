"""What a visitor has beside the page: a mirror, a page to take home, and how long they are waited for."""

from dataclasses import replace
from types import SimpleNamespace

import pytest

from app.engine.downloads import Download
from app.engine.jobs import JobResult
from app.session import booth as booths
from app.session.booth import Booth, MirrorNews
from app.session.demo import public_view
from app.session.jobs import JobNews
from app.state import intents as ask
from app.state.view_state import Limits, ViewState
from app.views.demo.state import HOME_SLOT, DemoState, HomeFailed, OpenSheet, TakeHome
from etnet.events.events import Sensor
from etnet.windows import BetweenFrames, Window
from tests.app.reducing import reduce

OPEN = Limits(Sensor(40, 30), [Window(i, i * 10, i * 10 + 10, i * 1000, i * 1000 + 1000) for i in range(30)])
STATE = replace(public_view(ViewState(recording_id="a", model_id="m")), policy=BetweenFrames())


def mirror(recording_id="mirror-1", trouble=""):
    return SimpleNamespace(ticket="t", recording_id=recording_id, trouble=trouble, ordered="", advance=lambda: None)


def reduced(state, *intents):
    for intent in intents:
        state = reduce(state, intent, OPEN)
    return state


def asked(booth, state, intent):
    """The page after what a visitor asks and what follows from it."""
    after = reduced(state, intent)
    return reduced(after, *booth.goes_on(intent, state.is_playing, after))


@pytest.mark.parametrize("intent", [ask.Query(3, 4), ask.QueryFraction(0.5, 0.5), TakeHome()])
def test_in_the_mirror_the_world_goes_on_under_a_touch_and_while_a_page_is_made(intent):
    booth, live = Booth(mirror()), replace(STATE, recording_id="mirror-1", is_playing=True)
    assert asked(booth, live, intent).is_playing
    assert not asked(booth, replace(live, recording_id="a"), intent).is_playing
    assert not asked(booth, replace(live, is_playing=False), intent).is_playing


def test_a_scene_that_a_visitor_opens_plays():
    for is_playing in (False, True):
        for recording_id in ("a", "b"):
            state = replace(STATE, is_playing=is_playing)
            assert asked(Booth(), state, ask.OpenRecording(recording_id)).is_playing
            assert reduced(state, *Booth().opened(recording_id, state)).is_playing
    assert not asked(Booth(), replace(STATE, is_public=False), ask.OpenRecording("b")).is_playing


def test_when_the_camera_ends_the_show_plays_on_and_what_was_ordered_of_it_is_made():
    seen = mirror()
    booth = Booth(seen)
    live = reduced(STATE, *booth.heard(MirrorNews("mirror-1"), "a"))
    assert (live.recording_id, live.is_playing) == ("mirror-1", True)
    ordered = asked(booth, replace(live, policy=BetweenFrames()), TakeHome())
    booth.advance(ordered, None)
    assert seen.ordered == "mirror-1"
    after = reduced(ordered, *booth.heard(MirrorNews(""), "a"))
    assert (after.recording_id, after.is_playing, after.of(DemoState).sheet) == ("a", True, "home")
    booth.advance(after, None)
    assert seen.ordered == "mirror-1"
    booth.advance(reduced(after, OpenSheet("")), None)
    assert seen.ordered == ""


def test_a_booth_looks_after_its_mirror_until_what_was_ordered_of_it_is_made():
    seen = mirror(recording_id="")
    booth, state = Booth(seen), reduced(replace(STATE, recording_id="mirror-1"), TakeHome())
    assert not booth.is_active
    seen.recording_id = "mirror-1"
    booth.advance(state, None)
    seen.recording_id = ""  # the camera has ended
    assert booth.is_active
    booth.advance(STATE, None)  # the page is made
    assert seen.ordered == ""
    assert not booth.is_active


def test_who_waits_for_their_page_has_not_gone_but_is_not_waited_for_for_ever(monkeypatch):
    booth, ordered = Booth(), reduced(STATE, TakeHome())
    assert not booth.waits(STATE)
    assert booth.waits(ordered)
    monkeypatch.setattr(booths, "WAITS", 0.0)
    assert not booth.waits(ordered)
    monkeypatch.undo()
    assert booth.waits(reduced(ordered, TakeHome())), "a new order is waited for anew"


def test_a_page_that_cannot_be_made_is_told():
    told = JobNews(HOME_SLOT, JobResult(None, trouble="the disk is full"))
    assert Booth().kept(told) == (HomeFailed("the disk is full"),)
    other = JobNews("export.file", JobResult(None, Download("a.csv", b"1"), 1.0, is_whole=True))
    assert Booth().kept(other) is None

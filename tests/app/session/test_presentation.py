"""One page leads, the others show its moment with pointers of their own."""

import asyncio
from dataclasses import replace

import pytest

from app.catalogue.cut import with_cut
from app.catalogue.recordings import CatalogueError
from app.engine.denoised import CleanedRecordings
from app.session import presentation
from app.session.loader import Opened, Plan, RecordingLoader
from app.session.presentation import RELOADS_WITHIN, Presentation
from app.state.intents import FollowNewest
from app.state.view_state import ViewState
from etnet.live.buffer import Extent
from etnet.windows import BetweenFrames, ByCount, plan_windows
from tests.app.stand_ins import Browser, Shelf, recording, served

STATE = ViewState(recording_id="a", model_id="m", policy=ByCount(100))


def opens(recording_id):
    if recording_id == "private":
        raise CatalogueError("it is another visitor's")


@pytest.fixture
def room():
    return Presentation()


def test_a_follower_has_the_leaders_moment_and_keeps_its_own_pointer_and_workspace(room):
    leader, follower = room.join(False, opens), room.join(False, opens)
    leader.show(replace(STATE, index=7, query=(1, 2), workspace="compare"))
    own = replace(STATE, index=3, query=(9, 9), workspace="attention", is_playing=True)
    shown = follower.following(own)
    assert (shown.index, shown.query, shown.workspace, shown.is_playing) == (7, (9, 9), "attention", False)
    follower.show(own)
    assert leader.following(leader.following(STATE)) is STATE
    assert (leader.words, follower.words) == ("Presenting to 1 page", "Following the presenter")


def test_of_a_live_source_followers_stay_in_the_past_while_the_presenter_does(room):
    leader, told = room.join(False, opens), []
    follower = room.join(False, opens, told.append)
    leader.show(replace(STATE, index=7))
    assert follower.following(STATE).follows_newest
    told.clear()
    leader.show(replace(STATE, index=7, follows_newest=False))
    assert len(told) == 1, "stopping is a move, though the window stays"
    shown = follower.following(replace(STATE, index=7))
    assert (shown.index, shown.follows_newest) == (7, False)
    held = RecordingLoader(Shelf(), CleanedRecordings(), print)
    policy, extent = ByCount(100), lambda: Extent(6000, 0, 0, 300_000, 0, 300_000, range(0))
    windows = plan_windows(recording(), policy)
    longer = with_cut(recording(), policy, windows, extent)
    cut = with_cut(recording(), policy, windows[:8], extent, lambda: longer)
    for state, follows in ((STATE, FollowNewest()), (shown, None)):
        held._opened = Opened(Plan("a", policy), policy, cut, windows[:8])
        assert held.grow(state) == (True, follows)
    leader.show(replace(STATE, index=9))
    assert follower.following(shown).follows_newest


def test_what_a_follower_may_not_open_leaves_it_where_it_is(room):
    leader, follower = room.join(False, opens), room.join(False, opens)
    leader.show(replace(STATE, recording_id="private"))
    assert follower.following(STATE) is STATE


def test_a_page_at_the_viewers_own_machine_leads_and_the_lead_outlives_a_reload(room, monkeypatch):
    clock = [0.0]
    monkeypatch.setattr(presentation.time, "monotonic", lambda: clock[0])
    guest, host = room.join(False, opens), room.join(True, opens)
    assert room.leads(host)
    assert not room.leads(guest)
    host.leave()
    assert not room.leads(guest)
    host = room.join(True, opens)
    assert room.leads(host)
    host.leave()
    clock[0] = RELOADS_WITHIN + 1
    assert room.leads(guest)


def test_every_page_is_told_when_the_lead_of_a_page_that_left_goes_to_another(room, monkeypatch):
    clock, told = [0.0], []
    monkeypatch.setattr(presentation.time, "monotonic", lambda: clock[0])
    leader, follower = room.join(False, opens), room.join(False, opens, told.append)
    leader.leave()
    told.clear()
    assert not room.leads(follower)
    assert told == []
    clock[0] = RELOADS_WITHIN + 1
    assert room.leads(follower)
    assert room.leads(follower)
    assert len(told) == 1


def test_a_visitors_page_goes_where_the_presenter_goes():
    async def story(port):
        async with Browser.open(port, tab=1) as leader, Browser.open(port, tab=2) as follower:
            for browser in (leader, follower):
                await browser.until_shown("Reconstruction of window 0", patience=60.0)
            await leader.use(leader.widget("Window"), 25)
            await follower.until_shown("window 25 of 0 – 29", patience=60.0)
            await follower.use(follower.widget("Window"), 3)
            await leader.use(leader.widget("Window"), 12)
            await follower.until_shown("window 12 of 0 – 29", patience=60.0)
            assert "Following the presenter" in follower.words()
            assert "Presenting to 1 page" in leader.words()

    with served(presentation=Presentation()) as viewer:
        asyncio.run(story(viewer.port))


def test_a_window_that_a_follower_has_not_yet_is_waited_for_at_its_last_one():
    room = Presentation()
    presenter = room.join(True, opens)
    led = ViewState(recording_id="a", model_id="m", precision="fp32", policy=BetweenFrames())

    async def story(port):
        async with Browser.open(port, tab=1) as follower:
            await follower.until_shown("Reconstruction of window 0", patience=60.0)
            presenter.show(replace(led, index=40))
            await follower.until_shown("window 29 of 0 – 29", patience=60.0)
            presenter.show(replace(led, index=4))
            await follower.until_shown("window 4 of 0 – 29", patience=60.0)
            assert follower.notices == []

    with served(presentation=room) as viewer:
        asyncio.run(story(viewer.port))


def test_of_a_window_that_is_not_there_nothing_is_said_to_have_left():
    opened, policy = recording(), BetweenFrames()
    windows = plan_windows(opened, policy)
    held = RecordingLoader(Shelf(), CleanedRecordings(), print)
    cut = with_cut(opened, policy, windows, extent=lambda: Extent(6000, 0, 0, 300_000, 0, 300_000, range(0)))
    held._opened = Opened(Plan("a", policy), policy, cut, windows)
    beyond = replace(STATE, policy=policy, index=40)
    assert not held.has_left(beyond)
    assert held.within(beyond).index == 29
    assert held.within(replace(beyond, policy=ByCount(3))).index == 40, "another plan's windows are not counted"

"""The demo that leads itself, and what a visitor may do in it: the pure parts, and visits by a websocket."""

import asyncio
from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from app.catalogue.homes import Homes
from app.config import ConfigError, ViewerConfig
from app.engine.downloads import Download, Downloaded
from app.engine.jobs import JobResult
from app.engine.requests import FrameRequest
from app.session import demo
from app.session.booth import Booth
from app.session.commands import PUBLIC_COMMANDS
from app.session.demo import (
    BURST,
    IDLE,
    MOST_MESSAGES,
    STALLED,
    DemoScript,
    Throttle,
    intents_of,
    may_ask,
    public_moment,
    public_view,
    steps_of,
)
from app.session.jobs import JobNews
from app.state import intents as ask
from app.state.link import to_link
from app.state.view_state import Limits, ViewState
from app.views import VIEWS
from app.views.demo.state import HOME_SLOT, DemoState, HomeReady, PointAt
from app.views.export.state import StartExport
from app.views.inspect.state import Switch
from etnet.events.cleaning import Cleaning
from etnet.events.events import Sensor
from etnet.windows import BetweenFrames, ByCount, ByDuration, Window
from tests.app.reducing import from_link, reduce
from tests.app.stand_ins import Browser, served

INVITED = 'data-testid="invitation"'
OPEN = Limits(Sensor(40, 30), [Window(i, i * 10, i * 10 + 10, i * 1000, i * 1000 + 1000) for i in range(30)])


# ---- the show ----


def test_the_show_runs_through_all_acts_of_all_recordings_and_begins_again():
    show, now, seen = DemoScript(["a", "b"]), 0.0, []
    for _ in range(2 * len(steps_of("a")) + 1):
        beat = show.due(True, now)
        seen.append((beat.recording_id, beat.act))
        assert show.due(True, now + beat.seconds * 0.9) is None
        now += beat.seconds + 1e-6
    assert [name for name, _ in seen if name] == ["a", "b", "a"]
    assert list(dict.fromkeys(act for _, act in seen)) == ["events", "image", "places", "invite"]


def test_a_beat_counts_from_when_there_is_something_to_see_but_not_for_ever():
    show = DemoScript(["a"])
    first = show.due(False, 0.0)
    assert show.due(False, 15.0) is None
    assert show.due(True, 15.0 + first.seconds * 0.9) is None
    assert show.due(True, 15.0 + first.seconds).act == "image"
    broken = DemoScript(["a"])
    broken.due(False, 0.0)
    assert broken.due(False, STALLED + first.seconds + 1).act == "image"


def test_a_touch_ends_the_show_and_idleness_starts_it_from_its_first_recording():
    show = DemoScript(["a", "b"])
    show.due(True, 0.0)
    assert show.touch(1.0)
    assert not show.touch(50.0)
    assert show.due(True, 50.0 + IDLE - 0.1) is None
    beat = show.due(True, 50.0 + IDLE)
    assert (beat.recording_id, beat.act) == ("a", "events")
    assert show.is_leading


@given(st.lists(st.floats(0, 5), max_size=2000))
def test_no_visitor_gets_more_messages_through_than_the_bucket_holds(waits):
    throttle, now, passed = Throttle(0.0), 0.0, 0
    for wait in waits:
        now += wait
        passed += throttle.takes(now)
    assert passed <= BURST + MOST_MESSAGES * now + 1


def test_beats_ask_only_for_what_changes():
    playing = replace(public_view(ViewState()), is_playing=True)
    assert intents_of(steps_of("a")[0], playing) == (PointAt("events"),)
    last = intents_of(steps_of("a")[-2], playing)
    assert last[:2] == (PointAt("places"), ask.TogglePlay())
    state = playing
    for intent in last:
        state = reduce(state, intent, OPEN)
    assert not state.is_playing
    assert state.query is not None


def test_pointing_is_of_the_demo_alone():
    assert reduce(ViewState(), PointAt("image"), OPEN) == ViewState()


def test_in_public_a_visitor_may_ask_of_public_views_and_of_the_page_what_costs_others_nothing():
    policy = ByCount(5)
    refused = (
        ask.ChooseModel("m"), ask.ChoosePrecision("bf16"), ask.ChoosePolicy(policy), ask.ReopenRecording("a~1"),
        StartExport("mp4"), Switch("tpa"), ask.Set("compare", "replays", True), ask.Set("nothing", "x", 1),
        ask.ChooseCleaning(Cleaning(hot_pixels=True)), ask.OpenRecording("a!bin2"), ask.ShowWorkspace("inspect"),
        ask.OpenTab("export"), ask.StageCard("scene"),
    )  # fmt: skip
    allowed = (ask.Seek(3), ask.TogglePlay(), ask.Query(1, 2), ask.OpenRecording("b"), ask.Set("attention", "head", 1))
    assert not any(may_ask(intent, VIEWS) for intent in refused)
    assert all(may_ask(intent, VIEWS) for intent in allowed)


def test_in_public_a_link_opens_its_recording_its_moment_and_its_pixel_and_nothing_else():
    public = public_view(ViewState(recording_id="a", model_id="m"))
    linked = ViewState(recording_id="b!bin2", model_id="n", precision="bf16", policy=ByDuration(1), query=(3, 4))
    linked = replace(linked, workspace="inspect", tab="export", cleaning=Cleaning(hot_pixels=True), moment=70_000)
    shown = public_moment(linked, public)
    assert shown == replace(public, recording_id="b", moment=70_000, query=(3, 4)).put(DemoState(large="map"))


def test_a_demo_offers_no_folder(tmp_path):
    with pytest.raises(ConfigError, match="leave --data out"):
        ViewerConfig(demo=True, data=tmp_path)


# ---- visits ----


def run(story, aspect=1.6, **options):
    async def visit():
        with served(**options) as viewer:
            async with Browser.open(viewer.port, tab=9, aspect=aspect) as browser:
                await story(viewer, browser)

    asyncio.run(visit())


def newest(viewer):
    return viewer.engine.requests[-1][1] if viewer.engine.requests else FrameRequest("", "", "fp32", ByCount(1), 0)


def test_a_linked_moment_is_shown_paused_and_an_unknown_one_is_refused_kindly():
    async def story(viewer, browser):
        await browser.until_shown("window 0 of 0 – 29")
        moment = ViewState(recording_id="b", model_id="m", precision="fp32", policy=ByDuration(10_000), query=(3, 4))
        channel = browser.widget("channel")
        await browser.use(channel, f"link|{to_link(moment, 70_000)}|1")
        await browser.until_shown("Reconstruction of window 6")
        assert viewer.engine.requests[-1][1].recording_id == "b"
        assert viewer.engine.requests[-1][1].wants_attention
        await browser.use(channel, f"link|{to_link(replace(moment, policy=ByDuration(5_000)), 70_000)}|2")
        await browser.until_shown("every 5.0 ms")
        assert browser.notices == []
        await browser.use(channel, f"link|{to_link(replace(moment, recording_id='gone'), 5)}|3")
        await browser.until(lambda: browser.notices != [])
        assert "not among those that can be opened here" in browser.notices[0]["body"]
        assert "every 5.0 ms" in browser.html()

    run(story)


def test_the_page_carries_the_link_of_the_moment_on_show():
    async def story(viewer, browser):
        await browser.until_shown("Reconstruction of window 0")
        await browser.until(lambda: 'data-etv-moment="ey' in browser.html())
        value = browser.html().split('data-etv-moment="')[1].split('"')[0]
        linked, refused = from_link(value, ViewState())
        assert (linked.recording_id, linked.moment, refused) == ("a", 10_000, ())

    run(story)


def test_in_public_the_page_leads_until_it_is_touched_and_again_when_it_is_left(monkeypatch):
    monkeypatch.setattr(demo, "IDLE", 1e9)

    async def story(viewer, browser):
        await browser.until_shown('data-act="events"')
        await browser.until_shown(INVITED)
        await browser.use(browser.widget("channel"), "touch|1")
        await browser.until_shown("Your turn")
        assert INVITED not in browser.html()
        await browser.use(browser.widget("channel"), "pick|open:b|0|0|2")
        await browser.until(lambda: newest(viewer).recording_id == "b")
        monkeypatch.setattr(demo, "IDLE", 1.0)
        await browser.until_shown(INVITED)
        await browser.until(lambda: newest(viewer).recording_id == "a")

    run(story, view=public_view)


def test_in_public_nobody_changes_the_network_the_windows_or_what_the_next_one_sees():
    async def story(viewer, browser):
        await browser.until_shown(INVITED)
        labels = {props.get("label") for props in browser.widgets.values()}
        assert not labels & {"Recording", "Network", "Windowing", "Precision", "Export", "Compare"}
        channel = browser.widget("channel")
        other = ViewState(recording_id="b", model_id="m", precision="bf16", policy=ByDuration(1))
        await browser.use(channel, f"link|{to_link(other, 70_000)}|1")
        await browser.until(lambda: newest(viewer).recording_id == "b")
        assert viewer.engine.requests[-1][1].precision == "fp32"
        assert viewer.engine.requests[-1][1].policy == BetweenFrames()
        async with Browser.open(viewer.port, tab=9, storage=browser.storage) as next_one:
            await next_one.until_shown(INVITED)
        assert browser.storage == {}

    run(story, view=public_view)


def test_a_flood_of_messages_is_let_go_and_the_page_goes_on():
    async def story(viewer, browser):
        await browser.until_shown(INVITED)
        channel = browser.widget("channel")
        for number in range(3000):
            await browser.use(channel, f"pick|pixel|0.{number % 90 + 10}|0.5|{number}")
        while "Reconstruction of window 3" not in browser.html():  # what comes in the flood's wake is let go with it
            await browser.use(channel, "pick|span:0,0.3|0.13|0|9")
            await asyncio.sleep(0.3)
        session = next(iter(viewer.sessions.values()))
        assert session._mail.qsize() < BURST

    run(story, view=public_view)


def test_one_visitor_too_many_is_told_and_gets_no_session():
    async def story(viewer, browser):
        await browser.until_shown(INVITED)
        async with Browser.open(viewer.port, tab=None) as other:
            await other.until(lambda: any("Many are looking" in str(props) for props in other.widgets.values()))
        assert len(viewer.sessions) == 1

    run(story, view=public_view, most_visitors=1)


def test_one_who_was_told_to_come_later_takes_no_place_from_those_who_come_after():
    async def story(viewer, browser):
        await browser.until_shown(INVITED)
        async with Browser.open(viewer.port, tab=None) as waiting:
            await waiting.until(lambda: any("Many are looking" in str(props) for props in waiting.widgets.values()))
            await browser._socket.close()
            for _ in range(50):  # the first one's leaving may not be known yet
                async with Browser.open(viewer.port, tab=8) as late:
                    await late.until(lambda: late.widgets)
                    if not any("Many are looking" in str(props) for props in late.widgets.values()):
                        await late.until_shown(INVITED)
                        break
        assert len(viewer.sessions) == 2

    run(story, view=public_view, most_visitors=1)


def test_in_public_no_message_leads_out_of_the_demo():
    async def story(viewer, browser):
        await browser.until_shown(INVITED)
        commands = [message for _, kind, message in browser.arrivals if kind == "RegisterCommandMessage"]
        assert len(commands) == len(PUBLIC_COMMANDS) + 1
        for message in commands:
            await browser._send({"type": "CommandTriggerMessage", "uuid": message["uuid"]})
        channel = browser.widget("channel")
        other = ViewState(recording_id="b", model_id="m", workspace="attention", tab="attention", query=(3, 4))
        for number, words in enumerate(
            (
                "pick|workspace:inspect|0|0",
                "pick|tab:attention|0|0",
                "pick|stage:scene|0|0",
                f"link|{to_link(other, 70_000)}",
            )
        ):
            await browser.use(channel, f"{words}|{number}")
        await browser.until(lambda: newest(viewer).recording_id == "b")
        await browser.until_shown("Reconstruction of window 6")
        (state,) = (session._state for session in viewer.sessions.values())
        assert (state.workspace, state.tab, state.staged) == ("demo", "", "")
        assert 'data-etv-public="none"' in browser.html()

    run(story, view=public_view)


def test_what_the_host_switched_off_is_refused_whatever_a_page_sends():
    async def story(viewer, browser):
        await browser.until_shown("Reconstruction of window 0")
        channel = browser.widget("channel")
        for number, key in enumerate(("demo:home", "demo:mirror", "demo:spot")):
            await browser.use(channel, f"pick|{key}|0|0|{number}")
        await browser.until_shown('data-testid="map"')  # the last of them was answered
        (state,) = (session._state for session in viewer.sessions.values())
        assert state.of(DemoState) == DemoState(large="map")
        assert [job for _, slot, job in viewer.engine.jobs if slot == HOME_SLOT] == []
        assert 'data-testid="sheet' not in browser.html()

    run(story, view=public_view)


def test_a_page_that_was_made_all_the_same_is_handed_to_nobody():
    made = JobNews(HOME_SLOT, JobResult(None, Download("a.html", b"page"), 1.0, is_whole=True))
    assert Booth().kept(made) == (Downloaded(HOME_SLOT),)
    assert [type(news) for news in Booth(homes=Homes()).kept(made)] == [HomeReady, Downloaded]


@pytest.mark.parametrize("aspect", [1.6, 0.5])
def test_in_public_a_camera_that_was_turned_is_put_back_for_the_next_visitor(monkeypatch, aspect):
    monkeypatch.setattr(demo, "IDLE", 1e9)

    async def story(viewer, browser):
        placings = lambda: sum(kind == "SetCameraPositionMessage" for _, kind, _ in browser.arrivals)  # noqa: E731
        await browser.until_shown("Reconstruction of window")
        channel = browser.widget("channel")
        await browser.use(channel, "touch|1")
        await browser.until(lambda: placings() > 0)
        await asyncio.sleep(0.5)
        before = placings()
        await browser.turn(aspect, (3, 1, -4))
        await asyncio.sleep(0.5)
        assert placings() == before, "while a visitor looks, the camera is theirs"
        monkeypatch.setattr(demo, "IDLE", 0.5)
        await browser.until(lambda: placings() > before)

    run(story, view=public_view, aspect=aspect)


def test_on_a_phone_in_public_a_visitor_is_invited_and_chooses_a_recording():
    async def story(viewer, browser):
        await browser.until_shown(INVITED)
        await browser.use(browser.widget("channel"), "touch|1")
        await browser.until_shown("Your turn")
        await browser.until_shown('data-k="open:b"')
        await browser.use(browser.widget("channel"), "pick|open:b|0|0|2")
        await browser.until(lambda: newest(viewer).recording_id == "b")

    run(story, view=public_view, aspect=0.5)

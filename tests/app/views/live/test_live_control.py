"""Who may record a live source and change its settings, and how its faults are said."""

import asyncio
import re
import time
from dataclasses import replace

import pytest

from app.config import ConfigError, LiveConfig, ViewerConfig
from app.main import open_feed, with_a_camera
from app.session import demo
from app.state import intents as ask
from etnet.errors import RecordingError
from etnet.live.source import Packet, Setting
from etnet.windows import ByCount
from tests.app.stand_ins import Browser
from tests.app.views.live.viewers import SENSOR, live_viewer, press, replayed
from tests.strategies import make_events


class SettableSource:
    """A source with one bias; it ends with a fault when it is told to."""

    name, format, sensor = "Stand-in 7", "made up", SENSOR

    def __init__(self):
        self.value, self.is_unplugged = 20, False
        self.replay = replayed()

    def packets(self, is_stopped):
        for packet in self.replay.packets(is_stopped):
            if self.is_unplugged:
                self.is_unplugged = False
                packet = replace(packet, notes=("Stand-in 7: unplugged; plug it in again",))
            yield packet

    def settings(self):
        return (Setting("bias_diff", self.value, 0, 255),)

    def change(self, name, value):
        if value > 200:
            raise RecordingError(f"{name}: {value} is more than the camera takes")
        self.value = value

    def close(self):
        self.replay.close()


def test_a_page_on_the_machine_itself_changes_a_bias_and_a_refusal_is_one_line():
    source = SettableSource()

    async def visit(viewer):
        async with Browser.open(viewer.port) as browser:
            await browser.until_shown('data-testid="is-live"')
            await press(browser, "tab:live")
            await browser.until(lambda: any(p.get("label") == "bias diff" for p in browser.widgets.values()))
            await browser.use(browser.widget("bias diff"), 33)
            await browser.until(lambda: source.value == 33)
            await browser.use(browser.widget("bias diff"), 250)
            await browser.until_shown("250 is more than the camera takes")
            source.is_unplugged = True
            await browser.until(lambda: re.search(r'data-testid="live-news">Stand-in 7: unplugged', browser.html()))

    with live_viewer(source) as viewer:
        asyncio.run(visit(viewer))


class ManyKindsSource(SettableSource):
    """A source with a switch, a choice and a wide range, whose biases can follow the rate."""

    kind = "evk4"

    def __init__(self):
        super().__init__()
        self.held = {
            "rate_limiter": Setting("rate_limiter", 0, 0, 1, is_switch=True),
            "rate_limiter.period_us": Setting("rate_limiter.period_us", 700, 1, 4_000_000),
            "polarity_filter": Setting("polarity_filter", 0, 0, 2, ("disabled", "flatten", "mask on")),
            "diff_on": Setting("diff_on", 20, 0, 255),
        }

    def settings(self):
        return tuple(self.held.values())

    def change(self, name, value):
        self.held[name] = replace(self.held[name], value=value)


def test_switches_choices_and_wide_ranges_have_widgets_of_their_own():
    source = ManyKindsSource()

    async def visit(viewer):
        async with Browser.open(viewer.port) as browser:
            await browser.until_shown('data-testid="is-live"')
            await press(browser, "tab:live")
            await browser.until(lambda: any(p.get("label") == "diff on" for p in browser.widgets.values()))
            for label, chosen, name, value in (
                ("rate limiter", True, "rate_limiter", 1),
                ("period (µs)", 12_345, "rate_limiter.period_us", 12_345),
                ("polarity filter", "mask on", "polarity_filter", 2),
                ("diff on", 33, "diff_on", 33),
            ):
                await browser.use(browser.widget(label), chosen)
                await browser.until(lambda name=name, value=value: source.held[name].value == value)
            source.change("polarity_filter", 1)
            await browser.until(lambda: browser.widgets[browser.widget("polarity filter")]["value"] == "flatten")

    with live_viewer(source) as viewer:
        asyncio.run(visit(viewer))


def test_biases_are_let_follow_the_rate_and_left_alone_again_in_the_page():
    source = ManyKindsSource()

    async def visit(viewer):
        async with Browser.open(viewer.port) as browser:
            await browser.until_shown('data-testid="is-live"')
            await press(browser, "tab:live")
            await browser.until(lambda: any(p.get("label") == "at most (Mev/s)" for p in browser.widgets.values()))
            assert viewer.feed.live.follower is None
            await browser.use(browser.widget("at least (Mev/s)"), 200.0)
            await browser.use(browser.widget("at most (Mev/s)"), 300.0)
            await browser.use(browser.widget("biases follow the event rate"), True)
            await browser.until(lambda: viewer.feed.shown(None, True).followed == (200.0, 300.0))
            await browser.until(lambda: source.held["diff_on"].value < 20)  # too few events: the threshold falls
            await browser.use(browser.widget("at most (Mev/s)"), 100.0)
            await browser.until_shown("the first is the lower one")
            await browser.use(browser.widget("biases follow the event rate"), False)
            await browser.until(lambda: viewer.feed.live.follower is None)

    with live_viewer(source) as viewer:
        asyncio.run(visit(viewer))


@pytest.mark.parametrize("how", [{"public_url": "https://show.example"}, {"is_demo": True}])
def test_others_neither_record_nor_change_settings_but_they_look(tmp_path, monkeypatch, how):
    monkeypatch.chdir(tmp_path)
    source = SettableSource()

    async def visit(viewer):
        async with Browser.open(viewer.port) as browser:
            await browser.until_shown('data-act="events"' if how.get("is_demo") else 'data-testid="is-live"')
            assert "live:record" not in browser.html()
            await press(browser, "live:record")
            await press(browser, "tab:live")
            await press(browser, "pixel", 0.25, 0.5)
            await browser.until(lambda: viewer.page.state.query == (10, 14))  # what came before it was heard, too
            labels = {props.get("label") for props in browser.widgets.values()}
            assert not labels & {"bias diff", "biases follow the event rate"}
            assert viewer.feed.shown(None, False).recording is None

    with live_viewer(source, **how) as viewer:
        asyncio.run(visit(viewer))
    assert list(tmp_path.iterdir()) == []
    assert source.value == 20


def test_the_demo_runs_on_the_live_recording_and_stands_still_for_the_place_it_points_at(monkeypatch):
    acts = tuple(replace(step, seconds=min(step.seconds, 0.4)) for step in demo.steps_of("", is_live=True))
    monkeypatch.setattr(demo, "steps_of", lambda live_id, is_live: (replace(acts[0], recording_id=live_id), *acts[1:]))

    async def visit(viewer):
        async with Browser.open(viewer.port) as browser:
            await browser.until(lambda: viewer.page is not None and viewer.page.follows)
            assert viewer.page.state.recording_id == viewer.feed.id
            await browser.until_shown('data-act="places"')
            await browser.until(lambda: not viewer.page.follows and viewer.page.state.query is not None)
            await browser.until_shown('data-act="invite"')
            await browser.until(lambda: viewer.page.follows)

    with live_viewer(is_demo=True) as viewer:
        asyncio.run(visit(viewer))


def test_live_windows_are_never_planned_again_and_a_visitor_is_told_so():
    async def visit(viewer):
        async with Browser.open(viewer.port) as browser:
            await browser.until_shown('data-testid="is-live"')
            await browser.until(lambda: viewer.page.follows)
            session = next(iter(viewer.sessions.values()))
            kept = viewer.page.state.policy
            session._speak(ask.ChoosePolicy(ByCount(77)))
            await browser.until(lambda: any("stay as they were cut" in str(notice) for notice in browser.notices))
            await browser.until(lambda: viewer.page.state.policy == kept and viewer.page.moment is not None)

    with live_viewer() as viewer:
        asyncio.run(visit(viewer))


def test_a_source_that_says_nothing_yet_is_waited_for_and_said():
    class Silent(SettableSource):
        def packets(self, is_stopped):
            while self.value != 21 and not is_stopped():
                time.sleep(0.05)
                yield Packet(make_events(0, SENSOR))
            yield from self.replay.packets(is_stopped)

    source = Silent()

    async def visit(viewer):
        async with Browser.open(viewer.port) as browser:
            await browser.until_shown("no events yet")
            assert browser.notices == []
            source.value = 21
            await browser.until(lambda: viewer.page is not None and viewer.page.moment is not None)

    with live_viewer(source) as viewer:
        asyncio.run(visit(viewer))


def test_live_alone_takes_the_one_camera():
    assert with_a_camera(["--live"]) == ["--live", "camera"]
    assert with_a_camera(["--live", "--port", "0"]) == ["--live", "camera", "--port", "0"]
    assert with_a_camera(["--live", "davis346"]) == ["--live", "davis346"]
    assert with_a_camera(["a.h5"]) == ["a.h5"]


def test_what_does_not_go_with_live_is_refused_by_name(tmp_path):
    with pytest.raises(ConfigError, match="add --live"):
        ViewerConfig(source=LiveConfig(loop=True))
    with pytest.raises(ConfigError, match="leave --roi"):
        ViewerConfig(live="camera", roi="1,1,5,5")
    with pytest.raises(RecordingError, match="on evk4 and davis346 only"):
        open_feed(ViewerConfig(live="udp:0", source=LiveConfig(sensor="40x28", rate=(0.5, 3.0))))
    with pytest.raises(RecordingError, match="no layout"):
        ViewerConfig(live="camera", source=LiveConfig(record=tmp_path / "a.txt"))
    with pytest.raises(RecordingError, match="--keep"):
        ViewerConfig(live="camera", source=LiveConfig(keep="a lot"))

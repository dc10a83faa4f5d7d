"""A stretch marked in the page becomes a recording of its own, with its frames, and nobody waits for it."""

import asyncio
import tempfile
import threading
import time
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from app.engine.downloads import Download
from app.engine.jobs import JobResult
from app.engine.requests import FrameRequest
from app.html.moment import Moment
from app.session.channel import parse
from app.session.demo import may_ask
from app.state import intents as ask
from app.state.stored import to_text
from app.state.view_state import Limits, ViewState
from app.views import VIEWS
from app.views.recording.html.cut import excerpt_html
from app.views.recording.jobs.cut import TrimJob, trim_jobs
from app.views.recording.state import TRIM_SLOT, DropTrim, RecordingState, Trim
from etnet.errors import EtnetError
from etnet.events.open import open_recording
from etnet.windows import BetweenFrames, ByCount, plan_windows
from tests.app.reducing import from_text, reduce
from tests.app.stand_ins import SENSOR, Browser, recording, served
from tests.events.containers import assert_same_events
from tests.real_data import real_file

STATE = ViewState(recording_id="a", model_id="m", precision="fp32", policy=BetweenFrames())


def press(text):
    return f"pick|{text}|0.5|0.5|{time.monotonic_ns()}"


def marked(opened, policy, first=None, last=None, order=(0, 1)):
    """The view after marking windows `first` and `last`, in this order, and asking for the file."""
    windows = plan_windows(opened, policy)
    limits = Limits(opened.sensor, windows, opened.span.start)
    state = replace(STATE, policy=policy)
    for mark in order:
        index, end = ((first, "a"), (last, "b"))[mark]
        if index is not None:
            state = reduce(reduce(state, ask.Seek(index), limits), ask.MarkHere(end), limits)
    return reduce(state, Trim(), limits), windows


def loaded_of(opened):
    return SimpleNamespace(playback=SimpleNamespace(recording=opened))


def cut(state, opened, folder):
    answers = list(TrimJob(state.of(RecordingState).cut).run(loaded_of(opened), bool))
    assert all(value is None for value, _ in answers[:-1])
    assert [share for _, share in answers] == sorted(share for _, share in answers)
    path = folder / answers[-1][0].name
    path.write_bytes(answers[-1][0].content)
    return open_recording(path)


def test_windows_between_frames_come_back_as_they_were_with_their_frames(tmp_path):
    opened = recording()
    state, windows = marked(opened, BetweenFrames(), 3, 7)
    with cut(state, opened, tmp_path) as part:
        again = plan_windows(part, BetweenFrames())
        assert [(w.t_start, w.t_stop) for w in again] == [(w.t_start, w.t_stop) for w in windows[3:8]]
        for mine, theirs in zip(again, windows[3:8], strict=True):
            assert_same_events(part.read(mine.start, mine.stop), opened.read(theirs.start, theirs.stop))
        assert part.ground_truth.stamps.tolist() == opened.ground_truth.stamps[3:9].tolist()
        difference = part.ground_truth.read_frame(2) - opened.ground_truth.read_frame(5)
        assert np.abs(difference).max() <= 0.5 / 255 + 1e-6


@settings(max_examples=6, deadline=None)
@given(st.integers(0, 11), st.integers(0, 11))
def test_a_cut_is_the_events_of_the_marked_windows_whatever_the_order_of_the_marks(a, b):
    first, last = min(a, b), max(a, b)
    opened = recording(num_events=1200)
    for order in ((0, 1), (1, 0)):
        state, windows = marked(opened, ByCount(100), first, last, order)
        excerpt = state.of(RecordingState).cut.excerpt
        assert (excerpt.start, excerpt.stop) == (windows[first].start, windows[last].stop)
    with tempfile.TemporaryDirectory() as folder, cut(state, opened, Path(folder)) as part:
        whole = opened.read(windows[first].start, windows[last].stop)
        assert_same_events(part.read(0, part.num_events), whole)


def test_marks_that_cross_leave_the_newer_one_and_one_mark_reaches_to_the_end():
    opened = recording(num_events=1200)
    state, windows = marked(opened, ByCount(100), 8, 2)
    excerpt = state.of(RecordingState).cut.excerpt
    assert (excerpt.start, excerpt.stop) == (0, windows[2].stop)
    state, _ = marked(opened, ByCount(100), 8, 2, order=(1, 0))
    excerpt = state.of(RecordingState).cut.excerpt
    assert (excerpt.start, excerpt.stop) == (windows[8].start, 1200)


def test_marks_belong_to_their_recording():
    opened = recording(num_events=1200)
    state, windows = marked(opened, ByCount(100), 8)
    limits = Limits(opened.sensor, windows)
    elsewhere = reduce(reduce(state, DropTrim(), limits), ask.OpenRecording("b"), limits)
    assert reduce(elsewhere, Trim(), limits).of(RecordingState).cut is None


def test_without_a_mark_or_a_recording_nothing_is_cut():
    assert reduce(STATE, Trim(), Limits()).of(RecordingState).cut is None
    assert reduce(STATE, ask.MarkHere("a"), Limits()).mark_a is None
    assert trim_jobs(STATE, FrameRequest("a", "m", "fp32", BetweenFrames(), 0)) == {}


def test_the_public_cannot_cut_and_a_browser_keeps_no_order():
    state, _ = marked(recording(), BetweenFrames(), 3, 7)
    assert not any(may_ask(intent, VIEWS) for intent in (Trim(), DropTrim()))
    assert from_text(to_text(state), STATE)[0].of(RecordingState).cut is None
    request = FrameRequest("a", "m", "fp32", BetweenFrames(), 0)
    assert set(trim_jobs(state, request)) == {TRIM_SLOT}
    assert not trim_jobs(reduce(state, DropTrim(), Limits()), request)


def test_what_is_too_large_for_a_page_is_said_with_a_way_out_and_who_cancels_leaves_nothing(tmp_path, monkeypatch):
    opened = recording(num_events=60_000)
    state, _ = marked(opened, BetweenFrames(), 3, 7)
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    answers = TrimJob(state.of(RecordingState).cut).run(loaded_of(opened), bool)
    next(answers)
    answers.close()
    monkeypatch.setattr("app.views.recording.jobs.cut.LARGEST", 1000)
    with pytest.raises(EtnetError, match="etnet cut"):
        list(TrimJob(state.of(RecordingState).cut).run(loaded_of(opened), bool))
    assert not list(tmp_path.iterdir())
    assert not [thread for thread in threading.enumerate() if thread.name == "cutting"]


@pytest.mark.real
def test_a_stretch_of_a_real_recording_keeps_events_and_frames(tmp_path):
    with open_recording(real_file("derived/slider_depth_1.0s_event_utils.h5")) as opened:
        state, windows = marked(opened, BetweenFrames(), 4, 9)
        with cut(state, opened, tmp_path) as part:
            again = plan_windows(part, BetweenFrames())
            assert [w.num_events for w in again] == [w.num_events for w in windows[4:10]]
            assert part.sensor == opened.sensor


def test_a_visitor_marks_a_stretch_cuts_it_and_the_browser_saves_it():
    async def run():
        with served() as viewer:
            async with Browser.open(viewer.port, tab=81) as browser:
                await browser.until_shown("Reconstruction of window 0")
                await browser.use(browser.widget("channel"), "pick|tab:recording|0|0|1")
                await browser.until_shown("timeline:a")
                await story(viewer, browser)

    async def story(viewer, browser):
        say = lambda text: browser.use(browser.widget("channel"), press(text))  # noqa: E731
        asked = lambda: [job for _, slot, job in viewer.engine.jobs if slot == TRIM_SLOT]  # noqa: E731
        assert "recording:trim" not in browser.html()
        await say("timeline:a")
        await browser.until_shown("0.000 s … ")
        await browser.use(browser.widget("Window"), 20)
        await browser.until_shown("window 20 of 0 – 29")
        await say("timeline:b")
        await browser.until_shown("0.000 s … 0.210 s, ")
        await say("recording:trim")
        await browser.until_shown("recording:drop")
        await browser.until(lambda: asked() and asked()[-1] is not None)
        job = asked()[-1]
        found = list(job.run(loaded_of(viewer.shelf.recordings["a"]), bool))[-1][0]
        viewer.engine.tell(TRIM_SLOT, JobResult(job, found, 1.0, is_whole=True))
        await browser.until(lambda: any(kind == "FileTransferPart" for _, kind, _ in browser.arrivals))
        sent = [message["content"] for _, kind, message in browser.arrivals if kind == "FileTransferPart"]
        assert b"".join(sent) == found.content
        await browser.until_shown("recording:trim")
        assert isinstance(found, Download)

    asyncio.run(run())


def test_a_cut_that_failed_says_why_and_another_mark_takes_it_away():
    opened = recording()
    state, windows = marked(opened, BetweenFrames(), 3, 7)
    moment = Moment("a", BetweenFrames(), 7, opened, windows)
    html = excerpt_html(moment, state, JobResult(TrimJob(state.of(RecordingState).cut), trouble="no <space>"))
    assert "no &lt;space&gt;" in html
    assert "timeline:a" in html
    state = reduce(state, ask.MarkHere("b"), Limits(SENSOR, windows))
    assert "no &lt;space" not in excerpt_html(moment, state, None)
    for word in ("trim", "drop"):
        assert parse(press(f"recording:{word}"), VIEWS) is not None

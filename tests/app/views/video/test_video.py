"""The tab of a video: a setting is another film of it, and the reconstruction is held against its frames."""

import asyncio
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from app.catalogue.videos import BANDWIDTHS, SIDES, FilmSetting, VideoShown
from app.engine.jobs import JobResult
from app.html.moment import Moment
from app.session.channel import parse
from app.state import intents as ask
from app.state.view_state import ViewState
from app.views import VIEWS
from app.views.page import Page
from app.views.video import VIEW
from app.views.video.html import choices_html, film_html, no_video_html, strip_html
from app.views.video.jobs import SLOT, STRIDE, FilmScores, ScoreFilm, film_jobs
from etnet.windows import BetweenFrames, plan_windows
from tests.app.checked_html import Checker
from tests.app.stand_ins import Browser, recording, served

SETTING = FilmSetting(0.35, 1.5, 50, 160)
STATE = ViewState(recording_id="v~0.20~0.20~0~320", model_id="m", precision="fp32", policy=BetweenFrames(), index=2)


@pytest.fixture
def moment():
    film = replace(recording(), format="a video, simulated")
    return Moment(STATE.recording_id, BetweenFrames(), 2, film, plan_windows(film, BetweenFrames()))


def scored(moment, share=1.0):
    stamps = np.array([window.t_stop for window in list(moment.windows)[:5]], np.int64)
    values = {"mse": np.full(5, 0.02), "ssim": np.full(5, 0.6), "lpips": np.array([0.5, 0.4, 0.31, 0.3, np.nan])}
    job = film_jobs(STATE, moment, (), lambda request: 0)[SLOT]
    return JobResult(job, FilmScores(stamps, values), share, is_whole=share == 1.0)


def test_each_button_asks_for_the_film_with_one_setting_changed():
    keys = Checker(choices_html("v~0.20~0.20~0~320", SETTING)).keys
    assert len(keys) == len(BANDWIDTHS) + len(SIDES)
    for key in keys:
        intent = parse(f"pick|{key}|0.5|0.5|1", VIEWS)
        assert isinstance(intent, ask.ReopenRecording)
        changed = intent.recording_id.split("~")
        assert changed[:3] == ["v", "0.35", "1.50"]
        assert changed[3] == "50" or changed[4] == "160"


def test_how_far_the_film_is_made_is_one_line():
    html = film_html(VideoShown(SETTING, done=3.0, total=12.0, work=1.5, is_over=False))
    assert "3.0 of 12.0 s" in html
    assert "A second of video takes 1.5 s of work here" in html
    assert "the last 9.0 s take about 14 s more" in html
    assert "all of its 12.0 s are there" in film_html(VideoShown(SETTING, 12.0, 12.0, 1.5, True))


def test_the_tab_is_there_for_a_video_alone():
    async def story(viewer, browser):
        await browser.until_shown("Reconstruction of window 0")
        listed = lambda: {key for key in Checker(browser.html()).keys if key.startswith("tab:")}  # noqa: E731
        assert {"tab:export", "tab:filter"} <= listed()
        assert "tab:video" not in listed()
        await browser.use(browser.widget("channel"), "pick|tab:video|0|0|1")  # as an old link does
        await browser.until(lambda: "tab:video" in listed())
        await browser.until_shown("No video is open")

    async def run():
        with served() as viewer:
            async with Browser.open(viewer.port, tab=3) as browser:
                await story(viewer, browser)

    asyncio.run(run())
    film = VideoShown(SETTING, done=3.0, total=12.0, work=1.5, is_over=False)
    assert not VIEW.suits(Page(STATE))
    assert VIEW.suits(Page(STATE, video=film))


def test_without_a_video_it_says_how_one_gets_here():
    assert "--data folder" in no_video_html(Page(STATE))


def test_the_strip_shows_this_windows_scores_and_a_click_goes_to_another(moment):
    page = Page(STATE, moment, results={SLOT: scored(moment)})
    html = Checker(strip_html(page))
    assert "LPIPS 0.310" in html.text
    assert "mean 0.378 over 4 windows, lower is better" in html.text
    chart = next(attrs for attrs in html.by_testid("film-strip"))
    assert isinstance(parse(f"pick|{chart['data-k']}|0.5|0.5|1", VIEWS), ask.SeekTime)
    chosen = next(key for key in html.keys if key.endswith(":ssim"))
    assert parse(f"pick|{chosen}|0.5|0.5|1", VIEWS) == ask.Set("video", "measure", "ssim", is_word=True)


def test_scores_of_another_film_or_too_small_pictures_are_not_shown(moment):
    result = scored(moment)
    other = Moment("v~0.50~0.20~0~320", moment.policy, 2, moment.recording, moment.windows)
    assert strip_html(Page(STATE, other, results={SLOT: result})) == ""
    small = replace(result, value=FilmScores(result.value.stamps, {"sharpness": np.ones(5)}))
    assert "too small to be scored" in strip_html(Page(STATE, moment, results={SLOT: small}))
    assert strip_html(Page(STATE, moment)) == ""


def test_only_a_video_is_scored_and_a_growing_one_again_as_it_grows(moment):
    plain = Moment("a", moment.policy, 2, recording(), moment.windows)
    assert film_jobs(STATE, plain, (), lambda request: 0) == {}
    assert film_jobs(STATE, moment, (), lambda request: 0)[SLOT].num_windows == len(moment.windows) == 30
    growing = replace(moment.recording, latest=lambda: moment.recording)
    for number, asked in ((3, 1), (STRIDE + 3, STRIDE)):
        part = Moment(moment.recording_id, moment.policy, 2, growing, list(moment.windows)[:number])
        assert film_jobs(STATE, part, (), lambda request: 0)[SLOT].num_windows == asked


def test_each_window_is_scored_against_the_frame_at_its_end(moment, monkeypatch):
    asked = []

    def judged(loaded, request, index, rule, frame, cancelled):
        asked.append((index, frame))
        return {"lpips": index / 10}, True

    monkeypatch.setattr("app.views.video.jobs.frame_values", judged)
    loaded = SimpleNamespace(playback=SimpleNamespace(recording=moment.recording, windows=moment.windows))
    job = film_jobs(STATE, moment, (), lambda request: 0)[SLOT]
    answers = list(ScoreFilm(job.request, 4).run(loaded, bool))
    stamps = moment.recording.ground_truth.stamps
    assert [stamps[frame] for _, frame in asked] == [moment.windows[i].t_stop for i in range(4)]
    assert [share for _, share in answers] == [0.25, 0.5, 0.75, 1.0]
    assert answers[-1][0].at(3) == {"lpips": 0.3}
    assert answers[-1][0].at(4) == {}


def test_it_stands_in_the_list_of_views():
    assert VIEW in VIEWS

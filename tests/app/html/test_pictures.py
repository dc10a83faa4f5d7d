"""The pictures of one moment: what is drawn is what is there, and what is missing says so."""

from dataclasses import replace

import numpy as np
import pytest

from app.engine.requests import Failed, Ready, Working
from app.html import pictures
from app.html.moment import Moment
from app.html.pictures import (
    camera_frame_html,
    camera_image,
    event_cloud,
    event_image_html,
    event_picture,
    reconstruction_html,
)
from app.html.provenance import ModelFacts, all_facts_html, provenance_html
from app.html.units import seconds
from app.state.view_state import ViewState
from app.views.page import Page
from app.views.reconstruction.html import reconstruction_of
from app.views.timeline.html import timeline_html
from app.views.voxels.html import voxel_html
from etnet.events.events import Events, Sensor
from etnet.events.recording import recording_of_events
from etnet.windows import ByDuration, plan_windows
from tests.app.checked_html import Checker
from tests.app.fakes import POLICY, recording_of, request
from tests.app.shown_moment import EVIL, TONES


def test_reconstruction_shows_the_frame_and_what_may_be_claimed_of_it(ready):
    page = Checker(reconstruction_html(ready, tones=TONES, query=(10, 5)))
    assert page.keys == ["pixel"]
    assert "exact" in page.text
    assert len(page.by_testid("chip-exact")) == 1
    cross = page.by_testid("query")[0]["style"]
    assert f"--u:{10.5 / 50:.4f}" in cross
    assert f"--v:{5.5 / 37:.4f}" in cross


@pytest.mark.parametrize(
    ("exact", "approximate", "says"), [(False, True, "approximate"), (False, False, "not the plain")]
)
def test_what_is_not_exact_never_says_so(ready, exact, approximate, says):
    other = Ready(ready.request, ready.frame, None, 1.0, exact, approximate, False, ready.contract, 4)
    page = Checker(reconstruction_html(other, tones=TONES))
    assert page.by_testid("chip-exact") == []
    assert says in page.text


def test_a_panel_that_lags_is_dimmed_and_says_what_it_shows_and_computes(ready):
    working = Working(request(23), 14, 19, "replaying")
    page = Checker(reconstruction_html(ready, tones=TONES, wanted=23, working=working))
    assert "Frame 23: warm-up 14 of 19 · shows frame 4" in page.text
    assert any(attrs.get("class") == "et-lags" for _, attrs in page.tags)


def test_where_every_image_is_waited_for_the_one_on_show_is_not_dimmed_while_it_plays(ready):
    at = ready.request.index + 1
    for is_playing, waits, lags in ((True, True, False), (True, False, True), (False, True, True)):
        page = Page(ViewState(index=at, is_playing=is_playing, waits_for_frames=waits), ready=ready)
        assert page.lags is lags
        assert ("et-lags" in reconstruction_of(page)) is lags
        assert ("computing" in reconstruction_of(page)) is lags


def test_nothing_lags_once_the_wanted_frame_is_there(ready):
    page = Checker(reconstruction_html(ready, tones=TONES, wanted=4))
    assert page.by_testid("lag") == []


def test_without_a_frame_the_panel_explains_itself_and_tells_of_loading():
    working = Working(request(0), 0, 0, "loading the network")
    page = Checker(reconstruction_html(None, tones=TONES, wanted=0, working=working))
    assert "No image yet" in page.text
    assert "loading the network" in page.text


def test_an_error_is_shown_as_text_and_never_as_markup():
    page = Checker(reconstruction_html(None, tones=TONES, failed=Failed(request(0), EVIL)))
    assert page.by_testid("failed")
    assert "onerror" in page.text
    assert not any("onerror" in attrs for _, attrs in page.tags)


def test_a_hostile_file_name_stays_text(moment, ready):
    page = Checker(provenance_html(moment, ModelFacts(EVIL), ready, 100.0))
    assert page.text.count("onerror") == 1
    assert not any(tag == "img" for tag, _ in page.tags)


def test_the_camera_frame_is_the_nearest_one(moment):
    grey, stamp = camera_image(moment, TONES)
    assert grey.shape == (37, 50)
    assert abs(stamp - moment.window.t_stop) <= 10_000
    page = Checker(camera_frame_html(moment, tones=TONES))
    assert page.keys == ["pixel"]
    assert "window end" in page.text


def test_a_recording_without_a_camera_says_so():
    bare = recording_of(5)
    moment = Moment("bare", POLICY, 0, bare, plan_windows(bare, POLICY))
    assert camera_image(moment, TONES) is None
    assert "No camera frame in this recording" in Checker(camera_frame_html(moment, tones=TONES)).text


@pytest.mark.parametrize("style_name", ["polarity", "count", "time surface", "decay"])
def test_the_event_image_counts_both_polarities(moment, style_name):
    page = Checker(event_image_html(moment, style_name))
    num_on = int((moment.events.p > 0).sum())
    assert f"brighter (ON) {num_on}" in page.text
    assert f"darker (OFF) {50 - num_on}" in page.text
    image, limit = event_picture(moment, style_name)
    assert image.colours.shape == (37, 50, 3)
    assert limit > 0


def test_an_empty_window_explains_itself():
    nothing = recording_of_events(
        Events(
            np.zeros(4, np.uint16),
            np.zeros(4, np.uint16),
            np.array([0, 1, 2, 50_000]),
            np.ones(4, np.int8),
            Sensor(8, 8),
        )
    )
    windows = plan_windows(nothing, ByDuration(10_000))
    moment = Moment("nothing", ByDuration(10_000), 2, nothing, windows)
    assert "given zeros" in Checker(voxel_html(moment)).text
    assert "No pixel reported" in Checker(event_image_html(moment, "polarity")).text
    assert len(event_cloud(moment, 100).positions) == 0
    Checker(timeline_html(moment))


def test_provenance_names_what_the_picture_was_made_of_and_by(moment, ready):
    facts = ModelFacts("etnet-half, first weights", (0.1, 1.0))
    page = Checker(provenance_html(moment, facts, ready, 210.0))
    listed = Checker(f"<dl>{all_facts_html(moment, facts, ready, 210.0)}</dl>")
    assert [tag for tag, _ in listed.tags].count("dt") == 6
    for said in (
        "50×37",
        "every 50 events",
        "etnet-half, first weights",
        "fp32",
        "210 ms a step",
        "state warm",
        "ev/px",
    ):
        assert said in page.text
        assert said in listed.text
    assert "fewer than trained on" in page.text  # 50 events on 1850 pixels
    assert any("1 thread" in attrs.get("title", "") or "threads" in attrs.get("title", "") for _, attrs in page.tags)
    preview = replace(ready, is_exact=False, is_approximate=True, num_warm=5)
    assert "cold start 5 windows ago" in Checker(provenance_html(moment, facts, preview, None)).text


def test_the_cloud_is_thinned_evenly_and_newest_events_have_age_zero(moment):
    whole, thin = event_cloud(moment, 1000), event_cloud(moment, 10)
    assert len(whole.positions) == 50
    assert not whole.is_thinned
    assert len(thin.positions) == len(thin.colours) == 10
    assert thin.is_thinned
    assert whole.positions[-1, 2] == 0
    assert (np.diff(whole.positions[:, 2]) <= 0).all()
    assert whole.positions[:, 2].max() <= 1


def test_pictures_are_made_once_for_all_visitors(moment, ready, monkeypatch):
    first = event_image_html(moment, "polarity")
    again = Moment("r", POLICY, 4, moment.recording, moment.windows)
    monkeypatch.setattr(pictures, "event_image", None)
    assert event_image_html(again, "polarity") is first


def test_another_moment_is_another_picture(moment):
    other = Moment("r", POLICY, 5, moment.recording, moment.windows)
    assert event_image_html(moment, "polarity") != event_image_html(other, "polarity")


@pytest.mark.parametrize(
    ("value", "digits", "words"),
    [
        (59.5, 1, "59.5 s"),
        (100, 0, "1 min 40 s"),
        (62.5, 1, "1 min 02.5 s"),
        (150, 2, "2 min 30.00 s"),
        (119.96, 1, "2 min 00.0 s"),
        (119.9996, 3, "2 min 00.000 s"),
        (59.9996, 3, "1 min 00.000 s"),
        (59.6, 0, "1 min 00 s"),
        (119.94, 1, "1 min 59.9 s"),
        (-3.25, 2, "−3.25 s"),
    ],
)
def test_long_times_are_told_in_minutes_and_seconds_of_two_digits(value, digits, words):
    assert seconds(value, digits) == words

from dataclasses import replace

import numpy as np
import pytest

from app.engine.requests import Failed, Ready, Working
from app.html import pictures
from app.html.attention.look import AttentionLook
from app.html.attention.maps import attention_image
from app.html.cloud import event_cloud
from app.html.moment import ARRAYS, PICTURES, Moment
from app.html.pictures import (
    camera_frame_html,
    camera_image,
    event_image_html,
    event_picture,
    reconstruction_html,
    reconstruction_image,
)
from app.html.provenance import ModelFacts, provenance_html
from app.html.timeline_marks import curve_of, place_of
from app.html.tones import Tones
from app.html.units import seconds
from app.state.view_state import ViewState
from app.views.attention.html import grid
from app.views.attention.html.grid import attention_html, site_html
from app.views.attention.state import AttentionState, look_in, look_of
from app.views.demo.state import DemoState
from app.views.events.state import EventsState
from app.views.page import Page
from app.views.reconstruction.html import reconstruction_of
from app.views.reconstruction.state import ReconstructionState
from app.views.scene.scene import picture_of, sites_behind
from app.views.scene.state import SceneState
from app.views.timeline.html import now_html, timeline_html, timeline_key_html
from app.views.voxels.html import voxel_html
from etnet.events.events import Events, Sensor
from etnet.events.recording import GroundTruth, recording_of_events
from etnet.nets.attention import AttentionProbe
from etnet.nets.presets import build_model
from etnet.nets.runtime import contract_of
from etnet.playback.playback import Playback
from etnet.windows import ByDuration, plan_windows
from tests.app.checked_html import Checker
from tests.app.fakes import POLICY, recording_of, request

EVIL = '<img src=x onerror="alert(1)">'


@pytest.fixture(autouse=True)
def nothing_shared(monkeypatch):
    for store in (PICTURES, ARRAYS):
        store._values.clear()


@pytest.fixture(scope="module")
def recording():
    made = recording_of(12, Sensor(50, 37))
    frame = np.linspace(0, 0.5, 37 * 50, dtype=np.float32).reshape(37, 50)
    truth = GroundTruth(np.arange(1, 12) * 10_000, lambda index: frame)
    return recording_of_events(made.read(0, made.num_events), EVIL, ground_truth=truth)


@pytest.fixture
def moment(recording):
    return Moment("r", POLICY, 4, recording, plan_windows(recording, POLICY))


@pytest.fixture(scope="module")
def ready(recording):
    model = build_model("tiny")
    playback = Playback(model, recording, plan_windows(recording, POLICY))
    step = playback.at(4, AttentionProbe())
    frame = step.frame[0, 0].numpy()
    return Ready(request(4), frame, step.attention, 12.0, True, False, False, contract_of(model), 4)


LOOK = AttentionLook((20, 30))
TONES = Tones()


def test_the_curve_of_a_plan_that_grows_grows_with_it(recording):
    windows = plan_windows(recording, POLICY)
    part, whole = (Moment("growing", POLICY, 1, recording, some) for some in (windows[:3], windows))
    assert curve_of(part).indices[-1] == 2
    assert curve_of(whole).indices[-1] == len(windows) - 1
    assert timeline_html(part) != timeline_html(whole)


def test_reconstruction_shows_the_frame_and_what_may_be_claimed_of_it(ready):
    page = Checker(reconstruction_html(ready, tones=TONES, query=(10, 5)))
    assert page.keys == ["pixel"]
    assert "exact" in page.text
    assert len(page.by_testid("chip-exact")) == 1
    cross = page.by_testid("query")[0]["style"]
    assert f"left:{10.5 / 50:.2%}" in cross
    assert f"top:{5.5 / 37:.2%}" in cross


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
    assert "showing 4, computing 23 (14 of 19)" in page.text
    assert any(attrs.get("class") == "et-lags" for _, attrs in page.tags)


def test_where_every_image_is_waited_for_the_one_on_show_is_not_dimmed_while_it_plays(ready):
    at = ready.request.index + 1
    for is_playing, waits, lags in ((True, True, False), (True, False, True), (False, True, True)):
        page = Page(ViewState(index=at, is_playing=is_playing, waits_for_frames=waits), ready=ready)
        assert page.lags is lags
        assert ("et-lags" in reconstruction_of(page)) is lags
        assert ("computing" in reconstruction_of(page)) is lags


def test_the_scenes_plane_carries_what_the_page_is_about(moment, ready):
    grey = np.repeat(reconstruction_image(ready, TONES)[..., None], 3, axis=2)
    asked = ViewState(index=4, query=LOOK.query)
    for workspace in ("inspect", "recording"):
        page = Page(replace(asked, workspace=workspace), moment, ready)
        assert np.array_equal(picture_of(page, False)[1], grey)
    about = Page(replace(asked, workspace="attention"), moment, ready)
    assert np.array_equal(picture_of(about, False)[1], attention_image(ready, look_of(about), AttentionState().site))
    assert picture_of(Page(asked, moment), False) == (None, None)


def test_on_a_phone_the_demos_scene_shows_what_is_spoken_of(moment, ready):
    pages = {
        act: Page(ViewState(workspace="demo", index=4, query=query).put(DemoState(act)), moment, ready)
        for act, query in (("events", None), ("image", None), ("places", LOOK.query))
    }
    events, _ = event_picture(moment, EventsState().event_image)
    grey = np.repeat(reconstruction_image(ready, TONES)[..., None], 3, axis=2)
    assert np.array_equal(picture_of(pages["events"], True)[1], events)
    assert np.array_equal(picture_of(pages["image"], True)[1], grey)
    places = attention_image(ready, look_of(pages["places"]), AttentionState().site)
    assert np.array_equal(picture_of(pages["places"], True)[1], places)
    assert all(np.array_equal(picture_of(page, False)[1], grey) for page in pages.values())


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
    assert image.shape == (37, 50, 3)
    assert limit > 0


def test_voxel_tiles_are_five_in_a_row_with_a_legend_in_numbers(moment):
    page = Checker(voxel_html(moment))
    assert page.keys == [f"set:voxels.voxel_bin:{i}" for i in range(5)]
    assert "≥ +" in page.text
    assert "38–62 %" in page.text


def test_an_opened_bin_is_shown_large_and_can_be_closed(moment):
    page = Checker(voxel_html(moment, 2))
    assert page.keys[-1] == "set:voxels.voxel_bin:none"
    images = [attrs for tag, attrs in page.tags if tag == "img"]
    assert images[-1]["width"] == "50"


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


def test_the_attention_grid_has_every_site_once_in_its_row_and_column(ready):
    page = Checker(attention_html(ready, LOOK))
    assert sorted(page.keys) == sorted(f"attention:site:{name}" for name in ready.attention.sites)
    for name in ready.attention.sites:
        assert len(page.by_testid(name)) == 1
    assert page.text.count("reads 1/8 ≈") == 2  # 1/4 reads the coarser scale, 1/8 itself
    assert "reads 1/4 ≈" in page.text
    assert "What pixel (20, 30) attends to" in page.text
    assert "1/4 ×" in page.text
    assert "32 ×" in page.text


def test_the_query_is_marked_on_every_map_at_its_token(ready):
    page = Checker(attention_html(ready, LOOK))
    marks = page.by_testid("query")
    grid = ready.attention.grid
    row, column = divmod(grid.token_at(20, 30), grid.columns)
    assert len(marks) == len(ready.attention.sites)
    assert {m["style"] for m in marks} == {
        f"left:{(column + 0.5) / grid.columns:.2%};top:{(row + 0.5) / grid.rows:.2%}"
    }


def test_a_chosen_site_shows_its_heads_and_the_large_map_in_sensor_pixels(ready):
    name = "scale2.decoder.0.cross"
    title, html = site_html(ready, LOOK, name)
    page = Checker(html)
    heads = ready.attention.queries[name].shape[0]
    assert page.keys == ["pixel", *[f"set:attention.head:{i}" for i in range(heads)]]
    assert "cross-attention: 1/4 reads 1/8" in title
    large = next(attrs for tag, attrs in page.tags if tag == "img" and attrs["data-k"] == "pixel")
    assert (large["width"], large["height"]) == ("50", "37")
    one = Checker(site_html(ready, replace(LOOK, head=1), name)[1])
    assert "set:attention.head:none" in one.keys
    assert "No such site" in site_html(ready, LOOK, "scale9.encoder.0.self")[1]


@pytest.mark.parametrize(
    ("look", "has_attention", "says"),
    [(None, True, "Choose a pixel"), (LOOK, False, "No attention for this window yet")],
)
def test_missing_attention_explains_itself(ready, look, has_attention, says):
    attention = ready.attention if has_attention else None
    other = Ready(ready.request, ready.frame, attention, 1.0, True, False, False, ready.contract, 4)
    assert says in Checker(attention_html(other, look)).text
    assert says in Checker(site_html(other, look, "scale2.decoder.0.cross")[1]).text


def test_the_attention_image_is_the_networks_own_row(ready):
    name = ready.attention.sites[0]
    image = attention_image(ready, LOOK, name)
    assert image.shape == (37, 50, 3)
    assert attention_image(ready, LOOK, "scale9.encoder.0.self") is None


def test_the_planes_behind_the_frame_are_the_same_layers_maps_finest_first(moment, ready):
    asked = ViewState(query=LOOK.query).put(AttentionState(site="scale2.encoder.0.self", shows_planes=True))
    page = Page(asked, moment, ready)
    assert sites_behind(page) == tuple(f"scale{scale}.encoder.0.self" for scale in (1, 2, 3))
    unseen = (asked.put(AttentionState()), asked.put(SceneState(camera="front")), replace(asked, query=None))
    assert all(sites_behind(replace(page, state=state)) == () for state in unseen)
    assert sites_behind(replace(page, ready=replace(ready, attention=None))) == ()
    assert sites_behind(replace(page, ready=None)) == ()


def test_attention_that_tells_little_says_so(ready, monkeypatch):
    says = attention_html(ready, LOOK)
    assert "tells little" in says  # a fresh network reads all places alike
    PICTURES._values.clear()
    monkeypatch.setattr(grid, "_ALIKE", 0.5)
    assert "tells little" not in attention_html(ready, LOOK)


def test_one_head_and_the_mean_differ_in_their_pictures(ready):
    name = ready.attention.sites[0]
    first = AttentionLook((20, 30), head=0)
    rows = ready.attention.rows(name, [ready.attention.grid.token_at(20, 30)])[:, 0].numpy()
    assert not np.allclose(rows[0], rows.mean(0))
    html = [site_html(ready, look, name)[1] for look in (LOOK, first)]
    assert "mean of all heads" in html[0]
    assert "head 1</span>" in html[1]
    assert html[0] != html[1]


def test_on_the_timeline_everything_stands_where_it_is_in_time(moment):
    cached = type("Cached", (), {"frames": (range(2, 4),), "states": (range(6),)})()
    page = Checker(timeline_html(moment, cached))
    assert page.keys == [f"span:0,{moment.recording.span.duration / 1e6:.6f}"]
    boxes = [(float(b["x"]), float(b["x"]) + float(b["width"])) for tag, b in page.tags if tag == "rect"]
    place = lambda index, end: place_of(moment, getattr(moment.windows[index], end))  # noqa: E731
    for first, last in ((4, 4), (0, 5), (2, 3)):
        ends = place(first, "t_start"), place(last, "t_stop")
        assert any(box == pytest.approx(ends, abs=0.2) for box in boxes), (first, last, boxes)
    head = f"--x:{place(4, 't_stop') / 1000:.3%}"
    assert any(head in attrs.get("style", "") for _, attrs in page.tags)
    span = moment.recording.span
    assert [place_of(moment, t) for t in (span.start - 9, span.start, span.stop, span.stop + 9)] == [0, 0, 1000, 1000]


def test_the_moment_is_told_in_numbers(moment):
    page = Checker(now_html(moment))
    assert "window 4 " in page.text
    assert "of 0 – 11" in page.text
    assert "50 events" in page.text
    assert f"{moment.seconds[1]:.3f} s" in page.text
    Checker(timeline_key_html(moment))


def test_provenance_names_what_the_picture_was_made_of_and_by(moment, ready):
    facts = ModelFacts("etnet-half, first weights", (0.1, 1.0))
    page = Checker(provenance_html(moment, facts, ready, 210.0))
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


def test_looks_follow_the_view_state():
    chosen = AttentionState(head=2, overlay=0.5, map_range="per map", direction="read by")
    state = ViewState(query=(3, 4)).put(chosen, ReconstructionState("robust"))
    look = look_in(state, False)
    assert (look.query, look.head, look.opacity, look.map_range) == ((3, 4), 2, 0.5, "per map")
    assert look.tones == Tones("robust", False)
    assert look.direction == "reads"  # who reads a place is shown of one site alone
    assert look_in(state.put(replace(chosen, opens_heads=True)), False).direction == "read by"
    assert look_in(ViewState(), True) is None


@pytest.mark.parametrize(
    ("value", "digits", "words"),
    [(59.5, 1, "59.5 s"), (100, 0, "1 min 40 s"), (62.5, 1, "1 min 02.5 s"), (150, 2, "2 min 30.00 s")],
)
def test_long_times_are_told_in_minutes_and_seconds_of_two_digits(value, digits, words):
    assert seconds(value, digits) == words

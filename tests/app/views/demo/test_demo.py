"""The demo's face: what is said, what can be pressed, and what a press means."""

import re
from dataclasses import replace

import numpy as np
import pytest

from app.catalogue.videos import FilmSetting, VideoShown
from app.catalogue.visitor_uploads import UploadsShown
from app.engine.downloads import Downloaded
from app.state import intents as ask
from app.state.view_state import Limits, ViewState
from app.views.demo import VIEW
from app.views.demo.html import ACTS, SAYINGS, foot_html, lead_html, pictures_html, title_of, track_html
from app.views.demo.map import APART, pointer_svg, targets
from app.views.demo.sheets import delay_html, mirror_html, sheet_html
from app.views.demo.state import (
    HOME_SLOT,
    DemoState,
    GuessFirst,
    HomeFailed,
    HomeReady,
    MirrorEnded,
    OpenSheet,
    PointAt,
    ShowLarge,
    TakeHome,
    hear,
)
from app.views.page import Choice, MirrorShown, Page
from etnet.events.events import Sensor
from etnet.nets.padding import TokenGrid
from etnet.windows import BetweenFrames, Window
from tests.app.checked_html import Checker
from tests.app.reducing import reduce

OPEN = Limits(Sensor(40, 30), [Window(i, i * 10, i * 10 + 10, i * 100_000, (i + 1) * 100_000) for i in range(60)])
PUBLIC = ViewState(workspace="demo", is_public=True, policy=BetweenFrames(), recording_id="a")


def of(state):
    return state.of(DemoState)


def page_of(moment, ready, demo=None, **changes):
    state = replace(PUBLIC, index=4).put(demo or DemoState())
    recordings = (Choice("a", "prints"), Choice("b", "my_own-take.h5"))
    return replace(
        Page(state, moment, ready, recordings=recordings, gives_home=True, mirror=MirrorShown("t")), **changes
    )


def test_every_button_of_the_demo_has_a_name_and_a_meaning(moment, ready):
    for demo in (DemoState(), DemoState(act="invite"), DemoState(large="map"), DemoState(guess="asked")):
        page = page_of(moment, ready, demo)
        for html in (lead_html(page), pictures_html(page), foot_html(page)):
            Checker(html)
            for button in re.findall(r"<button[^>]*>.*?</button>", html, re.DOTALL):
                words = re.sub("<[^>]*>", "", button).strip()
                assert words or 'aria-label="' in button, button
                key = re.search(r'data-k="demo:([^"]*)"', button)
                assert key is None or hear(key[1]) is not None, button


def test_there_is_one_slider_and_no_dropdown(moment, ready):
    html = "".join(part(page_of(moment, ready)) for part in (lead_html, pictures_html, foot_html, sheet_html))
    assert html.count('role="slider"') == 1
    assert "<select" not in html
    assert '<input type="range"' not in html


@pytest.mark.parametrize("act", ACTS)
def test_each_act_says_one_sentence_and_the_last_one_invites(moment, ready, act):
    page = page_of(moment, ready, DemoState(act=act))
    assert SAYINGS[act] in lead_html(page)
    assert ("etv-breathes" in foot_html(page)) == (act == "invite")


def test_recordings_have_titles_in_words(moment, ready):
    assert title_of(Choice("a", "prints")) == "Photographs on a wall"
    assert title_of(Choice("b", "my_own-take.h5")) == "My own take"
    assert "Another scene: My own take" in lead_html(page_of(moment, ready))


def test_what_comes_from_outside_is_escaped(moment, ready):
    page = page_of(moment, ready, recordings=(Choice("a", "prints"), Choice("<b>", "<img src=x>.h5")))
    assert "<img src=x>" not in lead_html(page)
    trouble = MirrorShown("<t>", trouble="<script>")
    html = sheet_html(page_of(moment, ready, DemoState(sheet="mirror"), mirror=trouble))
    assert "<script>" not in html
    assert "<t>" not in html


def test_a_touch_leaves_image_camera_and_map_beside_each_other(moment, ready):
    state = reduce(PUBLIC, ask.QueryFraction(0.5, 0.5), OPEN)
    assert of(state).large == "map"
    html = pictures_html(page_of(moment, ready, of(state)))
    for title in ("Where the network looks", "Image the network makes of them", "What an ordinary camera saw"):
        assert title in html
    assert of(reduce(state, ShowLarge("cloud"), OPEN)).large == "cloud"
    assert of(reduce(state, ask.OpenRecording("b"), OPEN)).large == "cloud"


def test_guessing_hides_the_images_until_they_are_asked_for(moment, ready):
    asked = reduce(PUBLIC, GuessFirst("asked"), OPEN)
    page = page_of(moment, ready, of(asked))
    assert pictures_html(page).count("etv-veiled") == 2
    assert "Show the image" in foot_html(page)
    shown = pictures_html(page_of(moment, ready, of(reduce(asked, GuessFirst("shown"), OPEN))))
    assert "etv-veiled" not in shown
    assert shown.count("etv-unveiled") == 2


def test_an_act_takes_away_what_a_visitor_opened():
    state = reduce(reduce(PUBLIC, OpenSheet("mirror"), OPEN), GuessFirst("asked"), OPEN)
    assert of(reduce(state, PointAt("image"), OPEN)) == DemoState(act="image")


def test_three_seconds_around_the_moment_are_taken_home():
    state = reduce(replace(PUBLIC, index=30, is_playing=True), TakeHome(), OPEN)
    order = of(state).order
    windows = OPEN.windows
    assert (windows[order.wanted.last].t_stop - windows[order.wanted.first].t_stop) / 1e6 == pytest.approx(
        3.0, abs=0.11
    )
    assert order.wanted.first < 30 < order.wanted.last
    assert not state.is_playing, "playing and making a page would both want the network"
    assert HOME_SLOT in VIEW.background_jobs(state, None)
    made = reduce(reduce(state, HomeReady("/home/x"), OPEN), Downloaded(HOME_SLOT), OPEN)
    assert of(made).home == "/home/x"
    assert VIEW.background_jobs(made, None) == {}


@pytest.mark.parametrize("index", [0, 2, 57, 59])
def test_near_the_ends_they_are_three_seconds_too(index):
    wanted = of(reduce(replace(PUBLIC, index=index), TakeHome(), OPEN)).order.wanted
    seconds = (OPEN.windows[wanted.last].t_stop - OPEN.windows[wanted.first].t_stop) / 1e6
    assert seconds == pytest.approx(3.0, abs=0.11)
    assert wanted.first <= index <= wanted.last


def test_before_anything_is_on_show_nothing_can_be_taken_home_and_that_is_said(moment, ready):
    state = reduce(PUBLIC, TakeHome(), Limits())
    assert of(state).order is None
    assert "try again" in sheet_html(page_of(moment, ready, of(state)))


def test_a_page_that_was_ordered_of_the_mirror_outlives_it():
    mirrored = replace(PUBLIC, recording_id="mirror-1", index=59, is_playing=True)
    ordered = reduce(mirrored, TakeHome(), OPEN)
    for is_told in (False, True):
        after = reduce(reduce(ordered, ask.OpenRecording("a"), OPEN), MirrorEnded(is_told), OPEN)
        assert of(after).order == of(ordered).order
        assert of(after).order.recording_id == "mirror-1"
        made = reduce(after, HomeReady("/home/x"), OPEN)
        assert (of(made).sheet, of(made).home) == ("home", "/home/x")
    assert of(reduce(mirrored, MirrorEnded(True), OPEN)).sheet == "mirror"
    assert of(reduce(mirrored, MirrorEnded(False), OPEN)).sheet == ""


def test_what_is_closed_is_not_wanted_any_more():
    ordered = reduce(replace(PUBLIC, index=30), TakeHome(), OPEN)
    assert VIEW.background_jobs(reduce(ordered, OpenSheet(""), OPEN), None) == {}
    made = reduce(ordered, HomeReady("/home/x"), OPEN)
    assert of(reduce(made, OpenSheet(""), OPEN)) == DemoState()


def test_a_page_that_cannot_be_made_is_told_and_nothing_is_made_on(moment, ready):
    failed = reduce(reduce(PUBLIC, TakeHome(), OPEN), HomeFailed("the <disk> is full"), OPEN)
    assert VIEW.background_jobs(failed, None) == {}
    assert "the &lt;disk&gt; is full" in sheet_html(page_of(moment, ready, of(failed)))
    assert of(reduce(failed, TakeHome(), OPEN)).trouble == ""


def test_a_page_to_take_home_is_offered_as_a_link_and_with_a_public_address_as_a_code(moment, ready):
    page = page_of(moment, ready, DemoState(sheet="home", home="/home/abc"))
    html = sheet_html(page)
    assert 'href="/home/abc"' in html
    assert "<svg" not in html
    assert "<svg" in sheet_html(replace(page, public_url="https://events.example.org"))


def test_a_host_who_switched_them_off_offers_neither_camera_nor_page(moment, ready):
    html = foot_html(page_of(moment, ready, mirror=None, gives_home=False))
    assert "Your own face" not in html
    assert "Take it home" not in html


def test_the_mirror_says_that_it_is_simulated_and_how_far_it_lags(moment, ready):
    asked = sheet_html(page_of(moment, ready, DemoState(sheet="mirror")))
    assert "simulated sensor" in asked
    assert "Nothing is stored" in asked
    live = page_of(moment, ready, mirror=MirrorShown("t", is_live=True, delay=0.24))
    assert "simulated event sensor" in lead_html(live)
    assert "0.2 s behind you" in delay_html(live)
    later = replace(live, mirror=MirrorShown("t", is_live=True, delay=1.0))
    assert sheet_html(live) == sheet_html(later)
    assert mirror_html(live) == mirror_html(later)


def test_of_the_mirror_a_page_can_be_taken_home_while_its_sliders_stay(moment, ready):
    live = page_of(moment, ready, mirror=MirrorShown("t", is_live=True))
    assert 'data-k="demo:home"' in mirror_html(live)
    assert 'data-k="demo:home"' not in mirror_html(replace(live, gives_home=False))
    asked = page_of(moment, ready, DemoState(sheet="home"), mirror=MirrorShown("t", is_live=True))
    assert "Your page is being made" in sheet_html(asked)
    assert mirror_html(asked) == mirror_html(live), "sliders that are replaced lose their place"
    assert "hidden" in mirror_html(page_of(moment, ready))
    assert "<button" not in foot_html(live), "what lies under it is nobody's to press"
    assert "half an hour" in sheet_html(page_of(moment, ready, DemoState(sheet="mirror")))
    assert "half an hour" not in sheet_html(page_of(moment, ready, DemoState(sheet="mirror"), gives_home=False))


def test_a_video_that_becomes_dots_says_how_far_it_is(moment, ready):
    film = VideoShown(FilmSetting(), done=3.2, total=12.0, work=1.0, is_over=False)
    assert "3.2 of 12.0 s" in pictures_html(page_of(moment, ready, video=film))
    assert "3.2 of 12.0 s" in pictures_html(page_of(None, None, video=film))
    assert "of 12.0 s" not in pictures_html(page_of(moment, ready, video=replace(film, is_over=True)))


def test_without_a_camera_there_are_videos_to_choose_from(moment, ready):
    listed = (Choice("a", "prints"), Choice("v", "<clip>.mp4", is_film=True))
    html = sheet_html(page_of(moment, ready, DemoState(sheet="mirror"), recordings=listed))
    assert 'data-k="open:v"' in html
    assert "&lt;clip&gt;.mp4, as dots" in html
    assert 'data-k="open:a"' not in html
    handed = page_of(moment, ready, DemoState(sheet="mirror"), uploads=UploadsShown("64 MB", coming=("mine.mp4", 0.4)))
    assert "mine.mp4, 40%" in sheet_html(handed)


def test_the_track_tells_where_the_moment_is(moment):
    html = track_html(moment)
    now, end = (float(re.search(rf'{name}="([\d.]+)"', html)[1]) for name in ("aria-valuenow", "aria-valuemax"))
    assert now == pytest.approx(moment.seconds[1], abs=0.01)
    assert 0 < now <= end


class Attention:
    """As much of an attention as the pointer needs."""

    grid = TokenGrid(80, 96)


def test_the_pointer_goes_to_the_strongest_places_and_they_lie_apart():
    grid = Attention.grid
    row = np.random.default_rng(0).random(grid.rows * grid.columns)
    query = grid.pixel_of(37)
    found = targets(Attention(), row, query)
    assert len(found) == 4
    places = [divmod(grid.token_at(int(x), int(y)), grid.columns) for x, y in [query, *found]]
    for i, one in enumerate(places):
        assert all(max(abs(one[0] - o[0]), abs(one[1] - o[1])) >= APART for o in places[:i])
    svg = pointer_svg((1.0, 2.0), found, (96, 80))
    times = [float(t) for t in re.search(r'keyTimes="([^"]*)"', svg)[1].split(";")]
    assert times == sorted(times)
    assert (times[0], times[-1]) == (0.0, 1.0)
    assert len(times) == len(re.search(r'keyPoints="([^"]*)"', svg)[1].split(";"))

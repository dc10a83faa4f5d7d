"""What the page says of a live source: what was lost or merged, how pixels were joined, what the driver holds up."""

import pytest

from app.catalogue.live import LiveShown
from app.html.live import counts_of, live_badge, live_line
from app.state.view_state import ViewState
from app.views.live.html import source_html
from app.views.page import Page
from etnet.events.events import Sensor


def shown(**changes) -> LiveShown:
    """A source of which nothing was lost, as the page is told."""
    facts = {
        "id": "live-1", "name": "Stand-in 7", "format": "made up", "sensor": Sensor(1280, 720),
        "seen": Sensor(320, 180), "downsample": 4, "windowing": "windows of 20 ms", "seconds": 75.0,
        "gone_before": 0.0, "keep_seconds": 60.0, "num_events": 12_345, "num_lost": 0, "num_held_up": 0,
        "num_merged": 0, "num_unseen": 0, "notes": (), "news": "", "recording": None, "recorded": (),
        "settings": (), "is_over": False,
    }  # fmt: skip
    return LiveShown(**{**facts, **changes})


def tab(**changes) -> str:
    return source_html(Page(ViewState(), live=shown(**changes)))


@pytest.mark.parametrize(
    ("found", "words"),
    [
        ({"num_lost": 1}, "1 packet lost"),
        ({"num_lost": 1_200}, "1,200 packets lost"),
        ({"num_held_up": 1}, "1 event out of order"),
        ({"num_merged": 1}, "1 window merged"),
        ({"num_merged": 31, "num_unseen": 2}, "31 windows merged, 2 events unseen"),
        ({"num_lost": 3, "num_held_up": 4}, "3 packets lost, 4 events out of order"),
    ],
)
def test_what_was_lost_or_merged_is_counted_beside_the_time_and_in_the_tab(found, words):
    live = shown(**found)
    assert counts_of(live) == words
    assert f'<span data-testid="live-counts">{words}</span>' in live_line(live, is_live=True, follows=True, gone="")
    assert f"<dt>Lost or merged</dt><dd>{words}</dd>" in tab(**found)


def test_where_nothing_was_lost_nothing_is_counted_and_the_tab_says_so():
    assert "live-counts" not in live_line(shown(), is_live=True, follows=True, gone="")
    assert "<dt>Lost or merged</dt><dd>nothing</dd>" in tab()


def test_a_page_in_public_counts_nothing_beside_the_time():
    assert "live-counts" not in live_line(shown(num_lost=7), is_live=True, follows=True, gone="", is_public=True)


def test_pixels_that_are_joined_for_the_network_are_said():
    assert "320×180 pixels: binned 4×4, so that it keeps up; --downsample 1 shows every pixel" in tab()
    assert "<dt>Network sees</dt><dd>every pixel</dd>" in tab(downsample=1)


def test_what_has_left_the_buffer_is_said_and_what_will():
    assert "gone: before 15.0 s; the last 60 s or less are held" in tab(gone_before=15.0)
    assert "everything; what is older than 60 s will leave" in tab()


def test_how_long_packets_lie_in_the_driver_is_said_where_there_is_one():
    assert "<dt>Driver</dt><dd>fetched after 4.2 ms, 1 packet waiting</dd>" in tab(
        driver_delay=0.0042, driver_backlog=1
    )
    assert "fetched after 1.50 s, 2,048 packets waiting" in tab(driver_delay=1.5, driver_backlog=2048)
    assert "Driver" not in tab()


def test_the_badge_says_how_far_the_image_is_behind_or_how_long_ago_it_was():
    assert ">Live, 140 ms behind<" in live_badge(shown(behind=0.14), follows=True, stamp_seconds=75.0)
    assert ">8.0 s ago<" in live_badge(shown(), follows=False, stamp_seconds=67.0)
    assert "The source has ended" in live_badge(shown(is_over=True), follows=True, stamp_seconds=75.0)

"""The strip and the numbers above it: everything stands where it is in time."""

import pytest

from app.html.moment import Moment
from app.html.timeline_marks import curve_of, place_of
from app.views.timeline.html import legend_html, now_html, timeline_html
from etnet.windows import plan_windows
from tests.app.checked_html import Checker
from tests.app.fakes import POLICY


def test_the_curve_of_a_plan_that_grows_grows_with_it(recording):
    windows = plan_windows(recording, POLICY)
    part, whole = (Moment("growing", POLICY, 1, recording, some) for some in (windows[:3], windows))
    assert curve_of(part).indices[-1] == 2
    assert curve_of(whole).indices[-1] == len(windows) - 1
    assert timeline_html(part) != timeline_html(whole)


def test_on_the_timeline_everything_stands_where_it_is_in_time(moment):
    cached = type("Cached", (), {"frames": (range(2, 4),), "states": (range(6),), "is_exact": True})()
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
    assert f"{moment.seconds[1]:.3f} s" in page.text
    Checker(legend_html(moment, is_approximate=True, is_changed=True))

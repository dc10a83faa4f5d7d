"""What a view of one's own is asked and when: each moment once, the newest wins, and what is former is called so."""

import contextlib
import queue
import threading
from dataclasses import replace

import numpy as np
import pytest

from app.engine.requests import FrameRequest, Ready
from app.html.moment import Moment
from app.state.view_state import ViewState
from app.views.own.load import OwnViewError, own_views
from app.views.own.panel import OwnPanel
from app.views.own.values import OwnView
from app.views.page import Page
from etnet.windows import BetweenFrames, plan_windows
from tests.app.fake_gui import FakeGui
from tests.app.stand_ins import CONTRACT, recording

POLICY, PATIENCE = BetweenFrames(), 60
OPENED = recording()
WINDOWS = plan_windows(OPENED, POLICY)


class Tab:
    """A tab that is drawn again for each thing it says, as a visitor's page does."""

    def __init__(self, show, **widgets):
        self.panel, self.gui, self._said = (
            OwnPanel("own", OwnView("Own", "own.py", show, widgets)),
            FakeGui(),
            queue.Queue(),
        )
        self.panel.build_settings(self.gui, self._said.put)
        self.page = page_at(0)

    @property
    def content(self):
        return self.gui.html[0].content

    @property
    def lag(self):
        return self.gui.html[1].content

    def draw(self, page=None):
        self.page = page or self.page
        self.panel.show_settings(self.page)

    def until(self, is_there):
        """Draw whenever it is told to, until something is so."""
        while not is_there():
            self._said.get(timeout=PATIENCE)
            self.draw()

    def rest(self):
        """Draw until nothing is computed and nothing more is said."""
        while self.panel._is_running or not self._said.empty():
            with contextlib.suppress(queue.Empty):
                self._said.get(timeout=0.02)
                self.draw()


def ready_at(index, **more):
    request = FrameRequest("a", "m", "fp32", POLICY, index)
    frame = np.full((30, 40), 0.5, np.float32)
    return replace(Ready(request, frame, None, 1.0, True, False, False, CONTRACT, index), **more)


def page_at(index, ready=None, **more):
    return Page(
        ViewState("a", "m", policy=POLICY, index=index, **more), Moment("a", POLICY, index, OPENED, WINDOWS), ready
    )


def test_each_moment_is_computed_once_however_often_the_page_is_drawn_meanwhile():
    calls, begun, gate = [], threading.Event(), threading.Event()

    def show(moment):
        calls.append(moment.window.index)
        begun.set()
        assert gate.wait(PATIENCE)
        return f"seen {moment.window.index}"

    tab = Tab(show)
    tab.draw()
    assert begun.wait(PATIENCE)
    for _ in range(5):
        tab.draw()
    gate.set()
    tab.until(lambda: "seen 0" in tab.content)
    tab.rest()
    tab.draw(page_at(1))
    tab.until(lambda: "seen 1" in tab.content)
    tab.rest()
    assert calls == [0, 1]


def test_a_generator_runs_once_and_what_it_came_to_stays():
    begun = []

    def show(moment):
        begun.append(moment.window.index)
        yield "first part"
        yield "second part"
        yield "whole"

    tab = Tab(show)
    tab.draw()
    tab.until(lambda: "whole" in tab.content)
    tab.rest()
    assert begun == [0]
    assert "whole" in tab.content
    assert tab.lag == ""


def test_a_generator_of_a_former_moment_ends_at_its_next_part_and_is_called_former_until_the_next_answer():
    gate, drawn, ended = threading.Event(), [], []

    def show(moment):
        index = moment.window.index
        if index:
            return iter([f"part of {index}"])
        return slow(index)

    def slow(index):
        try:
            for part in range(1000):
                drawn.append(part)
                yield f"part {part} of {index}"
                assert gate.wait(PATIENCE)
        finally:
            ended.append(index)

    tab = Tab(show)
    tab.draw()
    tab.until(lambda: "part 0 of 0" in tab.content)
    assert tab.lag == ""
    tab.draw(page_at(1))
    assert "shows a former moment; the current one follows" in tab.lag
    assert "part 0 of 0" in tab.content
    gate.set()
    tab.until(lambda: "part of 1" in tab.content)
    tab.rest()
    assert ended == [0]
    assert drawn in ([0], [0, 1])
    assert (tab.lag, "part of 1" in tab.content) == ("", True)


def test_a_frame_that_stands_in_is_not_given_out_as_that_of_the_window():
    tab = Tab(lambda moment: f"frame {moment.frame is not None}")
    tab.draw(page_at(0, ready_at(0, is_exact=False, is_former=True)))
    tab.until(lambda: "frame False" in tab.content)
    tab.draw(page_at(0, ready_at(0)))
    tab.until(lambda: "frame True" in tab.content)
    tab.draw(page_at(1, ready_at(0)))
    tab.until(lambda: "frame False" in tab.content)
    tab.rest()


def test_it_is_called_again_when_attention_has_come():
    tab = Tab(lambda moment: f"attention {moment.attention}")
    tab.draw(page_at(0, ready_at(0), query=(3, 4)))
    tab.until(lambda: "attention None" in tab.content)
    tab.draw(page_at(0, ready_at(0, attention="maps"), query=(3, 4)))
    tab.until(lambda: "attention maps" in tab.content)
    tab.rest()


@pytest.mark.parametrize(
    ("first", "value"), [((3, 5), 3), ([2.5, 1], 2.5), ((True, False, True), True), (("a", "b"), "a"), (7, 7)]
)
def test_what_is_chosen_of_a_list_arrives_as_what_the_file_wrote(first, value):
    given = []
    tab = Tab(lambda moment, which: given.append(which) or "seen", which=first)
    tab.draw()
    tab.until(lambda: "seen" in tab.content)
    tab.rest()
    assert [(each, type(each)) for each in given] == [(value, type(value))]


@pytest.mark.parametrize(
    ("first", "step"), [((0, 179, 90), 1), ((0, 1, 0), 1), ((0.0, 1.0, 0.5), 0.01), ((0, 50, 2.5), 0.5)]
)
def test_a_slider_of_whole_numbers_steps_by_one_and_skips_none(first, step):
    tab = Tab(lambda moment, row: row, row=first)
    low, high, value = first
    assert tab.gui.widgets["Row"].range == (low, high, pytest.approx(step))
    assert tab.gui.widgets["Row"].value == value


@pytest.mark.parametrize(
    "first", [(1, 2, 4), (5, 5, 5), (3, 1, 2), [1, 2, 4], (0.0, float("nan"), 0.0), (0, float("inf"), 1)]
)
def test_a_slider_that_no_page_can_show_is_refused_in_one_line(tmp_path, first):
    path = tmp_path / "mine.py"
    path.write_text(
        f"nan = float('nan')\ninf = float('inf')\nwidgets = {{'rows': {first!r}}}\ndef show(moment, rows):\n    pass\n"
    )
    with pytest.raises(OwnViewError, match=r"mine\.py: widget rows is .* three numbers are a slider") as refused:
        own_views([path])
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize("declared", ["[1]", "{1: 2}", "None"])
def test_widgets_that_are_no_names_with_values_are_refused(tmp_path, declared):
    path = tmp_path / "mine.py"
    path.write_text(f"widgets = {declared}\ndef show(moment):\n    pass\n")
    with pytest.raises(OwnViewError, match="wanted a dict"):
        own_views([path])

"""A patch that is followed: its path begins where it was chosen, and map, curve and kymograph stay on it."""

from dataclasses import replace

import numpy as np
import pytest

from app.engine.jobs import JobResult
from app.engine.requests import FrameRequest
from app.html.moment import Moment
from app.state import intents as ask
from app.state.view_state import Limits
from app.views import VIEWS
from app.views.attention.html.shelf import time_html
from app.views.attention.html.shown import shown_of
from app.views.attention.html.side import side_html
from app.views.attention.html.stage import stage_html
from app.views.attention.jobs.attention import attention_jobs
from app.views.attention.jobs.time import CurveJob, PathJob
from app.views.attention.state import AttentionState, PinMap, hear, reduce_attention
from app.views.export.panel import ExportPanel
from app.views.inspect.jobs.inspect import inspect_jobs
from app.views.inspect.state import InspectState
from app.views.page import Page
from app.views.view import Here, reduce_views
from etnet.errors import ModelError
from etnet.events.events import Sensor
from etnet.inspection import follow
from etnet.windows import ByCount
from tests.app.checked_html import Checker
from tests.app.fake_gui import FakeGui
from tests.app.small_loaded import POLICY, QUERY, SITE, request_of, whole
from tests.app.views.attention.small_page import INDEX, STATE, ready_of
from tests.app.views.attention.test_lines import moving

FOLLOWED = AttentionState(site=SITE, follows=True, anchor=INDEX)
LIMITS = Limits(Sensor(38, 21))


def test_the_window_of_the_query_is_kept_while_its_patch_is_followed():
    state = STATE.put(AttentionState(site=SITE))

    def after(intent, state):
        return reduce_views(state, intent, LIMITS, VIEWS)

    def anchor(state):
        return state.of(AttentionState).anchor

    assert anchor(after(ask.Query(3, 4), state)) is None  # nothing is followed
    state = after(ask.Set("attention", "follows", True), state)
    assert anchor(state) == INDEX
    state = after(ask.Move(2), state)
    assert (state.index, anchor(state)) == (INDEX + 2, INDEX)
    assert anchor(after(ask.Query(3, 4), state)) == INDEX + 2
    assert anchor(after(ask.QueryFraction(0.5, 0.5), state)) == INDEX + 2
    assert anchor(after(ask.MoveQuery(8, 0), state)) == INDEX + 2
    assert anchor(after(ask.Set("attention", "follows", False), state)) is None
    assert anchor(after(ask.ChoosePolicy(ByCount(99)), state)) is None  # its windows have other numbers
    kept = state.put(replace(state.of(AttentionState), anchor=None))  # as a stored view comes back
    assert anchor(after(ask.Move(-1), kept)) == INDEX + 2


def test_a_path_is_the_same_whichever_of_its_windows_is_looked_at():
    for slot in ("attention.path", "attention.curve"):
        jobs = [attention_jobs(STATE.put(FOLLOWED), request_of(index))[slot] for index in (1, INDEX, 7)]
        assert jobs == [jobs[0]] * 3
    inside = InspectState(opened="time")
    state = STATE.put(FOLLOWED, inside)
    followed = [inspect_jobs(state, request_of(index))["inspect.followed"] for index in (1, INDEX, 7)]
    assert followed == [followed[0]] * 3


def page_at(loaded, index, slice_=FOLLOWED):
    request = FrameRequest("follow", "m", "fp32", POLICY, index, wants_attention=True)
    state = replace(STATE, index=index).put(slice_)
    asked = attention_jobs(state, request)
    wanted = {slot: asked[slot] for slot in ("attention.path", "attention.curve")}
    results = {slot: JobResult(job, whole(job, loaded), 1.0, True) for slot, job in wanted.items()}
    moment = Moment("follow", POLICY, index, loaded.playback.recording, loaded.playback.windows)
    return Page(state, moment, ready_of(loaded, request), results=results)


def test_the_map_goes_with_the_patch(loaded, monkeypatch):
    monkeypatch.setattr(follow, "follow", moving)
    for index in (INDEX - 2, INDEX, INDEX + 2):
        page = page_at(loaded, index)
        shown = shown_of(page)
        place = QUERY[0] + 3 * (index - INDEX), QUERY[1]
        assert shown.look.query == place
        attention, token = shown.attention, shown.grid.token_at(*place)
        assert np.array_equal(shown.row(), attention.rows(SITE, [token])[:, 0].mean(0).numpy())
        html = stage_html(page)
        assert f'data-etv-query="{place[0]},{place[1]}"' in html[3]
        said = Checker(side_html(page)).text
        assert f"Query: pixel {place[0]}, {place[1]}" in said
        assert f"the patch that lies at {QUERY[0]}, {QUERY[1]} in window {INDEX}" in said
        key = "attention:pin:a" if index == INDEX else f"attention:pin:a:{place[0]},{place[1]}"
        assert key in Checker(html[2]).keys
        curve = page.results["attention.curve"].value
        assert curve.pixels[curve.indices.index(index)] == place
        assert 'class="et-head-line"' in time_html(page)[2]


def test_a_patch_that_has_left_the_image_is_said_to_have_left(loaded, monkeypatch):
    monkeypatch.setattr(follow, "follow", moving)
    there, gone = (page_at(loaded, index, replace(FOLLOWED, anchor=0)) for index in (5, 6))
    assert shown_of(there).look.query == (35, QUERY[1])
    assert not shown_of(there).is_lost
    assert shown_of(gone).is_lost  # at 38, where the sensor ends
    assert shown_of(gone).look.query == QUERY
    assert "has left the image" in side_html(gone)
    curve = CurveJob(request_of(7), QUERY, SITE, "entropy", None, 0)
    with pytest.raises(ModelError, match="has left the image before these windows"):
        whole(curve, loaded)


def test_a_pin_of_a_followed_patch_is_of_the_pixel_where_it_lies():
    assert hear("pin:a:23,9") == PinMap("a", (23, 9))
    assert hear("pin:b") == PinMap("b")
    assert hear("pin:c:1,2") is None
    assert hear("pin:a:x,2") is None
    slice_ = reduce_attention(FOLLOWED, PinMap("a", (23, 9)), Here(STATE, Limits()))
    assert slice_.pin_a.query == (23, 9)


def test_a_sheet_that_is_exported_has_the_maps_of_the_place_where_the_followed_patch_lies(loaded, monkeypatch):
    monkeypatch.setattr(follow, "follow", moving)
    page = page_at(loaded, INDEX + 1)
    place = (QUERY[0] + 3, QUERY[1])
    assert shown_of(page).look.query == place
    panel, gui = ExportPanel(), FakeGui()
    panel.build_settings(gui, lambda _: None)
    gui.widgets["Format"].value = "Picture of this window (PNG)"
    for picture, pixel in (
        ("attention maps of the pixel", place),
        ("the whole layout", place),
        ("reconstruction", None),
    ):
        gui.widgets["Picture"].value = picture
        panel.show_settings(page)
        assert panel._chosen().pixel == pixel
    panel.show_settings(replace(page, state=page.state.put(AttentionState(site=SITE))))
    gui.widgets["Picture"].value = "the whole layout"
    assert panel._chosen().pixel is None


@pytest.mark.parametrize("anchor", [0, INDEX, 7])
def test_a_curve_is_of_the_windows_around_the_current_one_from_wherever_the_patch_comes(loaded, anchor, monkeypatch):
    monkeypatch.setattr(follow, "follow", moving)
    curve = whole(CurveJob(request_of(0), QUERY, SITE, "entropy", None, anchor), loaded)
    path = whole(PathJob(request_of(0), QUERY, anchor), loaded)
    inside = [index for index in range(8) if 0 <= QUERY[0] + 3 * (index - anchor) < 38]
    assert curve.indices == tuple(inside) == tuple(sorted(path))
    assert curve.pixels == tuple(path[index] for index in inside)


def test_the_lines_of_the_heads_have_names_and_are_chosen_by_a_click(loaded):
    page = Checker(time_html(page_at(loaded, INDEX, AttentionState(site=SITE, follows=True, anchor=INDEX)))[2])
    keys = [attrs["data-k"] for attrs in page.by_testid("curve")]
    assert keys == [f"set:attention.head:{head}" for head in range(4)]
    assert [f"head {head}" in page.text for head in range(4)] == [True] * 4

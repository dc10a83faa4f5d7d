"""Moments against moments, and the lines of Python that give what the cards show."""

from dataclasses import replace

import numpy as np
import pytest

from app.engine.jobs import JobResult
from app.engine.requests import FrameRequest
from app.state.view_state import Limits
from app.views.attention.html.code import snippet
from app.views.attention.html.shown import shown_of
from app.views.attention.html.side import side_html
from app.views.attention.html.stage import stage_html
from app.views.attention.jobs.time import PinJob
from app.views.attention.state import AttentionState, PinMap, Unpin, reduce_attention
from app.views.inspect.state import Change, InspectState
from app.views.view import Here
from etnet.inspection import pins
from etnet.nets.intervention import Intervention
from tests.app.checked_html import Checker, map_values
from tests.app.small_loaded import POLICY, QUERY, SITE
from tests.app.views.attention.small_page import INDEX, STATE


def test_a_pin_keeps_its_moment_network_and_change():
    mask = Intervention(masked_heads=frozenset({(SITE, 2)}))
    here = Here(STATE.put(InspectState(change=Change(mask))), Limits())
    slice_ = reduce_attention(AttentionState(site=SITE, head=3), PinMap("a"), here)
    assert slice_.pin_a.request == FrameRequest("r", "m", STATE.precision, POLICY, INDEX, intervention=mask)
    assert (slice_.pin_a.site, slice_.pin_a.head, slice_.pin_a.query) == (SITE, 3, QUERY)
    assert slice_.compare == "a"
    assert reduce_attention(slice_, Unpin("a"), here).pin_a is None
    assert reduce_attention(slice_, Unpin("a"), here).compare == "none"
    nowhere = Here(replace(STATE, query=None), Limits())
    assert reduce_attention(AttentionState(), PinMap("a"), nowhere) == AttentionState()


def test_a_minus_b_is_the_signed_log_ratio_with_both_frames_below(loaded, page_of):
    then = Here(replace(STATE, index=2), Limits())
    slice_ = reduce_attention(AttentionState(site=SITE), PinMap("a"), then)
    html = stage_html(page_of(slice_, [("pin", PinJob(slice_.pin_a))]))[3]
    page = Checker(html)
    (shown,) = map_values(html)
    pair = [pins.pin(loaded.playback, index, QUERY, SITE, "mean") for index in (INDEX, 2)]
    expected = pins.difference(*pair).log_ratio
    assert np.allclose(shown, expected.numpy(), atol=1e-6)
    assert len(page.by_testid("a-minus-b")) == 1
    assert "window 2" in page.text
    assert "window 5" in page.text
    assert html.count("et-frames-below") == 1
    assert "× more then" in side_html(page_of(slice_, [("pin", PinJob(slice_.pin_a))]))


def test_a_map_pinned_now_differs_from_itself_by_nothing(page_of):
    slice_ = reduce_attention(AttentionState(site=SITE), PinMap("b"), Here(STATE, Limits()))
    html = stage_html(page_of(slice_, [("pin", PinJob(slice_.pin_b))]))[3]
    assert "now and B share 100 % of their weight" in html
    assert np.abs(map_values(html)[0]).max() < 1e-4


def test_lines_of_python_are_offered_for_the_map_and_for_a_difference(page_of):
    page = replace(page_of(AttentionState(site=SITE, over="python")), file_name="made up.txt")
    assert "array = entropy.choose_head(attention.rows" in Checker(stage_html(page)[3]).text
    slice_ = reduce_attention(AttentionState(site=SITE), PinMap("a"), Here(STATE, Limits()))
    both = replace(page_of(slice_, [("pin", PinJob(slice_.pin_a))]), file_name="made up.txt")
    assert "pins.difference" in snippet(shown_of(both))


@pytest.mark.parametrize(
    ("gather", "direction"), [("max", "attends to"), ("min", "attends to"), ("mean", "attended by")]
)
def test_a_map_shares_all_of_its_weight_with_itself_whatever_it_sums_to(page_of, gather, direction):
    slice_ = AttentionState(site=SITE, gather=gather, direction=direction)
    slice_ = reduce_attention(slice_, PinMap("a"), Here(STATE, Limits()))
    html = stage_html(page_of(slice_, [("pin", PinJob(slice_.pin_a))]))[3]
    assert "now and A share 100 % of their weight" in html


def test_why_a_pin_cannot_be_computed_is_said_while_the_map_is_held_against_it(page_of):
    slice_ = reduce_attention(AttentionState(site=SITE), PinMap("a"), Here(STATE, Limits()))
    gone = {"attention.pin": JobResult(PinJob(slice_.pin_a), trouble="its events have left the <buffer>")}
    said = Checker(stage_html(replace(page_of(slice_), results=gone))[3])
    assert "Pin A cannot be computed, so the map stands alone: its events have left the <buffer>" in said.text
    for other in (replace(slice_, compare="none"), replace(slice_, pin_a=replace(slice_.pin_a, head=1))):
        assert not Checker(stage_html(replace(page_of(other), results=gone))[3]).by_testid("no-pin")

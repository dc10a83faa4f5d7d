"""A change from here on: the twin is two sequential runs; the search for a cause ends where a full scan would."""

from itertools import pairwise

import pytest
import torch

from etnet.errors import Cancelled, ModelError
from etnet.events.edit import EventEdit
from etnet.inspection.causal_search import events_of, reset_once, search_cause
from etnet.inspection.twin import EffectCurve, changed, twin
from etnet.nets.adapter import Adapter
from etnet.nets.intervention import ORIGINAL, Intervention
from etnet.playback.playback import Playback
from etnet.reconstruction import window_events, window_voxel
from tests.inspection.small import NUM_WINDOWS, small_playback
from tests.inspection.test_anatomy import _integrate

PIXEL, AT = (20, 9), 3
ZERO = Intervention(zeroed_levels=frozenset({1, 2, 3}))
NO_SKIP = Intervention(removed_skips=frozenset({1}), masked_heads=frozenset({("scale1.encoder.0.self", 2)}))


def _sequential(playback: Playback, change: Intervention, edit: EventEdit, until: int) -> list[torch.Tensor]:
    """Every frame in order by the network alone; the change holds in windows AT … until − 1."""
    state, frames = None, []
    for window in playback.windows:
        holds = AT <= window.index < until
        voxel = window_voxel(playback.model, playback.recording, window, *([edit] if holds else []))[None]
        with torch.inference_mode():
            step = playback.model(voxel, state, None, change if holds else ORIGINAL)
        state = step.state
        frames.append(step.frame[0, 0])
    return frames


@pytest.mark.parametrize("once", [False, True])
@pytest.mark.parametrize(
    ("change", "edit"), [(ZERO, EventEdit()), (NO_SKIP, EventEdit()), (ORIGINAL, EventEdit(drop=0.4, seed=3))]
)
def test_a_twin_is_two_sequential_runs(change: Intervention, edit: EventEdit, once: bool):
    playback = small_playback()
    original = _sequential(playback, ORIGINAL, EventEdit(), 0)
    other = _sequential(playback, change, edit, AT + 1 if once else NUM_WINDOWS)
    # In any order: a page asks for what is on screen first.
    for moment in twin(playback, changed(playback, AT, change, edit, once), (7, 2, 3, 4, 5, 6)):
        assert torch.equal(moment.original, original[moment.index])
        assert torch.equal(moment.changed, other[moment.index])
        assert torch.equal(moment.difference, other[moment.index] - original[moment.index])
        assert moment.t == playback.windows[moment.index].t_stop


def test_the_curve_is_made_of_the_differences_and_shows_the_recovery():
    playback = small_playback()
    moments = list(twin(playback, changed(playback, AT, ZERO, once=True), range(1, NUM_WINDOWS)))
    curve = EffectCurve.of(moments, PIXEL)
    assert curve.index.tolist() == list(range(1, 8))
    assert curve.at_pixel is not None
    for place, moment in enumerate(moments):
        assert float(curve.mean_absolute[place]) == pytest.approx(float(moment.difference.abs().mean()))
        assert float(curve.at_pixel[place]) == pytest.approx(float(moment.difference[PIXEL[1], PIXEL[0]]))
    assert curve.largest[:2].eq(0).all()
    assert curve.largest[2] == curve.largest.max()
    assert curve.recovered_at(float(curve.largest[4])) == 5
    assert curve.recovered_at(1.0) == 1
    assert curve.recovered_at(-1.0) is None
    assert EffectCurve.of(moments).at_pixel is None


def test_a_single_change_before_a_branch_leaves_the_branchs_own_change():
    playback = small_playback()
    branch = playback.branch(5, NO_SKIP)
    once = changed(branch, 2, ZERO, once=True)
    assert [once.intervention_at(index) for index in range(1, 7)] == [
        ORIGINAL, ZERO, ORIGINAL, ORIGINAL, NO_SKIP, NO_SKIP,
    ]  # fmt: skip


def test_a_twin_at_the_last_window_and_one_nobody_wants():
    playback = small_playback()
    last = changed(playback, NUM_WINDOWS - 1, ZERO, once=True)
    assert not torch.equal(last.at(NUM_WINDOWS - 1).frame, playback.at(NUM_WINDOWS - 1).frame)
    with pytest.raises(Cancelled, match="this twin"):
        next(twin(playback, last, [1], cancelled=lambda: True))
    with pytest.raises(ValueError, match="at least one moment"):
        EffectCurve.of([])


def _scan(playback: Playback, index: int, levels: frozenset[int]) -> list[float]:
    """|change| of the pixel for a reset at every window up to `index`."""
    original = playback.at(index).frame[0, 0, PIXEL[1], PIXEL[0]]
    values = [reset_once(playback, at, levels).at(index).frame[0, 0, PIXEL[1], PIXEL[0]] for at in range(index + 1)]
    return [abs(float(value) - float(original)) for value in values]


@pytest.mark.parametrize("levels", [frozenset({1}), frozenset({1, 2, 3})])
def test_the_search_ends_where_a_full_scan_finds_the_first_change(levels: frozenset[int]):
    playback, index = small_playback(), 7
    scan = _scan(playback, index, levels)
    assert scan[0] == 0
    for tolerance in sorted({(a + b) / 2 for a, b in pairwise(scan) if a + b > 1e-6}):
        *_, found = search_cause(playback, index, PIXEL, levels, tolerance)
        assert found.is_done
        if found.changes_at is None:
            assert scan[index] < tolerance
            continue
        assert scan[found.changes_at] >= tolerance
        assert scan[found.changes_at - 1] < tolerance
        assert found.entered_at == found.changes_at - 1 == found.leaves_at
        if all(a <= b for a, b in pairwise(scan)):
            assert found.changes_at == next(at for at, effect in enumerate(scan) if effect >= tolerance)
        assert len(found.trials) <= 2 + 3
        events = events_of(playback, found)
        assert events is not None
        assert len(events) == len(window_events(playback.recording, playback.windows[found.entered_at]))


def test_a_search_says_that_no_reset_matters_and_that_the_cause_lies_further_back():
    playback = small_playback()
    (nothing,) = search_cause(playback, 7, PIXEL, tolerance=10.0)
    assert nothing.is_done
    assert nothing.changes_at is nothing.entered_at is events_of(playback, nothing) is None
    *_, beyond = search_cause(playback, 7, PIXEL, tolerance=1e-9, furthest=2)
    assert beyond.is_done
    assert (beyond.changes_at, beyond.leaves_at, beyond.entered_at) == (5, None, None)


def test_only_a_change_towards_the_wanted_value_counts():
    playback = small_playback()
    value = float(playback.at(7).frame[0, 0, PIXEL[1], PIXEL[0]])
    reset = float(reset_once(playback, 7, frozenset({1, 2, 3})).at(7).frame[0, 0, PIXEL[1], PIXEL[0]])
    tolerance = abs(reset - value) / 2
    first = next(search_cause(playback, 7, PIXEL, tolerance=tolerance, towards=reset))
    assert first.trials[0].changes
    away = next(search_cause(playback, 7, PIXEL, tolerance=tolerance, towards=2 * value - reset))
    assert not away.trials[0].changes


def test_a_search_needs_levels_and_can_be_given_up():
    own = Playback(Adapter(_integrate, name="mine"), small_playback().recording, small_playback().windows)
    with pytest.raises(ModelError, match="names no part"):
        next(search_cause(own, 3, PIXEL))
    with pytest.raises(ModelError, match=r"levels \[4\]"):
        next(search_cause(small_playback(), 3, PIXEL, frozenset({4})))
    with pytest.raises(ValueError, match="tolerance"):
        next(search_cause(small_playback(), 3, PIXEL, tolerance=0))
    playback = small_playback()
    playback.at(3)
    with pytest.raises(Cancelled):
        next(search_cause(playback, 3, PIXEL, cancelled=lambda: True))

"""An edit of events is a value: nothing is nothing, and an event's fate hangs on its seed and index alone."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from etnet.events.edit import UNEDITED, EventEdit
from etnet.events.events import Events
from tests.strategies import make_events

EVENTS = make_events(2000)
SHARES = st.floats(0, 1)


def _columns(events: Events) -> tuple[np.ndarray, ...]:
    return events.x, events.y, events.t, events.p


def _equal(first: Events, second: Events) -> bool:
    return all(np.array_equal(a, b) for a, b in zip(_columns(first), _columns(second), strict=True))


def test_an_edit_of_nothing_gives_the_very_same_events():
    assert UNEDITED.applied(EVENTS, 0) is EVENTS
    assert EventEdit(jitter=1.0, jitter_by=0).applied(EVENTS, 0) is EVENTS
    assert EventEdit(seed=7).changes_nothing


@given(SHARES, SHARES, SHARES, st.integers(0, 2**40), st.integers(0, 2**40))
def test_the_same_seed_gives_the_same_events_and_time_stays_in_order(drop, invert, jitter, seed, first):
    edit = EventEdit(drop, invert, jitter, seed=seed)
    edited = edit.applied(EVENTS, first)
    assert _equal(edited, edit.applied(EVENTS, first))
    assert (np.diff(edited.t) >= 0).all()
    assert set(np.unique(edited.p)) <= {-1, 1}
    if len(edited):
        assert edited.t[0] >= EVENTS.t[0]
        assert edited.t[-1] <= EVENTS.t[-1]


@given(st.integers(0, 2000), st.integers(0, 2000), st.integers(0, 10**9))
def test_an_events_fate_does_not_hang_on_its_window(start: int, stop: int, first: int):
    start, stop = min(start, stop), max(start, stop)
    edit = EventEdit(drop=0.3, invert=0.4, seed=3)
    whole, before, part = (
        edit.applied(EVENTS[piece], first + piece.start)
        for piece in (slice(0, stop), slice(0, start), slice(start, stop))
    )
    assert _equal(whole, Events.concatenate([before, part], EVENTS.sensor))


@pytest.mark.parametrize("share", [0.1, 0.5, 1.0])
def test_shares_are_kept(share: float):
    assert len(EventEdit(drop=share).applied(EVENTS, 5)) / len(EVENTS) == pytest.approx(1 - share, abs=0.04)
    inverted = EventEdit(invert=share).applied(EVENTS, 5)
    assert (inverted.p != EVENTS.p).mean() == pytest.approx(share, abs=0.04)
    # Jitter reorders, so stamps are compared as sets of (pixel, stamp); pixels are told apart by a running number.
    number = np.arange(len(EVENTS))
    x, y = (number % 500).astype(np.uint16), (number // 500).astype(np.uint16)
    numbered = Events(x, y, EVENTS.t, EVENTS.p, EVENTS.sensor)
    moved = EventEdit(jitter=share, jitter_by=10_000).applied(numbered, 5)
    back = np.argsort(moved.y.astype(int) * 500 + moved.x, kind="stable")
    assert (moved.t[back] != numbered.t).mean() == pytest.approx(share, abs=0.04)
    assert np.abs(moved.t[back] - numbered.t).max() <= 10_000


def test_a_larger_share_changes_what_a_smaller_one_did_and_more():
    few, many = (EventEdit(invert=share, seed=1).applied(EVENTS, 0).p != EVENTS.p for share in (0.2, 0.6))
    assert (few <= many).all()


def test_seeds_differ_and_wrong_values_are_refused():
    assert not _equal(EventEdit(drop=0.5).applied(EVENTS, 0), EventEdit(drop=0.5, seed=1).applied(EVENTS, 0))
    with pytest.raises(ValueError, match=r"drop is 1\.5.*0 … 1"):
        EventEdit(drop=1.5)
    with pytest.raises(ValueError, match="at least 0"):
        EventEdit(seed=-1)

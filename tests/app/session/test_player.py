"""Playing keeps the recording's own time, whatever the windows' lengths and however late the clock is asked."""

import itertools

import numpy as np
import pytest

from app.session.player import Player
from app.state import intents as ask
from app.state.view_state import Limits, ViewState
from app.views.timeline.state import speed_of
from etnet.events.events import Sensor
from etnet.windows import Window
from tests.app.reducing import reduce


def limits(stamps):
    windows = [Window(i, i, i + 1, start, stop) for i, (start, stop) in enumerate(itertools.pairwise(stamps))]
    return Limits(Sensor(8, 8), windows, stamps[0])


UNEVEN = limits([0, 10_000, 15_000, 100_000, 101_000, 180_000, 300_000])


def play(state, bounds, times, player=None):
    player = player or Player()
    shown = []
    for now in times:
        due = player.due(state, bounds, now, None)
        if due is not None:
            state = reduce(state, ask.PlayTo(due), bounds)
        shown.append(state.index)
    return state, shown


@pytest.mark.parametrize("interval", [0.01, 0.083, 0.4])
def test_a_window_is_shown_when_its_time_has_come(interval):
    times = np.arange(0, 2.5, interval)
    _, shown = play(ViewState(is_playing=True, speed=0.1, loops=False), UNEVEN, times)
    for now, index in zip(times, shown, strict=True):
        reached = 10_000 + now * 0.1e6
        if reached < 300_000:
            assert index == UNEVEN.index_at(int(reached))
    assert shown == sorted(shown)


def test_at_the_end_it_stops_or_begins_again():
    times = np.arange(0, 4, 0.05)
    stopped, shown = play(ViewState(is_playing=True, speed=0.1, loops=False), UNEVEN, times)
    assert not stopped.is_playing
    assert shown[-1] == 5
    looping, shown = play(ViewState(is_playing=True, speed=0.1), UNEVEN, times)
    assert looping.is_playing
    assert 0 in shown[shown.index(5) :]


def test_a_new_speed_goes_on_from_where_it_is():
    player = Player()
    state, _ = play(ViewState(is_playing=True, speed=0.1), UNEVEN, [0, 0.5, 1.0], player)
    slower = reduce(state, ask.ChooseSpeed(0.02), UNEVEN)
    after, _ = play(slower, UNEVEN, [1.0, 1.01], player)
    assert after.index == state.index


def test_waiting_for_images_goes_on_one_window_at_a_time_and_only_when_one_has_come():
    player = Player()
    state = ViewState(index=2, is_playing=True, waits_for_frames=True)
    assert player.due(state, UNEVEN, 0.0, None) is None
    assert player.due(state, UNEVEN, 9.0, 1) is None
    assert player.due(state, UNEVEN, 9.1, 2) == 3


def test_nothing_is_due_while_nothing_plays_or_nothing_is_open():
    assert Player().due(ViewState(), UNEVEN, 1.0, 0) is None
    assert Player().due(ViewState(is_playing=True), Limits(), 1.0, 0) is None


@pytest.mark.parametrize(
    ("step_ms", "speed"), [(1.0, "1×"), (45.0, "1×"), (90.0, "½"), (450.0, "1/10"), (1e6, "step"), (None, "1/10")]
)
def test_playing_begins_at_the_fastest_speed_that_lasts_of_those_on_the_page(step_ms, speed):
    state, player = ViewState(), Player()
    for intent in player.before(ask.TogglePlay(), state, UNEVEN, step_ms):
        state = reduce(state, intent, UNEVEN)
    assert speed_of(state.speed, state.waits_for_frames) == speed


def test_a_speed_that_was_chosen_stays():
    player, state = Player(), ViewState()
    assert player.before(ask.ChooseSpeed(0.1), state, UNEVEN, 1.0) == ()
    assert player.before(ask.TogglePlay(), state, UNEVEN, 1.0) == ()

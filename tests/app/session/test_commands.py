"""The palette: every command has a name of its own and does what it says."""

from typing import Any, get_args

import pytest

from app.session.commands import commands_of
from app.state import intents as ask
from app.state.view_state import Limits, ViewState
from app.views import VIEWS
from app.views.attention.state import AttentionState
from app.views.inspect.state import Inspector, InspectState
from app.views.view import open_tab, reduce_views
from etnet.events.events import Sensor
from etnet.windows import ByCount

COMMANDS = commands_of(VIEWS)
LIMITS = Limits(Sensor(38, 21))
KNOWN = AttentionState(site="scale1.encoder.0.self", sites=("scale1.encoder.0.self", "scale2.encoder.0.self"),
                       num_heads=4)  # fmt: skip


def done(label: str, state: ViewState) -> ViewState:
    """The page after a command."""
    intent: Any = next(command.intent for command in COMMANDS if command.label == label)
    for each in intent if isinstance(intent, tuple) else (intent,):
        state = reduce_views(state, each, LIMITS, VIEWS)
    return state


@pytest.fixture
def state() -> ViewState:
    return ViewState("r", "m", policy=ByCount(9), index=3, query=(20, 9)).put(KNOWN)


def test_no_two_commands_have_one_name_or_one_key():
    labels, keys = [command.label for command in COMMANDS], [command.key for command in COMMANDS if command.key]
    assert len(set(labels)) == len(labels)
    assert len(set(keys)) == len(keys)


@pytest.mark.parametrize("name", [name for name in get_args(Inspector) if name != "none"])
def test_every_inspector_is_opened_by_name_where_it_is_seen(state: ViewState, name: str):
    titles = [each.label for each in COMMANDS if isinstance(each.intent, tuple) and each.intent[-1].value == name]
    assert len(titles) == 1
    after = done(titles[0], state)
    tab = open_tab(after, VIEWS)
    assert after.of(InspectState).opened == name
    assert tab is not None
    assert tab.name == "inspect"


def test_the_query_moves_by_a_token_and_stays_on_the_sensor(state: ViewState):
    assert done("Attention: query a token to the right", state).query == (28, 9)
    up = done("Attention: query a token up", state)
    assert up.query == (20, 1)
    assert done("Attention: query a token up", up).query == (20, 0)
    assert reduce_views(ViewState(), ask.MoveQuery(8, 0), LIMITS, VIEWS).query is None


def test_sites_heads_pins_and_changes_are_commands(state: ViewState):
    assert done("Attention: next site", state).of(AttentionState).site == "scale2.encoder.0.self"
    assert done("Attention: next head", state).of(AttentionState).head == 0
    pinned = done("Attention: pin this map as B", state)
    assert pinned.of(AttentionState).pin_b is not None
    assert done("Attention: unpin B", pinned).of(AttentionState).pin_b is None
    assert done("Attention: follow the patch under the pixel", state).of(AttentionState).anchor == 3
    assert done("Change: show the original", state).of(InspectState).shows_original

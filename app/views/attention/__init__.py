"""Where the network looks from the chosen pixel."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

from app.state import intents as ask
from app.views.attention.commands import COMMANDS
from app.views.attention.state import AttentionState, hear, reduce_attention
from app.views.view import Card, View

if TYPE_CHECKING:
    import viser

    from app.engine.jobs import Job
    from app.engine.requests import FrameRequest
    from app.state.view_state import ViewState
    from app.views.panel import Panel


def _panel(client: viser.ClientHandle) -> Panel:
    from app.views.attention.panel import AttentionPanel

    return AttentionPanel()


def _jobs(state: ViewState, request: FrameRequest) -> Mapping[str, Job]:
    from app.views.attention.jobs.attention import attention_jobs

    return attention_jobs(state, request)


VIEW = View(
    "attention",
    "Attention",
    "FOCUS_2",
    AttentionState(),
    _panel,
    workspaces=frozenset({"attention"}),
    settings_in=frozenset({"attention"}),
    cards=(
        Card("attention.map", stage=frozenset({"attention"})),
        Card("attention.atlas", stage=frozenset({"attention"})),
        Card("attention.heads", shelf=frozenset({"attention"})),
        Card("attention.tokens", shelf=frozenset({"attention"})),
        Card("attention.time", shelf=frozenset({"attention"})),
    ),
    is_public=True,
    in_public=AttentionState(map_range="per map"),
    reduce=reduce_attention,
    intents=(
        *(ask.OpenRecording, ask.ReopenRecording, ask.ChooseModel, ask.NetworkKnown),
        *(ask.ChoosePolicy, ask.ChooseCleaning, ask.Settle, ask.Query, ask.QueryFraction, ask.MoveQuery),
        *(ask.Seek, ask.SeekTime, ask.Move, ask.FollowNewest, ask.PlayTo),
    ),
    hear=hear,
    jobs=_jobs,
    commands=COMMANDS,
)

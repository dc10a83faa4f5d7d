"""What an intent does to the moment that all views share. Pure; every value stays inside the recording's limits."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from app.state import intents as ask
from app.state.checks import checked
from app.state.view_state import LARGEST_INDEX, Limits, ViewState
from etnet.events.cleaning import UNCLEANED
from etnet.windows import Window

SEARCHED = 5_000
"""Windows that are looked at for the first one that holds events."""


def reduce_shared(state: ViewState, intent: Any, limits: Limits) -> ViewState:
    """The shared moment after `intent`; slices are left to their views."""
    if getattr(intent, "pauses", False):
        state = replace(state, is_playing=False)
    return (
        _reduce_playback(state, intent, limits)
        or _reduce_marks(state, intent, limits)
        or _reduce_recording(state, intent, limits)
        or _reduce_page(state, intent, limits)
        or state
    )


def _reduce_playback(state: ViewState, intent: Any, limits: Limits) -> ViewState | None:
    match intent:
        case ask.Seek(index):
            return _gone_to(state, index, limits)
        case ask.Move(num_windows):
            return _gone_to(state, state.index + num_windows, limits)
        case ask.FollowNewest():
            return _following(state, limits)
        case ask.SeekTime(seconds):
            seconds = seconds if math.isfinite(seconds) else 0.0
            t = limits.start + round(min(max(seconds, 0.0), 1e9) * 1e6)
            if limits.is_live and limits.windows and t > limits.windows[len(limits.windows) - 1].t_stop:
                return _following(state, limits)
            return _gone_to(state, limits.index_at(t), limits)
        case ask.TogglePlay() if limits.is_live and state.follows_newest:
            return replace(state, follows_newest=False, is_playing=False)
        case ask.TogglePlay():
            stretch = _stretch(state, limits)
            is_at_end = bool(stretch) and (state.index == stretch[-1] or state.index >= len(limits.windows or ()) - 1)
            restarts = not state.is_playing and is_at_end and not (limits.is_growing and state.mark_b is None)
            return replace(state, index=stretch[0] if restarts else state.index, is_playing=not state.is_playing)
        case ask.PlayTo(index):
            return _played_to(state, index, limits)
        case ask.ChooseSpeed(speed, waits_for_frames):
            return replace(_set(state, "speed", speed), waits_for_frames=waits_for_frames)
        case ask.SetLoop(loops):
            return replace(state, loops=loops)
    return None


def _gone_to(state: ViewState, index: int, limits: Limits) -> ViewState:
    """A window by its index; past the last one of a live recording lies what comes next."""
    if limits.is_live and limits.windows is not None and index >= len(limits.windows):
        return _following(state, limits)
    follows = state.follows_newest and not limits.is_live
    return replace(state, index=limits.clamp_index(index), is_playing=False, follows_newest=follows)


def _following(state: ViewState, limits: Limits) -> ViewState:
    if not limits.is_live:
        return state
    return replace(state, index=limits.clamp_index(LARGEST_INDEX), is_playing=False, follows_newest=True)


def _stretch(state: ViewState, limits: Limits) -> range:
    """The windows between the marks."""
    return limits.stretch(state.mark_a, state.mark_b)


def _played_to(state: ViewState, index: int, limits: Limits) -> ViewState:
    """Playing that comes from between the marks ends, or begins again, at the second one."""
    if not state.is_playing:
        return state
    stretch = _stretch(state, limits)
    ends_at_mark = state.mark_b is not None and bool(stretch) and state.index <= stretch[-1]
    num_windows = 0 if limits.windows is None else len(limits.windows)
    is_past = (
        index > stretch[-1]
        if ends_at_mark
        else limits.windows is not None and index >= num_windows and not limits.is_growing
    )
    if is_past and state.loops:
        return replace(state, index=stretch[0] if stretch else 0)
    if limits.is_live and not ends_at_mark and index >= num_windows:
        return _following(state, limits)
    last = stretch[-1] if ends_at_mark and is_past else limits.clamp_index(index)
    return replace(state, index=last, is_playing=not is_past)


def _reduce_marks(state: ViewState, intent: Any, limits: Limits) -> ViewState | None:
    match intent:
        case ask.MarkHere(mark):
            window = limits.window(state.index)
            if window is None:
                return state
            return _marked(state, mark, window.t_start if mark == "a" else window.t_stop)
        case ask.PutMark(mark, seconds):
            if not limits.windows or not math.isfinite(seconds):
                return state
            return _marked(state, mark, limits.start + round(min(max(seconds, 0.0), 1e9) * 1e6))
        case ask.ClearMarks():
            return replace(state, mark_a=None, mark_b=None)
    return None


def _marked(state: ViewState, mark: str, stamp: int) -> ViewState:
    """Marks in the wrong order are no stretch: the one that was set last stays."""
    if mark == "a":
        keeps = state.mark_b is not None and state.mark_b > stamp
        return replace(state, mark_a=stamp, mark_b=state.mark_b if keeps else None)
    keeps = state.mark_a is not None and state.mark_a < stamp
    return replace(state, mark_b=stamp, mark_a=state.mark_a if keeps else None)


def _reduce_recording(state: ViewState, intent: Any, limits: Limits) -> ViewState | None:
    window = limits.window(state.index)
    moment = window.t_stop if window else state.moment
    match intent:
        case ask.OpenRecording(recording_id):
            if recording_id == state.recording_id:
                return state
            opened = replace(state, recording_id=recording_id, policy=None, query=None)
            opened = replace(opened, mark_a=None, mark_b=None, cleaning=UNCLEANED, follows_newest=True)
            return replace(opened, index=0, moment=None, is_playing=False)
        case ask.ReopenRecording(recording_id):
            return replace(state, recording_id=recording_id, moment=moment, is_playing=False)
        case ask.ChooseModel(model_id):
            return replace(state, model_id=model_id)
        case ask.ChoosePrecision(precision):
            return _set(state, "precision", precision)
        case ask.ChoosePolicy(policy):
            if policy == state.policy:
                return state
            return replace(state, policy=policy, moment=moment, is_playing=False)
        case ask.ChooseCleaning(cleaning):
            if cleaning == state.cleaning:
                return state
            return replace(state, cleaning=cleaning, moment=moment, is_playing=False)
        case ask.RenameRecording(recording_id):
            return replace(state, recording_id=recording_id)
        case ask.Settle(policy):
            index = state.index if state.moment is None else limits.index_at(state.moment)
            if state.policy is None and state.moment is None and index == 0:
                index = first_with_events(limits.windows or ())
            follows = state.follows_newest
            if limits.is_live:
                follows = follows and state.moment is None  # a moment that was asked for is one of the past
                index = LARGEST_INDEX if follows else index
            index = limits.clamp_index(index)
            settled = replace(state, policy=policy, index=index, moment=None, follows_newest=follows)
            return settled if state.query is None else _queried(settled, *state.query, limits)
    return None


def first_with_events(windows: Sequence[Window]) -> int:
    """The first window that holds events, where a recording is opened; 0 where the first thousands hold none."""
    return next((i for i in range(min(len(windows), SEARCHED)) if windows[i].num_events), 0)


def _reduce_page(state: ViewState, intent: Any, limits: Limits) -> ViewState | None:
    match intent:
        case ask.Query(x, y):
            return _queried(state, x, y, limits)
        case ask.MoveQuery(x, y):
            if state.query is None:
                return state
            return _queried(state, state.query[0] + x, state.query[1] + y, limits)
        case ask.QueryFraction(x, y):
            if limits.sensor is None or not (math.isfinite(x) and math.isfinite(y)):
                return state
            width, height = limits.sensor.width, limits.sensor.height
            across, down = (min(max(share, 0.0), 1.0) for share in (x, y))
            return _queried(state, math.floor(across * width), math.floor(down * height), limits)
        case ask.ShowWorkspace(workspace):
            return replace(_set(state, "workspace", workspace), tab="", staged="")
        case ask.OpenTab(tab):
            return _set(state, "tab", tab)
        case ask.StageCard(card):
            return _set(state, "staged", "" if card == state.staged else card)
    return None


def _queried(state: ViewState, x: int, y: int, limits: Limits) -> ViewState:
    width, height = (limits.sensor.width, limits.sensor.height) if limits.sensor else (65_536, 65_536)
    # In public the picture waits for the person who touches it; elsewhere playing goes on under the maps.
    goes_on = state.is_playing and not state.is_public
    follows = state.follows_newest and not (state.is_public and limits.is_live)
    pixel = min(max(x, 0), width - 1), min(max(y, 0), height - 1)
    return replace(state, query=pixel, is_playing=goes_on, follows_newest=follows)


def _set(state: ViewState, name: str, value: object) -> ViewState:
    """A page may send anything; what does not fit changes nothing."""
    try:
        return replace(state, **{name: checked(ViewState, name, value)})
    except ValueError:
        return state

"""The clock of playing: which window is due. It follows the recording's own time, not the number of windows."""

from __future__ import annotations

from typing import Any

from app.html.choices import PLAYED
from app.state import intents as ask
from app.state.view_state import Limits, ViewState
from etnet.windows import Policy

MICROSECONDS = 1e6


class Player:
    """Remembers when and where playing started; everything else is in the state."""

    def __init__(self) -> None:
        self._started: tuple[float, int] | None = None
        self._basis: tuple[float, int, str, Policy | None] | None = None
        self._is_chosen = False

    def before(self, intent: object, state: ViewState, limits: Limits, step_ms: float | None) -> tuple[Any, ...]:
        """What comes before an intent: when playing begins, and nobody has chosen a speed, the fastest that lasts."""
        self._is_chosen |= isinstance(intent, ask.ChooseSpeed) or state.speed != ViewState().speed
        if not isinstance(intent, ask.TogglePlay) or self._is_chosen or state.is_playing or step_ms is None:
            return ()
        self._is_chosen = True
        return () if state.waits_for_frames else (lasting_speed(limits, step_ms),)

    def due(self, state: ViewState, limits: Limits, now: float, shown: int | None) -> int | None:
        """The window that should be current at `now` (seconds of any steady clock); `None` to stay.

        `shown` is the window of the newest finished reconstruction: with `waits_for_frames` the next window is due
        only when the present one's has come.
        """
        if not state.is_playing or not limits.windows:
            self._started = None
            return None
        if state.waits_for_frames:
            return state.index + 1 if shown == state.index else None
        basis = (state.speed, state.index, state.recording_id, state.policy)
        if self._started is None or self._basis is None or basis != self._basis:
            self._started = (now, limits.windows[state.index].t_stop)
        since, t = self._started
        reached = t + (now - since) * state.speed * MICROSECONDS
        last = limits.windows[len(limits.windows) - 1].t_stop
        index = len(limits.windows) if reached > last else max(limits.index_at(int(reached)), state.index)
        self._basis = (state.speed, index, state.recording_id, state.policy)
        return index if index != state.index else None


def lasting_speed(limits: Limits, step_ms: float) -> ask.ChooseSpeed:
    """The fastest of the offered speeds at which a step takes no longer than its window lasts.

    Where none lasts, every window is shown and its image waited for.
    """
    windows, steps = limits.windows, ask.ChooseSpeed(min(PLAYED.values()), waits_for_frames=True)
    if not windows:
        return steps
    span = windows[len(windows) - 1].t_stop - windows[0].t_start
    window_ms = span / len(windows) / 1000
    lasting = [speed for speed in PLAYED.values() if step_ms * speed <= window_ms]
    return ask.ChooseSpeed(max(lasting)) if lasting else steps

"""What is compared: runs beside the main one, how they are shown, by which protocol they are scored."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any, ClassVar, Literal

from app.state import intents as ask
from app.state.checks import checked, number, whole
from app.state.run import Run
from app.state.view_state import ViewState
from app.views.view import Here
from etnet.events.cleaning import Cleaning

Inspector = Literal["none", "runs", "scores"]
Sight = Literal["side by side", "wipe", "difference", "error"]
Measure = Literal["mse", "ssim", "lpips", "temporal", "sharpness", "contrast", "rate", "density"]
Rule = Literal["paper", "evreal"]
ZOOMS = (1, 2, 4, 8)
MOST_RUNS = 3
"""Beside the main one."""
LARGEST_OFFSET = 1_000_000
"""µs by which the frames' clock can be shifted."""


@dataclass(frozen=True, slots=True)
class CompareState:
    """One visitor's comparison. With the inspector "none" nothing of it is computed or drawn."""

    view: ClassVar[str] = "compare"
    inspector: Inspector = "none"
    runs: tuple[Run, ...] = ()
    chosen: int = whole(0, 0, MOST_RUNS - 1)
    """The run that the widgets change, and that swipe and difference hold against the main one."""
    sight: Sight = "side by side"
    wipe: float = number(0.5, 0.0, 1.0)
    zoom: int = whole(1, 1, ZOOMS[-1])
    measure: Measure = "lpips"
    rule: Rule = "paper"
    replays: bool = False
    """Score what the protocol feeds, from a cold start, and not the windows of the timeline."""
    offset: int = whole(0, -LARGEST_OFFSET, LARGEST_OFFSET)
    """µs added to the camera frames' stamps before they are matched."""


@dataclass(frozen=True, slots=True)
class AddRun:
    """One run more: like the main one until something of it is changed, or with something changed already."""

    run: Run = field(default_factory=Run)


@dataclass(frozen=True, slots=True)
class RemoveRun:
    """Take a run away (0 is the first beside the main one)."""

    number: int


@dataclass(frozen=True, slots=True)
class ChooseRun:
    """Let the widgets speak of this run."""

    number: int


@dataclass(frozen=True, slots=True)
class ChangeRun:
    """Change the chosen run's `field` to `value`: what `Run` takes there."""

    field: Literal["model_id", "precision", "policy", "cleaning"]
    value: object


@dataclass(frozen=True, slots=True)
class StartCold:
    """Zero the chosen run's state at the current moment, or give it all windows back."""

    is_cold: bool


def reduce_compare(slice_: CompareState, intent: Any, here: Here) -> CompareState:
    """Of another recording the stamps mean nothing: cold starts and the offset go."""
    match intent:
        case AddRun(run):
            opened = replace(slice_, inspector="runs")
            if len(slice_.runs) >= MOST_RUNS:
                return opened
            return replace(opened, runs=(*slice_.runs, run), chosen=len(slice_.runs))
        case RemoveRun(number):
            runs = tuple(run for place, run in enumerate(slice_.runs) if place != number)
            return replace(slice_, runs=runs, chosen=min(slice_.chosen, max(len(runs) - 1, 0)))
        case ChooseRun(number):
            return replace(slice_, chosen=min(max(number, 0), max(len(slice_.runs) - 1, 0)))
        case ChangeRun(name, value):
            return _with_run(slice_, name, value)
        case StartCold(is_cold):
            window = here.window
            return _with_run(slice_, "cold_from", window.t_start if is_cold and window else None)
        case ask.ShowWorkspace("compare") if slice_.inspector == "none":
            return replace(slice_, inspector="runs")
        case ask.OpenRecording() | ask.ReopenRecording():
            return replace(slice_, runs=tuple(replace(run, cold_from=None) for run in slice_.runs), offset=0)
    return _sound(slice_)


def _sound(slice_: CompareState) -> CompareState:
    """A stored view may hold more runs than are allowed, or a chosen one that is not there."""
    runs = slice_.runs[:MOST_RUNS]
    chosen = slice_.chosen if slice_.chosen < max(len(runs), 1) else 0
    zoom = slice_.zoom if slice_.zoom in ZOOMS else 1
    if (runs, chosen, zoom) == (slice_.runs, slice_.chosen, slice_.zoom):
        return slice_
    return replace(slice_, runs=runs, chosen=chosen, zoom=zoom)


def compared_runs(state: ViewState) -> tuple[Run, ...] | None:
    """The runs beside the main one; `None` while nothing is compared."""
    slice_ = state.of(CompareState)
    return slice_.runs if slice_.inspector in ("runs", "scores") else None


def hear(words: str) -> Any:
    """What a click on one of the view's own buttons says; `None` for what none of them sends."""
    if words == "add":
        return AddRun()
    if words == "cleaned":
        return AddRun(Run(cleaning=Cleaning(hot_pixels=True, support_within=5_000)))
    kind, _, number_ = words.rpartition(":")
    return RemoveRun(int(number_)) if kind == "remove" else ChooseRun(int(number_)) if kind == "choose" else None


def _with_run(slice_: CompareState, name: str, value: object) -> CompareState:
    if slice_.chosen >= len(slice_.runs):
        return slice_
    try:
        value = checked(Run, name, value)
    except ValueError:
        return slice_
    runs = list(slice_.runs)
    runs[slice_.chosen] = replace(runs[slice_.chosen], **{name: value})
    return replace(slice_, runs=tuple(runs))

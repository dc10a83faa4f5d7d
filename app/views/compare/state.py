"""What is compared: runs beside the main one, how they are shown, by which protocol they are scored."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from typing import Any, ClassVar, Literal

from app.engine.requests import Precision
from app.html.choices import DEFAULTS, policy_of
from app.state import intents as ask
from app.state.checks import checked, whole
from app.state.run import Rule, Run
from app.state.view_state import ViewState
from app.views.view import Here
from etnet.events.cleaning import UNCLEANED, Cleaning

Sight = Literal["side by side", "swipe", "difference", "error"]
Measure = Literal["lpips", "mse", "ssim", "temporal", "sharpness", "contrast", "rate", "density"]
RunName = Literal["A", "B", "C", "D"]
NAMES: tuple[RunName, ...] = ("A", "B", "C", "D")
"""The main run is A."""
MOST_RUNS = len(NAMES) - 1
"""Beside the main one."""
AS_MAIN = "main"
"""The word of our own selects for "as run A"."""
FILTERS: dict[str, Cleaning] = {
    "none": UNCLEANED,
    "hot": Cleaning(hot_pixels=True),
    "20ms": Cleaning(support_within=20_000),
    "5ms": Cleaning(support_within=5_000),
    "both": Cleaning(hot_pixels=True, support_within=5_000),
}
"""What a run can take out of the events first, by the words of our own selects."""
LARGEST_OFFSET = 1_000_000
"""µs by which the frames' clock can be shifted."""


@dataclass(frozen=True, slots=True)
class CompareState:
    """One visitor's comparison; nothing of it is computed outside its workspace."""

    view: ClassVar[str] = "compare"
    runs: tuple[Run, ...] = ()
    """Beside the main one."""
    sight: Sight = "side by side"
    """Swipe and difference hold each run, and the camera, against the main run; error holds each against the camera."""
    camera: Literal["frame", "A", "B", "C", "D"] = "frame"
    """What stands in the camera's place: its frame, or the error of a run."""
    measure: Measure = "lpips"
    rule: Rule = "paper"
    replays: bool = False
    """Score and show what the protocol feeds, from its cold start, and not the windows of the timeline."""
    offset: int = whole(0, -LARGEST_OFFSET, LARGEST_OFFSET)
    """µs added to the camera frames' stamps before they are matched."""


@dataclass(frozen=True, slots=True)
class AddRun:
    """One run more: like the main one until something of it is changed, or with something changed already."""

    run: Run = field(default_factory=Run)


@dataclass(frozen=True, slots=True)
class RemoveRun:
    """Take a run away (1 is the first beside the main one)."""

    number: int


@dataclass(frozen=True, slots=True)
class ChangeRun:
    """Change a run's `field` to `value`: what `Run` takes there."""

    number: int
    field: Literal["model_id", "precision", "policy", "cleaning"]
    value: object


@dataclass(frozen=True, slots=True)
class StartCold:
    """Zero a run's state at the current moment, or give it all windows back."""

    number: int
    is_cold: bool


def reduce_compare(slice_: CompareState, intent: Any, here: Here) -> CompareState:
    """Of another recording the stamps mean nothing: cold starts and the offset go."""
    match intent:
        case AddRun(run):
            return slice_ if len(slice_.runs) >= MOST_RUNS else replace(slice_, runs=(*slice_.runs, run))
        case RemoveRun(number):
            runs = tuple(run for place, run in enumerate(slice_.runs, start=1) if place != number)
            return replace(slice_, runs=runs, camera="frame")
        case ChangeRun(number, name, value):
            return _with_run(slice_, number, name, value)
        case StartCold(number, is_cold):
            window = here.window
            return _with_run(slice_, number, "cold_from", window.t_start if is_cold and window else None)
        case ask.OpenRecording() | ask.ReopenRecording():
            return replace(slice_, runs=tuple(replace(run, cold_from=None) for run in slice_.runs), offset=0)
    return _sound(slice_)


def _sound(slice_: CompareState) -> CompareState:
    """A stored view may hold more runs than are allowed, or speak of one that is not there."""
    runs = slice_.runs[:MOST_RUNS]
    is_there = slice_.camera == "frame" or NAMES.index(slice_.camera) <= len(runs)
    if is_there and runs == slice_.runs:
        return slice_
    return replace(slice_, runs=runs, camera=slice_.camera if is_there else "frame")


def _with_run(slice_: CompareState, number: int, name: str, value: object) -> CompareState:
    if not 1 <= number <= len(slice_.runs):
        return slice_
    try:
        value = checked(Run, name, value)
    except ValueError:
        return slice_
    runs = list(slice_.runs)
    runs[number - 1] = replace(runs[number - 1], **{name: value})
    return replace(slice_, runs=tuple(runs))


def compared_runs(state: ViewState) -> tuple[Run, ...]:
    """All runs, the main one first. In a protocol's range each sees that protocol's windows, in its precision."""
    slice_ = state.of(CompareState)
    runs = (Run(), *slice_.runs)
    if not slice_.replays:
        return runs
    return tuple(replace(run, precision="fp32", policy=None, cold_from=None, replays=slice_.rule) for run in runs)


def hear(words: str) -> Any:
    """What a click or a choice in the view's own HTML says; `None` for what none of them sends."""
    verb, _, rest = words.partition(":")
    if verb == "add":
        return AddRun()
    if verb == "cleaned":
        return AddRun(Run(cleaning=FILTERS["both"]))
    if verb == "with":
        return AddRun(Run(model_id=rest))
    place, _, word = rest.partition(":")
    number = int(place)
    match verb:
        case "remove":
            return RemoveRun(number)
        case "cold":
            return StartCold(number, word == "on")
        case "model":
            return _changed(number, "model_id", word)
        case "precision":
            return _changed(number, "precision", word)
        case "filter":
            return _filtered(number, word)
        case "windows":
            return _windowed(number, word)
    return None


def _changed(number: int, name: Literal["model_id", "precision"], word: str) -> Any:
    if number:
        return ChangeRun(number, name, None if word == AS_MAIN else word)
    precision: dict[str, Precision] = {"auto": "auto", "fp32": "fp32", "bf16": "bf16"}
    if name == "precision":
        return ask.ChoosePrecision(precision[word]) if word in precision else None
    return ask.ChooseModel(word)


def _filtered(number: int, word: str) -> Any:
    if number and word == AS_MAIN:
        return ChangeRun(number, "cleaning", None)
    if word not in FILTERS:
        return None
    return ChangeRun(number, "cleaning", FILTERS[word]) if number else ask.ChooseCleaning(FILTERS[word])


def _windowed(number: int, word: str) -> Any:
    """Words are "milliseconds", which begins with its usual size, or "milliseconds:20"."""
    kind, _, size = word.partition(":")
    number_ = float(size) if size else DEFAULTS.get(kind, 0.0)
    if not math.isfinite(number_) or number_ < 0:
        return None
    policy = None if kind == AS_MAIN else policy_of(kind, number_)
    return ChangeRun(number, "policy", policy) if number else ask.ChoosePolicy(policy)

"""What is compared: further lanes beside the main one, how they are shown, by which rule they are scored."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import asdict, dataclass, field, fields, replace
from typing import Any, Literal, get_args

from etnet.events.denoise import UNCLEANED, Cleaning
from etnet.windows import Policy

Inspector = Literal["none", "lanes", "scores", "fit"]
Sight = Literal["side by side", "wipe", "difference", "error"]
Measure = Literal["mse", "ssim", "lpips", "temporal", "sharpness", "contrast", "rate", "density"]
Rule = Literal["paper", "evreal"]
Precision = Literal["auto", "fp32", "bf16"]
ZOOMS = (1, 2, 4, 8)
MOST_LANES = 3
"""Beside the main one."""
LARGEST_OFFSET = 1_000_000
"""µs by which the frames' clock can be shifted."""


@dataclass(frozen=True, slots=True)
class Lane:
    """A reconstruction beside the main one; `None` is "as the main one"."""

    model_id: str | None = None
    precision: Precision | None = None
    policy: Policy | None = None
    cleaning: Cleaning = UNCLEANED
    cold_from: int | None = None
    """Stamp (µs) from which on the network sees anything at all: its memory is empty there."""


@dataclass(frozen=True, slots=True)
class CompareState:
    """One visitor's comparison. With the inspector "none" nothing of it is computed or drawn."""

    inspector: Inspector = "none"
    lanes: tuple[Lane, ...] = ()
    chosen: int = 0
    """The lane that the widgets change, and that wipe and difference hold against the main one."""
    sight: Sight = "side by side"
    wipe: float = 0.5
    zoom: int = 1
    measure: Measure = "lpips"
    rule: Rule = "paper"
    replays: bool = False
    """Score what the protocol feeds, from a cold start, and not the windows on show."""
    offset: int = 0
    """µs added to the camera frames' stamps before they are matched."""

    def anew(self) -> CompareState:
        """For another recording: stamps of the old one mean nothing there."""
        return replace(self, lanes=tuple(replace(lane, cold_from=None) for lane in self.lanes), offset=0)


@dataclass(frozen=True, slots=True)
class OpenInspector:
    """Show one of the comparisons, or none."""

    inspector: Inspector


@dataclass(frozen=True, slots=True)
class AddLane:
    """One lane more: like the main one until something of it is changed, or with something changed already."""

    lane: Lane = field(default_factory=Lane)


@dataclass(frozen=True, slots=True)
class RemoveLane:
    """Take a lane away (0 is the first beside the main one)."""

    number: int


@dataclass(frozen=True, slots=True)
class ChooseLane:
    """Let the widgets speak of this lane."""

    number: int


@dataclass(frozen=True, slots=True)
class ChangeLane:
    """Change the chosen lane's `field` to `value`: what `Lane` takes there."""

    field: Literal["model_id", "precision", "policy", "cleaning"]
    value: object


@dataclass(frozen=True, slots=True)
class StartCold:
    """Empty the chosen lane's memory at the moment on show, or give it all windows back."""

    is_cold: bool


@dataclass(frozen=True, slots=True)
class ChangeSight:
    """Change how it is shown or scored: `field` of `CompareState` to `value`."""

    field: Literal["sight", "wipe", "zoom", "measure", "rule", "replays", "offset"]
    value: object


CompareIntent = OpenInspector | AddLane | RemoveLane | ChooseLane | ChangeLane | StartCold | ChangeSight


def reduce_compare(view: CompareState, intent: CompareIntent, now: int | None) -> CompareState:
    """The comparison after `intent`; `now` is the stamp at which the window on show starts, µs."""
    match intent:
        case OpenInspector(inspector):
            return _sound(view, "inspector", inspector)
        case AddLane(lane):
            opened = replace(view, inspector="lanes")
            if len(view.lanes) == MOST_LANES:
                return opened
            return replace(opened, lanes=(*view.lanes, lane), chosen=len(view.lanes))
        case RemoveLane(number):
            lanes = tuple(lane for place, lane in enumerate(view.lanes) if place != number)
            return replace(view, lanes=lanes, chosen=min(view.chosen, max(len(lanes) - 1, 0)))
        case ChooseLane(number):
            return replace(view, chosen=min(max(number, 0), max(len(view.lanes) - 1, 0)))
        case ChangeLane(field, value):
            return _with_lane(view, field, value)
        case StartCold(is_cold):
            return _with_lane(view, "cold_from", now if is_cold else None)
        case ChangeSight(field, value):
            return _sound(view, field, value)


def _with_lane(view: CompareState, field: str, value: object) -> CompareState:
    if view.chosen >= len(view.lanes):
        return view
    try:
        value = _LANE_CHECKS[field](value)
    except (TypeError, ValueError):
        return view
    lanes = list(view.lanes)
    lanes[view.chosen] = replace(lanes[view.chosen], **{field: value})
    return replace(view, lanes=tuple(lanes))


def _sound(view: CompareState, field: str, value: object) -> CompareState:
    """A page may send anything; what does not fit changes nothing."""
    try:
        return replace(view, **{field: _CHECKS[field](value)})
    except (TypeError, ValueError):
        return view


def kept(view: CompareState) -> dict[str, Any]:
    """The comparison as plain values."""
    lanes = []
    for lane in view.lanes:
        plain = asdict(lane)
        plain["cleaning"] = [lane.cleaning.hot_pixels, lane.cleaning.support_within]
        if lane.policy is not None:
            plain["policy"] = {"kind": type(lane.policy).__name__, **asdict(lane.policy)}
        lanes.append(plain)
    return {**asdict(view), "lanes": lanes}


def restored(value: object, policy: Callable[[object], Policy]) -> CompareState:
    """What `kept` gave; anything else is a ValueError. `policy` reads a window policy."""
    if not isinstance(value, dict) or set(value) != {part.name for part in fields(CompareState)}:
        raise ValueError("not a comparison")
    stored = value.pop("lanes")
    if not isinstance(stored, list) or len(stored) > MOST_LANES:
        raise ValueError("not a list of lanes")
    sound = {name: _CHECKS[name](entry) for name, entry in value.items()}
    return CompareState(lanes=tuple(_lane(entry, policy) for entry in stored), **sound)


def _lane(entry: object, policy: Callable[[object], Policy]) -> Lane:
    if not isinstance(entry, dict) or set(entry) != {part.name for part in fields(Lane)}:
        raise ValueError("not a lane")
    if entry["policy"] is not None:
        entry["policy"] = policy(entry["policy"])
    entry["cleaning"] = Cleaning(*entry["cleaning"])
    return Lane(**{name: _LANE_CHECKS[name](part) for name, part in entry.items()})


def _word(alias: object) -> Callable[[object], str]:
    def check(value: object) -> str:
        if value not in get_args(alias):
            raise ValueError(f"{value!r} is not offered")
        return str(value)

    return check


def _flag(value: object) -> bool:
    if not isinstance(value, bool):
        raise ValueError("not yes or no")
    return value


def _whole(low: int, high: int) -> Callable[[object], int]:
    def check(value: object) -> int:
        if isinstance(value, bool) or not isinstance(value, int) or not low <= value <= high:
            raise ValueError("not a whole number in range")
        return value

    return check


def _unit(value: object) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
        raise ValueError("not a number")
    return min(max(float(value), 0.0), 1.0)


def _zoom(value: object) -> int:
    if value not in ZOOMS:
        raise ValueError("not offered")
    return int(str(value))


def _optional(check: Callable[[object], object]) -> Callable[[object], object]:
    return lambda value: None if value is None else check(value)


def _text(value: object) -> str:
    if not isinstance(value, str) or len(value) > 500:
        raise ValueError("not a short text")
    return value


def _instance(kind: Any) -> Callable[[object], object]:
    def check(value: object) -> object:
        if not isinstance(value, kind):
            raise ValueError(f"not a {kind}")
        return value

    return check


def _cleaning(value: object) -> Cleaning:
    if not isinstance(value, Cleaning) or not isinstance(value.hot_pixels, bool):
        raise ValueError("not a cleaning")
    return Cleaning(value.hot_pixels, _whole(0, 10_000_000)(value.support_within))


_CHECKS: dict[str, Callable[[object], Any]] = {
    "inspector": _word(Inspector),
    "chosen": _whole(0, MOST_LANES - 1),
    "sight": _word(Sight),
    "wipe": _unit,
    "zoom": _zoom,
    "measure": _word(Measure),
    "rule": _word(Rule),
    "replays": _flag,
    "offset": _whole(-LARGEST_OFFSET, LARGEST_OFFSET),
}
_LANE_CHECKS: dict[str, Callable[[object], Any]] = {
    "model_id": _optional(_text),
    "precision": _optional(_word(Precision)),
    "policy": _optional(_instance(Policy)),
    "cleaning": _cleaning,
    "cold_from": _optional(_whole(-(2**62), 2**62)),
}

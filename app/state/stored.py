"""A view as text and back, for the browser's own storage: what comes back is a stranger's word and is checked."""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from dataclasses import asdict, replace

from app.catalogue.part_id import whole_id
from app.state import intents as ask
from app.state.view_state import SITE_PATTERN, ViewState, choices
from app.views.compare import state as compare_view
from app.views.inspect import state as inside_view
from etnet.errors import EtnetError
from etnet.windows import BetweenFrames, ByCount, ByDensity, ByDuration, Policy

LARGEST_INDEX = 10**9
LONGEST_TEXT = 10_000
_NOT_KEPT = {"is_playing", "moment", "show", "source"}


def to_text(state: ViewState) -> str:
    """The state as JSON. A page that comes back does not start to play by itself."""
    kept = {name: value for name, value in asdict(state).items() if name not in _NOT_KEPT}
    if state.policy is not None:
        kept["policy"] = {"kind": type(state.policy).__name__, **asdict(state.policy)}
    kept["recording_id"] = whole_id(state.recording_id)  # a part is on show for a minute, a link stays
    kept["inside"] = inside_view.kept(state.inside)
    kept["compare"] = compare_view.kept(state.compare)
    return json.dumps(kept)


def from_text(text: str, default: ViewState) -> tuple[ViewState, tuple[str, ...]]:
    """`default` with every stored value that is known and sound, and the names of those that were not."""
    try:
        stored = json.loads(text[:LONGEST_TEXT])
    except ValueError:
        return default, ("the whole stored view",)
    if not isinstance(stored, dict):
        return default, ("the whole stored view",)
    sound, refused = {}, []
    for name, value in stored.items():
        try:
            sound[name] = _CHECKS[name](value)
        except (KeyError, TypeError, ValueError, EtnetError):
            refused.append(str(name)[:40])
    return replace(default, **sound), tuple(refused)


def _one_of(alias: object) -> Callable[[object], str]:
    def check(value: object) -> str:
        if value not in choices(alias):
            raise ValueError(f"{value!r} is not one of {choices(alias)}")
        return str(value)

    return check


def _text(value: object) -> str:
    if not isinstance(value, str) or len(value) > 500:
        raise ValueError("not a short text")
    return value


def _flag(value: object) -> bool:
    if not isinstance(value, bool):
        raise ValueError("not yes or no")
    return value


def _whole(value: object) -> int:
    if isinstance(value, bool) or not isinstance(value, int) or not 0 <= value <= LARGEST_INDEX:
        raise ValueError("not a whole number in range")
    return value


def _number(low: float, high: float) -> Callable[[object], float]:
    def check(value: object) -> float:
        if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
            raise ValueError("not a number")
        if not low <= value <= high:
            raise ValueError("out of range")
        return float(value)

    return check


def _optional(check: Callable[[object], object]) -> Callable[[object], object]:
    return lambda value: None if value is None else check(value)


def _pixel(value: object) -> tuple[int, int]:
    if not isinstance(value, list) or len(value) != 2:
        raise ValueError("not a pixel")
    return _whole(value[0]), _whole(value[1])


def _site(value: object) -> str:
    if not isinstance(value, str) or not SITE_PATTERN.fullmatch(value):
        raise ValueError("not an attention site")
    return value


def _policy(value: object) -> Policy:
    if not isinstance(value, dict):
        raise ValueError("not a window policy")
    match value.get("kind"):
        case "BetweenFrames":
            return BetweenFrames()
        case "ByCount":
            return ByCount(_whole(value["num_events"]))
        case "ByDensity":
            return ByDensity(_number(1e-6, 1e6)(value["events_per_pixel"]))
        case "ByDuration":
            stride = value.get("stride")
            return ByDuration(_whole(value["duration"]), None if stride is None else _whole(stride))
    raise ValueError("not a known window policy")


_CHECKS: dict[str, Callable[[object], object]] = {
    "recording_id": _text,
    "model_id": _text,
    "precision": _one_of(ask.Precision),
    "policy": _optional(_policy),
    "index": _whole,
    "speed": _number(1e-4, 16.0),
    "waits_for_frames": _flag,
    "loops": _flag,
    "workspace": _one_of(ask.Workspace),
    "query": _optional(_pixel),
    "site": _site,
    "head": _optional(_whole),
    "opens_heads": _flag,
    "event_image": _one_of(ask.EventImage),
    "tone": _one_of(ask.Tone),
    "overlay": _number(0.0, 1.0),
    "map_range": _one_of(ask.MapRange),
    "camera": _one_of(ask.Camera),
    "shows_events": _flag,
    "voxel_bin": _optional(_whole),
    "inside": inside_view.restored,
    "compare": lambda value: compare_view.restored(value, _policy),
}

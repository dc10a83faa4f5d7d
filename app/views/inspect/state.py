"""What a visitor inspects and has changed: a slice of the page, its intents, and what its own buttons say."""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, ClassVar, Literal, cast, get_args

from app.engine.requests import FrameRequest
from app.html.attention.look import MOST_HEADS, SITE_PATTERN
from app.state import intents as ask
from app.state.checks import passing, text, whole
from app.views.view import Here
from etnet.events.edit import UNEDITED, EventEdit
from etnet.nets.intervention import ORIGINAL, Intervention

Inspector = Literal[
    "none", "matters", "change", "sources", "events", "search", "twin", "input", "state", "memory", "rollout", "time",
    "spread",
]  # fmt: skip
Plane = Literal["hidden", "cell", "enter", "forget", "out", "candidate"]

Fusion = Literal["mean", "max", "min"]
"""How a rollout makes one map of a site's heads."""
Scope = Literal["window", "on", "once"]
"""A change holds in each window by itself, from a window on, or in one window of which the memory then recovers."""

Towards = Literal["any", "camera", "value"]

LEVELS, SCALES, SKIPS = range(1, 4), range(4), range(4)
MOST_CHANNELS, MOST_BACK = 1024, 8
JITTERS = (1_000, 5_000, 20_000)
"""Farthest moves in time that are offered, µs."""


@dataclass(frozen=True, slots=True)
class Change:
    """What is done to the network and its events on purpose. `Change()` is nothing."""

    intervention: Intervention = ORIGINAL
    edit: EventEdit = UNEDITED
    since: int | None = None
    """The window from which it is carried on; `None`: in each window for itself, the memory before it untouched."""
    once: bool = False
    """It holds in window `since` alone; what its memory carries on is seen in later windows."""

    @property
    def scope(self) -> Scope:
        """How far it reaches."""
        return "window" if self.since is None else "once" if self.once else "on"

    @property
    def is_nothing(self) -> bool:
        """Whether the network runs as it is."""
        return self.intervention == ORIGINAL and self.edit.changes_nothing

    @property
    def run_from(self) -> int | None:
        """The window from which one run under `intervention` gives these frames; `None` where nothing is changed, or
        no such run does: one has the events as they are, and carries on what it does to its memory."""
        if self.is_nothing or self.once or not self.edit.changes_nothing:
            return None
        return 0 if self.since is None and not self.intervention.changes_memory else self.since

    def at(self, index: int) -> Change:
        """What of it holds at a window, in the simplest terms: equal frames have equal changes."""
        is_ahead = self.since is not None and index < self.since
        if is_ahead or self.is_nothing:
            return NO_CHANGE
        edit = UNEDITED if self.edit.changes_nothing else self.edit
        is_carried = self.intervention.changes_memory or edit != UNEDITED
        if not is_carried:
            is_over = self.once and index != self.since
            return NO_CHANGE if is_over else Change(self.intervention, edit)
        return Change(self.intervention, edit, self.since, self.once)


NO_CHANGE = Change()


@dataclass(frozen=True, slots=True)
class InspectState:
    """One visitor's inspection. What was changed does not outlive the visit."""

    view: ClassVar[str] = "inspect"
    opened: Inspector = "none"
    part: str = text("", longest=60)
    """The part whose ablation is shown large; empty takes the first."""
    change: Change = passing(NO_CHANGE)
    shows_original: bool = passing(False)
    """While a key is held: the page as it is without the change."""
    shows_code: bool = False
    """Whether the lines of Python that give what the open inspector shows stand below it."""
    shows_not: bool = False
    """Whether what attention maps are not stands above an inspector's maps."""
    lines: str = text("", longest=40)
    """Which of its numbers the lines give; the inspector's first where it has none such."""
    num_back: int = whole(2, 0, MOST_BACK)
    level: int = whole(1, 1, 3)
    plane: Plane = "hidden"
    channel: int = whole(0, 0, MOST_CHANNELS)
    """Counted from the channel of most energy."""
    discard: int = whole(0, 0, 95)
    """Per cent of the smallest weights that a rollout leaves out."""
    fusion: Fusion = "mean"
    tolerance: int = whole(50, 1, 500)
    """Thousandths of full brightness by which a pixel has to change for the causal search."""
    zeroes: Literal["all", "1", "2", "3"] = "all"
    """The recurrent levels whose state a causal search zeroes."""
    towards: Towards = "any"
    """What a causal search wants the pixel to be: anything else, as the camera saw it, or a value (`wanted`)."""
    wanted: int = whole(50, 0, 100)
    """Per cent of full brightness that the pixel should have."""


@dataclass(frozen=True, slots=True)
class Switch:
    """Take a part away, or give it back: "tpa", "uniform", "decoders", "scale 3", "skip 0", "zero 1", "freeze 1",
    "site scale1.encoder.0.self", "alike scale1.encoder.0.self", "head scale1.encoder.0.self 3"."""

    part: str


@dataclass(frozen=True, slots=True)
class EditEvents:
    """Change a share (0 … 1) of the events, or with "jitter_by" how far they move (µs)."""

    name: Literal["drop", "invert", "jitter", "jitter_by"]
    value: float


@dataclass(frozen=True, slots=True)
class ChooseScope:
    """Let the change hold in each window by itself, from the current window on, or once, in the current window."""

    scope: Scope


@dataclass(frozen=True, slots=True)
class ShowOriginal:
    """Show the page without the change, for as long as a key is held."""

    is_held: bool


@dataclass(frozen=True, slots=True)
class ShowTwin:
    """Zero levels of the state once, before a window's step, and open the curve of what that does from there on."""

    at: int
    levels: frozenset[int]


@dataclass(frozen=True, slots=True)
class ResetAll:
    """Undo every change."""


def reduce_inspect(slice_: InspectState, intent: Any, here: Here) -> InspectState:
    """Another network, recording, filter or plan of windows begins unchanged; what makes no sense changes nothing."""
    change = slice_.change
    match intent:
        case Switch(part):
            intervention = switched(change.intervention, part)
            return replace(slice_, change=replace(change, intervention=intervention))
        case EditEvents(name, value):
            return replace(slice_, change=replace(change, edit=_edited(change.edit, name, value)))
        case ChooseScope(scope):
            since = None if scope == "window" else here.state.index
            return replace(slice_, change=replace(change, since=since, once=scope == "once"))
        case ShowOriginal(is_held):
            return replace(slice_, shows_original=is_held)
        case ShowTwin(at, levels):
            zeroed = Intervention(zeroed_levels=levels)
            return replace(slice_, change=Change(zeroed, since=here.limits.clamp_index(at), once=True), opened="twin")
        case ResetAll():
            return replace(slice_, change=NO_CHANGE)
        case (
            ask.OpenRecording() | ask.ReopenRecording() | ask.ChooseModel() | ask.ChoosePolicy() | ask.ChooseCleaning()
        ):
            return slice_ if change == NO_CHANGE else replace(slice_, change=NO_CHANGE)
    return slice_


def changed_request(slice_: InspectState, request: FrameRequest) -> FrameRequest:
    """The request for a frame with what is done to the network and its events on purpose."""
    change = slice_.change.at(request.index)
    if change.is_nothing or slice_.shows_original:
        return request
    return replace(request, intervention=change.intervention, edit=change.edit, since=change.since, once=change.once)


def switched(intervention: Intervention, part: str) -> Intervention:
    """`intervention` with one part switched over; the words are those of `Switch`."""
    name, member = _place(part)
    if name is None:
        return intervention
    present = getattr(intervention, name)
    return replace(intervention, **{name: not present if member is None else present ^ {member}})


def is_switched(intervention: Intervention, part: str) -> bool:
    """Whether a part is taken away."""
    name, member = _place(part)
    if name is None:
        return False
    present = getattr(intervention, name)
    return present if member is None else member in present


def hear(words: str) -> Any:
    """What a click on one of the view's own buttons says, "verb:argument"; `None` for what none of them sends."""
    verb, _, rest = words.partition(":")
    match verb:
        case "switch":
            return Switch(rest)
        case "edit":
            name, _, value = rest.partition(":")
            return EditEvents(cast("Literal['drop']", name), float(value))
        case "scope" if rest in get_args(Scope):
            return ChooseScope(cast("Scope", rest))
        case "original":
            return ShowOriginal(rest == "on")
        case "twin":
            at, _, levels = rest.partition(":")
            wanted = frozenset(int(level) for level in levels.split(",") if level.isdecimal() and int(level) in LEVELS)
            return ShowTwin(int(at), wanted) if at.isdecimal() and len(at) < 10 and wanted else None
        case "reset":
            return ResetAll()
    return None


def _place(part: str) -> tuple[str | None, object]:
    """The field of an intervention that a part belongs to, and its member of that set; (`None`, `None`): no part."""
    kind, *rest = part.split(" ")
    if kind in _FLAGS and not rest:
        return _FLAGS[kind], None
    if kind in _SETS:
        name, read = _SETS[kind]
        member = read(rest)
        if member is not None:
            return name, member
    return None, None


def _number_of(rest: list[str], allowed: range) -> int | None:
    return int(rest[0]) if len(rest) == 1 and rest[0].isdecimal() and int(rest[0]) in allowed else None


def _site_of(rest: list[str]) -> str | None:
    return rest[0] if len(rest) == 1 and re.fullmatch(SITE_PATTERN, rest[0]) else None


def _head_of(rest: list[str]) -> tuple[str, int] | None:
    site, head = _site_of(rest[:1]), _number_of(rest[1:], range(MOST_HEADS))
    return None if site is None or head is None else (site, head)


_FLAGS = {"tpa": "without_context", "uniform": "uniform_attention", "decoders": "without_decoders"}
_SETS: dict[str, tuple[str, Callable[[list[str]], object]]] = {
    "scale": ("removed_scales", lambda rest: _number_of(rest, SCALES)),
    "skip": ("removed_skips", lambda rest: _number_of(rest, SKIPS)),
    "zero": ("zeroed_levels", lambda rest: _number_of(rest, LEVELS)),
    "freeze": ("frozen_levels", lambda rest: _number_of(rest, LEVELS)),
    "site": ("removed_sites", _site_of),
    "alike": ("uniform_sites", _site_of),
    "head": ("masked_heads", _head_of),
}


def _edited(edit: EventEdit, name: str, value: float) -> EventEdit:
    if not math.isfinite(value):
        return edit
    if name == "jitter_by":
        return replace(edit, jitter_by=min(max(int(value), 1), 1_000_000))
    return replace(edit, **{name: min(max(value, 0.0), 1.0)}) if name in ("drop", "invert", "jitter") else edit

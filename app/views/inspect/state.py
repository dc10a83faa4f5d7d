"""What a visitor looks into and what he has changed there: a part of his view, its intents, its text."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields, replace
from typing import Literal, cast, get_args

from etnet.events.edit import UNEDITED, EventEdit
from etnet.nets.intervention import ORIGINAL, Intervention

Inspector = Literal["none", "matters", "change", "events", "input", "state", "memory", "rollout", "time"]
Gather = Literal["mean", "max", "min"]
Order = Literal["network", "entropy", "distance"]
Direction = Literal["reads", "read by"]
Plane = Literal["hidden", "cell", "enter", "forget", "out", "candidate"]
Pin = Literal["a", "b"]

SITE_PATTERN = re.compile(r"scale[0-3]\.(encoder|decoder)\.\d{1,2}\.(self|cross)")
LEVELS, SCALES, SKIPS = range(1, 4), range(4), range(4)
MOST_HEADS, MOST_CHANNELS, MOST_BACK = 64, 1024, 8
JITTERS = (1_000, 5_000, 20_000)
"""Farthest moves in time that are offered, µs."""


@dataclass(frozen=True, slots=True)
class Change:
    """What is done to the network and its events on purpose. `Change()` is nothing."""

    intervention: Intervention = ORIGINAL
    edit: EventEdit = UNEDITED
    since: int | None = None
    """The window from which it is carried on; `None`: in each window for itself, the memory before it untouched."""

    @property
    def is_nothing(self) -> bool:
        """Whether the network runs as it is."""
        return self.intervention == ORIGINAL and self.edit.changes_nothing

    @property
    def run_from(self) -> int | None:
        """The window from which one run under `intervention` gives these frames; `None` where nothing is changed, or
        no such run does: one has the events as they are, and carries on what it does to its memory."""
        if self.is_nothing or not self.edit.changes_nothing:
            return None
        return 0 if self.since is None and not self.intervention.changes_memory else self.since

    def at(self, index: int) -> Change:
        """What of it holds at a window, in the simplest terms: equal frames have equal changes."""
        is_ahead = self.since is not None and index < self.since
        if is_ahead or self.is_nothing:
            return NO_CHANGE
        edit = UNEDITED if self.edit.changes_nothing else self.edit
        is_carried = self.intervention.changes_memory or edit != UNEDITED
        return Change(self.intervention, edit, self.since if is_carried else None)


NO_CHANGE = Change()


@dataclass(frozen=True, slots=True)
class PinnedMap:
    """A map that stays to be compared: its site, its head (`None`: gathered over heads) and its query pixel."""

    site: str
    head: int | None
    gather: Gather
    query: tuple[int, int]


@dataclass(frozen=True, slots=True)
class InspectState:
    """One visitor's look inside. What was changed and pinned does not outlive his visit."""

    opened: Inspector = "none"
    part: str = ""
    """The part whose absence is shown large; empty takes the first."""
    change: Change = NO_CHANGE
    gather: Gather = "mean"
    order: Order = "network"
    direction: Direction = "reads"
    is_linear: bool = False
    is_smooth: bool = False
    shows_links: bool = False
    """Whether the strongest looks of the query are drawn in the scene."""
    shows_planes: bool = False
    """Whether the chosen layer's maps of all scales stand behind the frame, instead of the events."""
    pin_a: PinnedMap | None = None
    pin_b: PinnedMap | None = None
    num_back: int = 2
    level: int = 1
    plane: Plane = "hidden"
    channel: int = 0
    """Counted from the channel of most energy."""
    discard: int = 0
    """Per cent of the smallest weights that a rollout leaves out."""

    def anew(self) -> InspectState:
        """Another network or recording: nothing is changed, nothing pinned."""
        return replace(self, change=NO_CHANGE, pin_a=None, pin_b=None)


@dataclass(frozen=True, slots=True)
class OpenInspector:
    """Open one inspector; "none" closes them all."""

    inspector: Inspector


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
class Persist:
    """Let the change hold from the window on show on, or in each window for itself."""

    is_carried: bool


@dataclass(frozen=True, slots=True)
class ResetAll:
    """Undo every change."""


@dataclass(frozen=True, slots=True)
class PinMap:
    """Keep a map as A or B; `None` lets go."""

    slot: Pin
    pinned: PinnedMap | None


@dataclass(frozen=True, slots=True)
class Choose:
    """Set one plain field of the view, by its name: a word of its list, a flag or a whole number in range."""

    name: str
    value: str


InspectIntent = OpenInspector | Switch | EditEvents | Persist | ResetAll | PinMap | Choose


def reduce_inspect(view: InspectState, intent: InspectIntent, index: int) -> InspectState:
    """The view after an intent that came while window `index` was on show; what makes no sense changes nothing."""
    change = view.change
    match intent:
        case OpenInspector(inspector):
            return replace(view, opened=inspector) if inspector in get_args(Inspector) else view
        case Switch(part):
            intervention = switched(change.intervention, part)
            return replace(view, change=replace(change, intervention=intervention))
        case EditEvents(name, value):
            return replace(view, change=replace(change, edit=_edited(change.edit, name, value)))
        case Persist(is_carried):
            return replace(view, change=replace(change, since=index if is_carried else None))
        case ResetAll():
            return replace(view, change=NO_CHANGE)
        case PinMap(slot, pinned):
            return replace(view, pin_a=pinned) if slot == "a" else replace(view, pin_b=pinned)
        case Choose(name, value):
            check = _CHOSEN.get(name)
            try:
                return view if check is None else replace(view, **{name: check(value)})
            except ValueError:
                return view


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


def heard(text: str) -> InspectIntent | None:
    """What a click on one of our own buttons says, "verb:argument"; `None` for what none of them sends."""
    verb, _, rest = text.partition(":")
    match verb:
        case "open" if rest in get_args(Inspector):
            return OpenInspector(cast("Inspector", rest))
        case "switch":
            return Switch(rest)
        case "edit":
            name, _, value = rest.partition(":")
            return EditEvents(cast("Literal['drop']", name), float(value))
        case "carry":
            return Persist(rest == "on")
        case "back":
            return ResetAll()
        case "set":
            return Choose(*rest.partition(":")[::2])
        case "unpin" if rest in get_args(Pin):
            return PinMap(cast("Pin", rest), None)
        case "pin":
            slot, _, pinned = rest.partition(":")
            found = _pinned(pinned)
            return PinMap(cast("Pin", slot), found) if slot in get_args(Pin) and found is not None else None
    return None


def pin_text(pinned: PinnedMap) -> str:
    """A pin as a button says it."""
    head = pinned.gather if pinned.head is None else str(pinned.head)
    return f"{pinned.site},{head},{pinned.query[0]},{pinned.query[1]}"


def _pinned(text: str) -> PinnedMap | None:
    site, head, x, y = text.split(",") if text.count(",") == 3 else ("", "", "", "")
    if not SITE_PATTERN.fullmatch(site) or not all(part.isdecimal() for part in (x, y)):
        return None
    if head in get_args(Gather):
        return PinnedMap(site, None, cast("Gather", head), (int(x), int(y)))
    return PinnedMap(site, min(int(head), MOST_HEADS - 1), "mean", (int(x), int(y))) if head.isdecimal() else None


def kept(view: InspectState) -> dict[str, object]:
    """What of a view a browser keeps: how it looks, not what it changed or pinned."""
    return {name: getattr(view, name) for name in _CHOSEN if getattr(view, name) != getattr(InspectState(), name)}


def restored(stored: object) -> InspectState:
    """A kept view, every value checked: it is a stranger's word. Raises ValueError."""
    if not isinstance(stored, dict):
        raise ValueError("not a view of the inside")
    return replace(InspectState(), **{str(name): _CHOSEN[name](str(value)) for name, value in stored.items()})


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
    return rest[0] if len(rest) == 1 and SITE_PATTERN.fullmatch(rest[0]) else None


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


def _word(alias: object) -> Callable[[str], str]:
    def check(text: str) -> str:
        if text not in get_args(alias):
            raise ValueError(f"{text!r} is not one of {get_args(alias)}")
        return text

    return check


def _whole(least: int, most: int) -> Callable[[str], int]:
    return lambda text: min(max(int(text), least), most)


def _flag(text: str) -> bool:
    if text not in ("True", "False"):
        raise ValueError(f"{text!r} is neither True nor False")
    return text == "True"


def _short(text: str) -> str:
    if len(text) > 60:
        raise ValueError("too long for the name of a part")
    return text


_CHOSEN: Mapping[str, Callable[[str], object]] = {
    "opened": _word(Inspector),
    "part": _short,
    "gather": _word(Gather),
    "order": _word(Order),
    "direction": _word(Direction),
    "is_linear": _flag,
    "is_smooth": _flag,
    "shows_links": _flag,
    "shows_planes": _flag,
    "num_back": _whole(0, MOST_BACK),
    "level": _whole(1, 3),
    "plane": _word(Plane),
    "channel": _whole(0, MOST_CHANNELS),
    "discard": _whole(0, 95),
}
assert set(_CHOSEN) == {entry.name for entry in fields(InspectState)} - {"change", "pin_a", "pin_b"}

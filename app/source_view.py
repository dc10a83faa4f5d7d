"""The part of a view that looks after the recording itself: whether the doctor's page is open."""

from __future__ import annotations

from dataclasses import dataclass, replace


@dataclass(frozen=True, slots=True)
class Examine:
    """Open the doctor's page of the recording on show, or close it."""

    is_open: bool


SourceIntent = Examine


@dataclass(frozen=True, slots=True)
class SourceView:
    """`examines`: the doctor's page is open. A browser keeps none of this: a page that comes back costs nothing."""

    examines: bool = False


def reduce_source_view(view: SourceView, intent: SourceIntent) -> SourceView:
    """The part after `intent`."""
    return replace(view, examines=bool(intent.is_open))


def heard(text: str) -> SourceIntent | None:
    """What a click on one of our own buttons says; `None` for what none of them sends."""
    match text:
        case "examine:on":
            return Examine(True)
        case "examine:off":
            return Examine(False)
    return None

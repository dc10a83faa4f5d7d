"""The filter is the page's own (`ViewState.cleaning`); this view says what its buttons mean."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

from app.state import intents as ask
from etnet.errors import RecordingError
from etnet.events.cleaning import parse_cleaning
from etnet.windows import ByDensity

SUITED_DENSITY = 0.35
"""Events per pixel a window: the middle of what the bundled networks were trained on."""
STATISTICS_SLOT = "filter.statistics"


@dataclass(frozen=True, slots=True)
class FilterState:
    """The view keeps nothing: the filter belongs to the page."""

    view: ClassVar[str] = "filter"


def hear(words: str) -> Any:
    """A filter as `--filter` takes it ("hot,5ms,2", "none"), or the density that suits; `None` for other words."""
    if words == "density":
        return ask.ChoosePolicy(ByDensity(SUITED_DENSITY))
    try:
        return ask.ChooseCleaning(parse_cleaning(words))
    except RecordingError:
        return None

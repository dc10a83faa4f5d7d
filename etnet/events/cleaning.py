"""What a filter takes out of a recording, as a value: hot pixels, and events that nothing near them supports."""

from __future__ import annotations

import re
from dataclasses import dataclass

from etnet.errors import RecordingError

MOST_NEIGHBOURS = 8
_UNITS = {"us": 1, "µs": 1, "ms": 1_000, "s": 1_000_000}


@dataclass(frozen=True, slots=True)
class Cleaning:
    """What is taken out; hashable, so that caches can be keyed by it.

    `support_within` (µs, 0 is off) is the background-activity filter of Delbruck 2008: an event stays if at least
    `neighbours` of the eight pixels around it fired at most so long before it, whatever the polarity. Hot pixels are
    taken out first, so that they support nothing.
    """

    hot_pixels: bool = False
    support_within: int = 0
    neighbours: int = 1

    def __post_init__(self) -> None:
        if self.support_within < 0:
            raise RecordingError(f"a filter's time is {self.support_within} µs; it takes 0 (off) or more")
        if not 1 <= self.neighbours <= MOST_NEIGHBOURS:
            raise RecordingError(f"a filter wants {self.neighbours} neighbours; it takes 1 … {MOST_NEIGHBOURS}")

    @property
    def changes_nothing(self) -> bool:
        """Whether every event stays."""
        return not (self.hot_pixels or self.support_within)

    @property
    def text(self) -> str:
        """As `--filter` takes it: "hot", "5ms", "hot,5ms,2"; empty for no filter."""
        time = self.support_within
        parts = ["hot"] if self.hot_pixels else []
        if time:
            parts.append(f"{time // 1000}ms" if time % 1000 == 0 else f"{time}us")
            parts += [str(self.neighbours)] if self.neighbours > 1 else []
        return ",".join(parts)


UNCLEANED = Cleaning()


def parse_cleaning(text: str | None) -> Cleaning:
    """The filter that `text` names: "hot", "5ms", "hot,5ms", with a neighbour count "hot,5ms,2"; "" or None is none.

    Raises:
        RecordingError: any other text.
    """
    parts = [part.strip() for part in (text or "").split(",") if part.strip()]
    if not parts or parts == ["none"]:
        return UNCLEANED
    has_hot = parts[0] == "hot"
    rest = parts[1:] if has_hot else parts
    time = re.fullmatch(r"([0-9.]+)\s*(us|µs|ms|s)", rest[0]) if rest else None
    is_count = len(rest) < 2 or (len(rest) == 2 and rest[1].isdigit())
    if (not rest or time is not None) and is_count:
        try:
            within = 0 if time is None else round(float(time[1]) * _UNITS[time[2]])
            if time is None or within > 0:
                return Cleaning(has_hot, within, int(rest[1]) if len(rest) == 2 else 1)
        except ValueError:
            pass
    raise RecordingError(
        f'the filter "{(text or "")[:40]}" is not understood; use hot, a time (5ms), both (hot,5ms), or with a '
        "number of neighbours (hot,5ms,2)"
    )

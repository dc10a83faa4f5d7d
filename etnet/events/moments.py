"""Moments at which somebody wants frames: read from a table, from the names of pictures, triggers or a camera's frames.

Kalibr and EuRoC name pictures by nanoseconds (`cam0/1403636579763555584.png`), and list them in a CSV of that unit. So
each moment keeps its nanoseconds, exactly as they were given, beside the µs of the events' clock.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from decimal import Decimal, InvalidOperation
from pathlib import Path

import numpy as np
from jaxtyping import Int64

from etnet.errors import RecordingError
from etnet.events.formats.columns import from_nanoseconds
from etnet.events.recording import GroundTruth, Recording, Span
from etnet.events.triggers import Triggers
from etnet.files import in_megabytes

_LARGEST_TABLE = 256 << 20
_MOST_DIGITS = 27
"""Before the point. To write out 10⁹⁹⁹⁹⁹⁹ as a whole number takes minutes."""
_PER_NANOSECOND = {"ns": 1, "us": 10**3, "ms": 10**6, "s": 10**9}
_NAMES = (
    "timestamp",
    "time",
    "stamp",
    "t",
    "ts",
    "stamp_us",
    "t_stop_us",
    "t_us",
    "timestamp_us",
    "timestamp_ns",
    "time_us",
)
_UNIT_WORDS = {
    "ns": ("ns", "nanoseconds"),
    "us": ("us", "µs", "microseconds"),
    "ms": ("ms", "milliseconds"),
    "s": ("s", "sec", "seconds"),
}
_PICTURE = re.compile(r"(\d+)\.(?:png|jpe?g|bmp|tiff?|pgm)", re.IGNORECASE)


@dataclass(frozen=True, slots=True, eq=False)
class Moments:
    """Ascending, none twice. `nanoseconds` are as they were given; `stamps` are the same in µs, half to even."""

    nanoseconds: Int64[np.ndarray, " n"]
    said: str
    """Where they come from, and what was assumed of them."""

    @property
    def stamps(self) -> Int64[np.ndarray, " n"]:
        """µs on the events' clock, if that is the clock they were given on."""
        return from_nanoseconds(self.nanoseconds)

    def within(self, span: Span) -> Moments:
        """Those at or after the first event and not after the last, unless there is none."""
        fits = (self.stamps >= span.start) & (self.stamps <= span.stop + 1)
        num_left = int(np.count_nonzero(~fits))
        if num_left in (0, len(fits)):
            return self
        return Moments(self.nanoseconds[fits], f"{self.said}; {num_left} outside the events' span were left out")


def moments_of_triggers(triggers: Triggers | None, name: str) -> Moments:
    """The moments of triggers; the caller has chosen an input or an edge."""
    if triggers is None or len(triggers) == 0:
        raise RecordingError(f"{name}: it has no such triggers; `etnet inspect` tells which there are")
    return _ascending(triggers.stamps * 1000, f"{len(triggers)} triggers")


def moments_of_frames(truth: GroundTruth | None, name: str) -> Moments:
    """The moments of a camera's frames."""
    if truth is None or len(truth) == 0:
        raise RecordingError(f"{name}: it has no frames whose moments could be taken; give a CSV with stamps")
    return _ascending(truth.stamps * 1000, f"{len(truth)} frames of {name}")


def read_moments(path: Path, span: Span, unit: str | None = None) -> Moments:
    """From a table, whose first column or the one named as time counts, or a folder of pictures named by nanoseconds.

    The unit is that of the column's name, else seconds for fractions, else the one by which most lie in `span`.
    """
    if path.is_dir():
        names = sorted(found[1] for each in path.iterdir() if (found := _PICTURE.fullmatch(each.name)))
        if not names:
            raise RecordingError(f"{path.name}: no pictures are named by their nanoseconds in it, as Kalibr wants them")
        return _ascending(np.array([_whole(name, path) for name in names], np.int64), f"{len(names)} pictures' names")
    if path.stat().st_size > _LARGEST_TABLE:
        raise RecordingError(f"{path.name}: {in_megabytes(path.stat().st_size)} are no table of stamps")
    values, named = _column(path)
    unit = unit or named
    if unit is None:
        fractions = any(value != value.to_integral_value() for value in values)
        unit = "s" if fractions else _fitting_unit(values, span)
        why = "they have fractions" if fractions else "by it most lie among the events"
        said = f"{len(values)} stamps of {path.name}, taken for {unit}: {why}"
    else:
        said = f"{len(values)} stamps of {path.name} in {unit}"
    is_time = all(value.adjusted() <= _MOST_DIGITS for value in values)
    scaled = [int((value * _PER_NANOSECOND[unit]).to_integral_value()) for value in values if is_time]
    if not is_time or max(map(abs, scaled)) >= 2**63:
        raise RecordingError(
            f"{path.name}: its stamps, taken for {unit}, are no time; state the unit with --stamps-unit"
        )
    return _ascending(np.array(scaled, np.int64), said)


def _column(path: Path) -> tuple[list[Decimal], str | None]:
    """The values of the column of stamps, and the unit that its name tells."""
    place, unit = 0, None
    values: list[Decimal] = []
    for number, line in enumerate(path.read_text("utf-8-sig", "replace").splitlines(), 1):
        bare = line.strip().lstrip("#%").strip()
        cells = [cell.strip().strip('"') for cell in re.split(r"[,;\t]|\s+(?![\[(])", bare) if cell.strip()]
        if not cells:
            continue
        try:
            value = Decimal(cells[place])
            if not value.is_finite():
                raise InvalidOperation
        except (InvalidOperation, IndexError) as slip:
            if values or (line.strip()[:1] not in "#%" and number > 1):
                raise RecordingError(f'{path.name}: line {number} reads "{line[:60]}"; wanted a stamp') from slip
            place, unit = _named(cells, place, unit)
            continue
        if line.strip()[:1] not in ("#", "%"):
            values.append(value)
    if not values:
        raise RecordingError(f"{path.name}: holds no stamps; wanted one in each line")
    return values, unit


def _named(cells: list[str], place: int, unit: str | None) -> tuple[int, str | None]:
    """The column that a line of names calls time, and its unit, "timestamp [ns]" or "t_us"."""
    for number, cell in enumerate(cells):
        words = re.split(r"[^a-zµ]+", cell.lower())
        if words[0] in _NAMES or cell.lower() in _NAMES:
            found = next(
                (name for name, known in _UNIT_WORDS.items() if any(word in known for word in words[1:])), None
            )
            return number, found
    return place, unit


def _fitting_unit(values: list[Decimal], span: Span) -> str:
    def number_within(unit: str) -> int:
        low, high = (Decimal(stamp) * 1000 / _PER_NANOSECOND[unit] for stamp in span)
        return sum(low <= value <= high for value in values)

    return max(("us", "ns", "ms", "s"), key=number_within)


def _whole(text: str, path: Path) -> int:
    value = int(text) if len(text) < 20 else 2**63
    if value >= 2**63:
        raise RecordingError(f"{path.name}: {text[:40]} is no time in ns")
    return value


def _ascending(nanoseconds: Int64[np.ndarray, " n"], said: str) -> Moments:
    """In order, each once: two moments in one µs would be one frame."""
    ordered = np.sort(nanoseconds)
    kept = ordered[np.flatnonzero(np.diff(from_nanoseconds(ordered), prepend=np.int64(-(2**62))))]
    return Moments(kept, said if len(kept) == len(nanoseconds) else f"{said}, {len(kept)} of them different")


def divided(stamps: Int64[np.ndarray, " n"], recording: Recording, parts: int) -> Int64[np.ndarray, " m"]:
    """The stamps with `parts` − 1 more in each gap, and from the first event on: the last one of each gap is given."""
    edges = np.concatenate([[min(recording.span.start, int(stamps[0]) - parts)], stamps])
    # Whole numbers: an epoch stamp in µs has no digits to spare in a float.
    steps = edges[:-1, None] + np.diff(edges)[:, None] * np.arange(1, parts + 1) // parts
    return np.unique(steps.reshape(-1))

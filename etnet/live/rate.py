"""Biases that follow the event rate: fewer events where there are too many, more where there are too few.

Which way a bias works is the sensor's: on an EVK4 both thresholds rise with diff_on and diff_off (docs.prophesee.ai,
"Biases", IMX636); on a DAVIS346 the ON threshold rises with onbn and the OFF threshold as offbn falls (Lichtsteiner et
al. 2008, eq. 3). Neither was tried on a camera here.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from etnet.errors import RecordingError
from etnet.live.source import LiveSource, Setting

LOOK_EVERY = 500_000
"""µs over which the rate is taken, and from one change to the next."""

_DULLER: dict[str, tuple[tuple[str, int], ...]] = {
    "evk4": (("diff_on", 4), ("diff_off", 4)),
    "davis346": (("onbn", 30), ("offbn", -30)),
}
"""Of each kind of camera the biases that set its thresholds, and a step that raises them."""


@dataclass(frozen=True, slots=True)
class Band:
    """Events a second between which nothing is changed."""

    lowest: float
    highest: float

    def __post_init__(self) -> None:
        if not 0 <= self.lowest < self.highest:
            raise RecordingError(
                f"a rate between {self.lowest:g} and {self.highest:g} events a second; the first is the lower one"
            )


def steps_of(kind: str) -> tuple[tuple[str, int], ...]:
    """The biases that set a camera's thresholds. Raises RecordingError for a kind of which that is not known."""
    if kind not in _DULLER:
        raise RecordingError(f"{kind}: biases follow the event rate on {' and '.join(_DULLER)} only")
    return _DULLER[kind]


def following(kind: str, settings: Sequence[Setting], rate: float, band: Band) -> tuple[tuple[str, int], ...]:
    """Changes (name, value) that bring `rate` (events a second) nearer to the band; none within it or at a bound."""
    direction = 1 if rate > band.highest else -1 if rate < band.lowest else 0
    held = {setting.name: setting for setting in settings}
    changes = []
    for name, step in steps_of(kind):
        if name in held:
            setting = held[name]
            value = min(max(setting.value + direction * step, setting.minimum), setting.maximum)
            if value != setting.value:
                changes.append((name, value))
    return tuple(changes)


def follower_of(source: LiveSource, rate: tuple[float, float] | None) -> RateFollower | None:
    """What keeps a camera between the lowest and the highest rate (Mev/s); `None` where neither is stated.

    Raises RecordingError for a source whose biases it does not know.
    """
    if rate is None:
        return None
    lowest, highest = (1e6 * limit for limit in rate)
    return RateFollower(_kind_of(source), Band(lowest, highest))


def can_follow(source: LiveSource) -> bool:
    """Whether the source's biases can follow the rate."""
    return _kind_of(source) in _DULLER


def _kind_of(source: LiveSource) -> str:
    return getattr(source, "kind", source.format)


class RateFollower:
    """Looks at the rate every half second of the camera's time."""

    def __init__(self, kind: str, band: Band) -> None:
        steps_of(kind)
        self._kind, self.band = kind, band
        self._at: int | None = None
        self._num_before = 0

    def changes(self, until: int, num_events: int, settings: Sequence[Setting]) -> tuple[tuple[str, int], ...]:
        """What to change now that `num_events` have come up to `until` (µs)."""
        if self._at is None:
            self._at, self._num_before = until, num_events
        elapsed = until - self._at
        if elapsed < LOOK_EVERY:
            return ()
        rate = (num_events - self._num_before) / elapsed * 1e6
        self._at, self._num_before = until, num_events
        return following(self._kind, settings, rate, self.band)

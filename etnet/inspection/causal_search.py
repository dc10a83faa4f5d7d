"""Since when a pixel owes what it is to the memory: the window from which on a reset of the state changes it."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

from etnet.errors import ModelError
from etnet.events.events import Events
from etnet.inspection.anatomy import require
from etnet.inspection.pyramid import give_up_if
from etnet.inspection.twin import changed
from etnet.playback.playback import Playback
from etnet.reconstruction import window_events


@dataclass(frozen=True, slots=True)
class Trial:
    """The levels were zeroed once, before the step of window `at`."""

    at: int
    value: float
    """The pixel in the window that was asked about, raw."""
    changes: bool
    """Whether it became otherwise than it was."""


@dataclass(frozen=True, slots=True)
class CausalSearch:
    """Bisection so far: a reset at `changes_at` changes the pixel, one at `leaves_at` does not (each if tried)."""

    index: int
    pixel: tuple[int, int]
    levels: frozenset[int]
    value: float
    """The pixel as it is, raw."""
    first: int
    """The earliest window that is tried."""
    trials: tuple[Trial, ...] = ()

    @property
    def changes_at(self) -> int | None:
        """The earliest window known at which a reset changes the pixel."""
        return min((trial.at for trial in self.trials if trial.changes), default=None)

    @property
    def leaves_at(self) -> int | None:
        """The latest window before that at which a reset is known to change nothing."""
        limit = self.index + 1 if self.changes_at is None else self.changes_at
        return max((trial.at for trial in self.trials if not trial.changes and trial.at < limit), default=None)

    @property
    def is_done(self) -> bool:
        """Whether the window is found, or it is known that there is none, or that it lies before `first`."""
        if not self.trials:
            return False
        if self.changes_at is None:
            return True
        if self.leaves_at is None:
            return self.changes_at == self.first
        return self.changes_at - self.leaves_at == 1

    @property
    def entered_at(self) -> int | None:
        """The window whose events the pixel rests on: a reset before it is made good, one after it is not.

        `None` where no reset changes the pixel, or the window lies before `first`.
        """
        found = self.changes_at
        return found - 1 if self.is_done and found is not None and self.leaves_at is not None else None


def search_cause(
    playback: Playback,
    index: int,
    pixel: tuple[int, int],
    levels: frozenset[int] | None = None,
    tolerance: float = 0.05,
    towards: float | None = None,
    furthest: int = 64,
    cancelled: Callable[[], bool] | None = None,
) -> Iterator[CausalSearch]:
    """Find by bisection the earliest window at which zeroing `levels` (all by default), once, would have changed the
    pixel of window `index` by at least `tolerance`; the search so far after each trial.

    With `towards`, a value that the pixel should have, only a change that brings it nearer by `tolerance` counts.
    It takes 2 + log₂(`furthest`) trials at most, each a branch that replays up to `index` and decodes one frame.
    Bisection takes for granted that a later reset changes more; where effects come and go it still ends at a pair of
    neighbouring windows of which the earlier leaves the pixel and the later changes it, but there may be others.
    """
    require(playback.model, "intervention")
    parts = require(playback.model, "levels")
    levels = frozenset(parts.levels) if levels is None else levels
    if not levels or not levels <= set(parts.levels):
        raise ModelError(f"levels {sorted(levels)} asked for; {parts.name} has {list(parts.levels) or 'none'}")
    if tolerance <= 0 or furthest < 1:
        raise ValueError(f"got tolerance {tolerance} and furthest {furthest}; wanted above 0 and at least 1")
    x, y = pixel
    value = float(playback.at(index, cancelled=cancelled).frame[0, 0, y, x])
    search = CausalSearch(index, pixel, levels, value, max(playback.first, index - furthest))

    def tried(at: int) -> CausalSearch:
        give_up_if(cancelled, "this search")
        branch = reset_once(playback, at, levels)
        found = float(branch.at(index, cancelled=cancelled).frame[0, 0, y, x])
        gain = abs(found - value) if towards is None else abs(value - towards) - abs(found - towards)
        return replace(search, trials=(*search.trials, Trial(at, found, gain >= tolerance)))

    search = tried(index)
    yield search
    if not search.is_done and search.first < index:
        search = tried(search.first)
        yield search
    while not search.is_done:
        early, late = search.leaves_at, search.changes_at
        assert early is not None
        assert late is not None
        search = tried((early + late) // 2)
        yield search


def reset_once(playback: Playback, at: int, levels: frozenset[int]) -> Playback:
    """The twin of a trial: `levels` are zero before the step of window `at`, and nothing else is changed."""
    before = playback.intervention_at(at)
    zeroed = replace(before, zeroed_levels=before.zeroed_levels | levels)
    return changed(playback, at, zeroed, playback.edit_at(at), once=True)


def events_of(playback: Playback, search: CausalSearch) -> Events | None:
    """The events of the window that the search found; `None` where it found none."""
    at = search.entered_at
    if at is None:
        return None
    return window_events(playback.recording, playback.windows[at], playback.edit_at(at))

"""The newest page that had its recording: where it returns to when another one cannot be opened."""

from __future__ import annotations

import time
from dataclasses import dataclass, replace

from app.state.view_state import ViewState

SAID_FOR = 30.0
"""Seconds for which the page says why it returned."""
SETTLED = 0.6
"""Seconds after which widgets are told once more what is open: a hand was on them when the page returned."""


@dataclass(frozen=True, slots=True)
class Refused:
    """A recording that was asked for and could not be opened."""

    recording_id: str = ""
    why: str = ""
    """Empty once it has been said for long enough."""


NOTHING_REFUSED = Refused()


class Standing:
    """Used by the visitor's thread alone."""

    def __init__(self) -> None:
        self.page: ViewState | None = None
        """The newest page that had its recording."""
        self.recording_id: str | None = None
        """That page's recording."""
        self.has_refused = False
        """Whether there is a refused recording to tell of."""
        self._refused = NOTHING_REFUSED
        self._said_at = 0.0
        self._seen_at = 0.0

    def note(self, state: ViewState) -> None:
        """This page has its recording."""
        if self.recording_id is not None and state.recording_id != self.recording_id:
            self._refused, self.has_refused = NOTHING_REFUSED, False
        self.page, self.recording_id = state, state.recording_id

    def returned(self, now: ViewState, opened_id: str | None, why: str) -> ViewState | None:
        """The page before the one that failed for the reason `why`; `None` where that is not open any more."""
        if self.page is None or opened_id != self.page.recording_id:
            return None
        self._refused, self._said_at, self.has_refused = Refused(now.recording_id, why), time.monotonic(), True
        return replace(self.page, workspace=now.workspace, tab=now.tab, visit=now.visit, is_playing=False)

    @property
    def refused(self) -> Refused:
        """What was refused, until another recording is open; why, for a while."""
        is_said = time.monotonic() - self._said_at < SAID_FOR
        return self._refused if is_said else replace(self._refused, why="")

    def is_due(self, now: float) -> bool:
        """Whether the page is to be drawn though nothing has happened: when it has returned, and when it is silent."""
        times = [self._said_at + after for after in (SETTLED, SAID_FOR)] if self._refused.why else []
        was, self._seen_at = self._seen_at, now
        return any(was < at <= now for at in times)

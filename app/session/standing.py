"""The newest page that had its recording: where it returns to when another one cannot be opened."""

from __future__ import annotations

import time
from dataclasses import replace

from app.state.view_state import ViewState

SAID_FOR = 30.0
"""Seconds for which the page says why it returned."""


class Standing:
    """Used by the visitor's thread alone."""

    def __init__(self) -> None:
        self._state: ViewState | None = None
        self._why = ""
        self._said_at = 0.0

    def note(self, state: ViewState) -> None:
        """This page has its recording."""
        self._state = state

    def returned(self, now: ViewState, opened_id: str | None, why: str) -> ViewState | None:
        """The page before the one that failed for the reason `why`; `None` where that is not open any more."""
        if self._state is None or opened_id != self._state.recording_id:
            return None
        self._why, self._said_at = why, time.monotonic()
        return replace(self._state, workspace=now.workspace, tab=now.tab, visit=now.visit, is_playing=False)

    @property
    def refused(self) -> str:
        """Why the page returned, for a while."""
        return self._why if time.monotonic() - self._said_at < SAID_FOR else ""

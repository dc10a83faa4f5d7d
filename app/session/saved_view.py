"""A view survives a reload and a reconnect: it is kept in the visitor's own browser, one for each tab."""

from __future__ import annotations

import time
from collections.abc import Sequence

import viser

from app.state.stored import from_text, to_text
from app.state.view_state import Slice, ViewState

PATIENCE = 5.0
"""Seconds to wait for the browser's answer: a busy machine answers late, and a view that is not waited for is lost."""
BETWEEN_WRITES = 0.7


class SavedView:
    """Reads and writes one tab's view. `default.recording_id` is part of the key: another start has other views."""

    def __init__(self, client: viser.ClientHandle, default: ViewState, initial: Sequence[Slice]) -> None:
        self._client = client
        self._default = default
        self._initial = initial
        self._tab: int | None = None
        self._kept = ""
        self._kept_state: ViewState | None = None
        self._kept_at = 0.0

    @property
    def knows_tab(self) -> bool:
        """Whether the page has said which tab it is."""
        return self._tab is not None

    def recall(self, tab: int) -> tuple[ViewState, tuple[str, ...]]:
        """The view that this tab had, and what of it was refused. The default for a new tab, or a silent browser."""
        self._tab = tab
        try:
            text = self._client.local_storage.get_item(self._key, timeout=PATIENCE)
        except (TimeoutError, RuntimeError):
            return self._default, ()
        return (self._default, ()) if text is None else from_text(text, self._default, self._initial)

    def keep(self, state: ViewState) -> None:
        """Store the view, if it has changed, and not more often than useful."""
        is_too_soon = time.monotonic() - self._kept_at < BETWEEN_WRITES
        if self._tab is None or state is self._kept_state or is_too_soon:
            return
        text, self._kept_state = to_text(state), state
        if text != self._kept:
            self._client.local_storage.set_item(self._key, text)
            self._kept, self._kept_at = text, time.monotonic()

    @property
    def _key(self) -> str:
        return f"view:{self._default.recording_id}:{self._tab}"

"""One intent, one new page: the shared moment first, then every view's slice. Nothing else may change a page."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from app.state import intents as ask
from app.state.checks import checked, with_word
from app.state.reduce import reduce_shared
from app.state.view_state import Limits, ViewState
from app.views.view import Here, View


def reduce_views(state: ViewState, intent: Any, limits: Limits, views: Sequence[View]) -> ViewState:
    """The page after `intent`. Each view sees the page as it was before."""
    here = Here(state, limits)
    changed = []
    for view in views:
        is_set = isinstance(intent, ask.Set) and intent.view == view.name
        if not is_set and not view.hears(intent):
            continue
        before = view.of(state)
        # What was set goes through the view's own reducer, too: fields may depend on each other.
        after = view.reduce(_set(before, intent) if is_set else before, intent, here)
        if after is not before:
            changed.append(after)
    shared = reduce_shared(state, intent, limits)
    return shared.put(*changed) if changed else shared


def _set(slice_: Any, intent: ask.Set) -> Any:
    """A page may send anything; what does not fit changes nothing."""
    try:
        if intent.is_word:
            return with_word(slice_, intent.field, str(intent.value))
        return replace(slice_, **{intent.field: checked(type(slice_), intent.field, intent.value)})
    except ValueError:
        return slice_

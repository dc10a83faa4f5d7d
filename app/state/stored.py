"""A page as text and back, for the browser's own storage: what comes back is a stranger's word and is checked."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from typing import Any

from app.catalogue.recording_id import whole_id
from app.state.checks import bounded_json, restored, to_plain
from app.state.view_state import Slice, ViewState


def to_values(state: ViewState) -> dict[str, Any]:
    """What of a page is worth keeping, as values of JSON. A page that comes back does not start to play by itself."""
    kept = to_plain(state)
    if "recording_id" in kept:
        kept["recording_id"] = whole_id(state.recording_id)  # a part is open for a minute, a link stays
    views = {slice_.view: to_plain(slice_) for slice_ in state.slices}
    return kept | {"views": {name: plain for name, plain in views.items() if plain}}


def to_text(state: ViewState) -> str:
    """The state as JSON."""
    return json.dumps(to_values(state), separators=(",", ":"))


def from_text(text: str, default: ViewState, initial: Sequence[Slice]) -> tuple[ViewState, tuple[str, ...]]:
    """`default` with every stored value that is known and sound, and the names of those that were not.

    `initial` are the slices of all views, as they begin.
    """
    try:
        return from_values(bounded_json(text), default, initial)
    except ValueError:
        return default, ("the whole stored view",)


def from_values(stored: object, default: ViewState, initial: Sequence[Slice]) -> tuple[ViewState, tuple[str, ...]]:
    """As `from_text`, of values of JSON."""
    if not isinstance(stored, Mapping):
        return default, ("the whole stored view",)
    shared = {name: value for name, value in stored.items() if name != "views"}
    state, refused = restored(default, shared)
    views = stored.get("views", {})
    if not isinstance(views, Mapping):
        return state, (*refused, "the views")
    known = {slice_.view: slice_ for slice_ in initial}
    for name, plain in views.items():
        if name not in known:
            refused = (*refused, str(name)[:40])
            continue
        slice_, wrong = restored(known[name], plain)
        state = state.put(slice_)
        refused = (*refused, *(f"{name}: {field}" for field in wrong))
    return state, refused

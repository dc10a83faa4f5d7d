"""A moment as one word in an address: what is seen there, and nothing that belongs to one visitor's page alone.

What comes in is a stranger's word: every value passes the checks of a stored view, and recordings and networks are
named by their id in the catalogue, never by a path.
"""

from __future__ import annotations

import base64
import binascii
import json
from collections.abc import Sequence
from dataclasses import replace

from app.state.checks import bounded_json
from app.state.stored import from_values, to_values
from app.state.view_state import Slice, ViewState
from etnet.errors import EtnetError

PARAMETER = "moment"
LONGEST = 3500
"""Characters of a link's value that are looked at; one of ours has about 300, with four runs 1,000."""
VERSION = 2
_CARRIED = (
    "recording_id", "model_id", "precision", "policy", "cleaning", "workspace", "tab", "query", "speed",
    "waits_for_frames", "mark_a", "mark_b", "views",
)  # fmt: skip
_PLAIN = ViewState()


class LinkError(EtnetError):
    """An address names no moment that can be shown here."""


def to_link(state: ViewState, stamp: int) -> str:
    """The value for `stamp`, the end (µs, on the recording's clock) of the current window."""
    kept = to_values(state)
    carried = {name: kept[name] for name in _CARRIED if kept.get(name)}
    text = json.dumps({"v": VERSION, "t": stamp, **carried}, separators=(",", ":"))
    return base64.urlsafe_b64encode(text.encode()).decode("ascii").rstrip("=")


def from_link(value: str, present: ViewState, initial: Sequence[Slice]) -> tuple[ViewState, tuple[str, ...]]:
    """The page that a link leads to, paused at its moment, and the names of what in it makes no sense here.

    What a link never carries stays as it is `present`; the rest is as on a fresh page, and nothing is changed inside
    the network. Raises `LinkError` when it carries no moment at all.
    """
    carried = _opened(value)
    version, stamp = carried.pop("v", None), carried.pop("t", None)
    if version != VERSION:
        raise LinkError("this link was made by another version of the viewer; copy a new one there with the key C")
    if isinstance(stamp, bool) or not isinstance(stamp, int) or abs(stamp) > 1 << 62 or "recording_id" not in carried:
        raise LinkError("this link names no moment; copy one with the key C")
    shared = [name for name in _CARRIED if name != "views"]
    unset = replace(present, slices=(), **{name: getattr(_PLAIN, name) for name in shared})
    known = {name: value for name, value in carried.items() if name in _CARRIED}
    state, refused = from_values(known, unset, initial)
    foreign = tuple(sorted(str(name)[:40] for name in carried if name not in _CARRIED))
    return replace(state, is_playing=False, index=0, moment=stamp), (*refused, *foreign)


def _opened(value: str) -> dict[str, object]:
    if len(value) > LONGEST:
        raise LinkError(f"this link is {len(value):,} characters long; one of this viewer's has at most {LONGEST:,}")
    try:
        text = base64.urlsafe_b64decode(value.encode("ascii") + b"=" * (-len(value) % 4)).decode("utf-8")
        carried = bounded_json(text)
    except (ValueError, binascii.Error):
        carried = None
    if not isinstance(carried, dict):
        raise LinkError("this link cannot be read; perhaps it was cut off when it was copied")
    return carried

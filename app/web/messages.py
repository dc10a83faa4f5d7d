"""What a page may say to viser: the few types of message that ours sends, each with its fields and their bounds.

viser broadcasts some of what a client sends, keeps some of it for later visitors, and raises in its event loop at
values that do not fit. So a message reaches it only if it is one that our page can send.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any, Literal, NamedTuple

import msgspec

LONGEST_NAME = 200
"""Characters of an id."""
LONGEST_TEXT = 20_000
"""Characters of a text field's value."""
LONGEST_STORED = 200_000
"""Characters of a stored view; what is longer than ours is refused by name where it is read."""
LARGEST_NUMBER = 1e15
LARGEST_WHOLE = 1 << 53
LARGEST_SIDE = 1 << 16
MOST_PARTS = 16
"""Numbers of one value."""
FIRST = "ViewerCameraMessage"
"""What a page says before anything else: viser counts a client as connected from then on."""
Fate = Literal["pass", "drop", "close"]
Check = Callable[[object], bool]


class MessageError(ValueError):
    """A message that no page of ours sends."""


class Message(NamedTuple):
    """A message that may pass: its type, its fields, and the bytes that are handed on."""

    kind: str
    fields: Mapping[str, Any]
    raw: bytes


def read_message(raw: object, is_first: bool) -> Message:
    """One frame of a page as a message, if it is one that ours sends.

    Raises:
        MessageError: it is not; the text says why, without a word of the frame's own.
    """
    if not isinstance(raw, bytes):
        raise MessageError("a frame of text")
    try:
        content = msgspec.msgpack.decode(raw)
    except (ValueError, RecursionError, MemoryError, OverflowError):
        raise MessageError("no MessagePack") from None
    if not isinstance(content, dict) or not isinstance(kind := content.pop("type", None), str):
        raise MessageError("no type")
    if kind not in _FIELDS:
        raise MessageError("a type that no page sends")
    if is_first and kind != FIRST:
        raise MessageError("something before its camera")
    needed, optional = _FIELDS[kind], _OPTIONAL.get(kind, {})
    if not needed.keys() <= content.keys() <= needed.keys() | optional.keys():
        raise MessageError(f"{kind} with other fields")
    for name, value in content.items():
        check = needed.get(name) or optional[name]
        if not check(value):
            raise MessageError(f"{kind} with a {name} that does not fit")
    return Message(kind, content, _mended(kind, content, raw))


def fate_of(widget: Any, value: object) -> Fate:
    """What becomes of a new value for one of viser's widgets.

    A value of the wrong type comes from no page of ours. One that is not among the options may come from one whose
    widget has changed since: it is left out.
    """
    held = widget.value
    props = getattr(getattr(widget, "_impl", None), "props", widget)
    if isinstance(held, bool):
        return "pass" if isinstance(value, bool) else "close"
    if isinstance(held, int | float):
        # One out of range is brought inside by the view that it is for.
        return "pass" if _is_number(value) else "close"
    if isinstance(held, str):
        if not isinstance(value, str):
            return "close"
        options = getattr(props, "options", None)
        return "pass" if options is None or value in options else "drop"
    if isinstance(held, tuple):
        is_alike = isinstance(value, list) and len(value) == len(held) and all(map(_is_number, value))
        return "pass" if is_alike else "close"
    return "close"


def _mended(kind: str, content: dict[str, Any], raw: bytes) -> bytes:
    """The same bytes; a canvas that is not laid out yet has no side, and viser divides by it."""
    if kind != FIRST or (content["image_height"] >= 1 and content["image_width"] >= 1):
        return raw
    sides = {name: max(int(content[name]), 1) for name in ("image_height", "image_width")}
    return msgspec.msgpack.encode({**content, **sides, "type": kind})


def _is_number(value: object) -> bool:
    if isinstance(value, bool) or not isinstance(value, int | float):
        return False
    return math.isfinite(value) and abs(value) <= LARGEST_NUMBER if isinstance(value, float) else _is_whole(value)


def _is_whole(value: object) -> bool:
    return isinstance(value, int) and not isinstance(value, bool) and abs(value) <= LARGEST_WHOLE


def _is_side(value: object) -> bool:
    return _is_number(value) and 0 <= value <= LARGEST_SIDE  # pyright: ignore[reportOperatorIssue]


def _is_angle(value: object) -> bool:
    return _is_number(value) and 0 < value < math.pi  # pyright: ignore[reportOperatorIssue]


def _is_text(longest: int) -> Check:
    return lambda value: isinstance(value, str) and len(value) <= longest


def _is_vector(length: int) -> Check:
    return lambda value: isinstance(value, list) and len(value) == length and all(map(_is_number, value))


def _or_nothing(check: Check) -> Check:
    return lambda value: value is None or check(value)


def _is_value(value: object) -> bool:
    if isinstance(value, list):
        return len(value) <= MOST_PARTS and all(map(_is_number, value))
    return isinstance(value, bool) or _is_number(value) or (isinstance(value, str) and len(value) <= LONGEST_TEXT)


def _is_update(value: object) -> bool:
    return isinstance(value, dict) and value.keys() == {"value"} and _is_value(value["value"])


_is_name = _is_text(LONGEST_NAME)
_FIELDS: Mapping[str, Mapping[str, Check]] = {
    FIRST: {
        "wxyz": _is_vector(4),
        "position": _is_vector(3),
        "fov": _is_angle,
        "near": _is_number,
        "far": _is_number,
        "image_height": _is_side,
        "image_width": _is_side,
        "look_at": _is_vector(3),
        "up_direction": _is_vector(3),
    },
    "GuiUpdateMessage": {"uuid": _is_name, "updates": _is_update},
    "CommandTriggerMessage": {"uuid": _is_name},
    "SceneNodeClickMessage": {
        "name": _is_name,
        "instance_index": _or_nothing(_is_whole),
        "ray_origin": _is_vector(3),
        "ray_direction": _is_vector(3),
        "screen_pos": _is_vector(2),
        "modifier": _or_nothing(_is_name),
    },
    "LocalStorageGetItemResponseMessage": {
        "value": _or_nothing(_is_text(LONGEST_STORED)),
        "error": _or_nothing(_is_text(LONGEST_TEXT)),
        "request_uuid": _is_name,
    },
}
_OPTIONAL: Mapping[str, Mapping[str, Check]] = {"SceneNodeClickMessage": {"owner": _is_name}}

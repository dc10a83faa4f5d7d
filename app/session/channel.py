"""What a page can say beyond viser's widgets: clicks on its HTML, three more keys, its size, which tab it is.

viser has no click on an HTML image. Its own end-to-end tests use a hook, `window.__viserMutable.sendMessage`, that is
in every build; through it `static/page/channel.js` writes into an invisible text field of ours. This module and that
file are all that knows of it. A browser test pins it; without it sliders, buttons and the plane still work.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from html import escape
from typing import Any, cast, get_args

import viser

from app.state import intents as ask
from app.state.view_state import Workspace
from app.views.view import View

LONGEST_MESSAGE = 200
LONGEST_LINK = 4000
"""Characters: more than a link may have, so that one that is too long is refused by name and not cut."""


@dataclass(frozen=True, slots=True)
class Hello:
    """A page has come up: the tab it lives in (0 … 255) and the size of its window in CSS pixels."""

    tab: int
    width: int
    height: int


@dataclass(frozen=True, slots=True)
class Resized:
    """The window's size in CSS pixels has changed."""

    width: int
    height: int


@dataclass(frozen=True, slots=True)
class AskHelp:
    """The question mark was pressed."""


@dataclass(frozen=True, slots=True)
class Touched:
    """A hand is on the page, wherever: in public the demo then hands over to it."""


@dataclass(frozen=True, slots=True)
class FollowLink:
    """The page's address names a moment (`app.state.link`)."""

    value: str


@dataclass(frozen=True, slots=True)
class Copied:
    """The address of the current moment went into the clipboard, or could not."""

    is_done: bool


@dataclass(frozen=True, slots=True)
class RemoveFile:
    """An uploaded file is not wanted any more."""

    recording_id: str


@dataclass(frozen=True, slots=True)
class Hover:
    """Where the pointer is over the timeline, in seconds since the first event; `None` where it has left it."""

    seconds: float | None


Message = Hover | Hello | Resized | AskHelp | Touched | FollowLink | Copied | RemoveFile
_KEYS: dict[str, Any] = {
    "comma": ask.Move(-1),
    "period": ask.Move(1),
    "left": ask.Move(-1),
    "right": ask.Move(1),
    "far-left": ask.Move(-10),
    "far-right": ask.Move(10),
    "question": AskHelp(),
}


def open_channel(gui: viser.GuiApi, hear: Callable[[Any], None], views: Sequence[View], ticket: str = "") -> None:
    """Put the channel's ends into the page; `hear` gets what comes, on viser's event loop.

    `ticket` lets the page upload files (`app.web.upload_endpoint`); without one it does not offer to.
    """
    field = gui.add_text("channel", "", visible=False)

    @field.on_update
    async def _(event: viser.GuiEvent[viser.GuiTextHandle]) -> None:
        if event.client is not None and (heard := parse(event.target.value, views)) is not None:
            hear(heard)

    # A script inside innerHTML does not run; an image that has loaded does. On a reconnect it names the new field.
    start = f"window.etnetChannel='{field._impl.uuid}';window.etnetHello?.()"
    pixel = "data:image/gif;base64,R0lGODlhAQABAIAAAAAAAP///yH5BAEAAAAALAAAAAABAAEAAAIBRAA7"
    lets = f' data-etv-ticket="{escape(ticket)}"' if ticket else ""
    gui.add_html(f'<img alt="" style="display:none" src="{pixel}"{lets} onload="{escape(start)}">')


def parse(text: str, views: Sequence[View]) -> Any:
    """One message of the page, "kind|…|counter"; `None` for what cannot be understood. It is a stranger's word."""
    try:
        text.encode()  # half a surrogate pair can be said in JSON, but no page can be sent with it
    except UnicodeEncodeError:
        return None
    if text.startswith("link|"):
        return FollowLink(text[:LONGEST_LINK].split("|")[1])
    parts = text[:LONGEST_MESSAGE].split("|")
    try:
        match parts:
            case ["pick", key, u, v, _]:
                return _picked(key, float(u), float(v), views)
            case ["key", name, _]:
                return _KEYS.get(name)
            case ["copied", is_done, _]:
                return Copied(is_done == "1")
            case ["hover", seconds, _]:
                return Hover(_seconds(seconds))
            case ["touch", _]:
                return Touched()
            case ["hello", tab, width, height, _]:
                return Hello(int(tab) % 256, _pixels(width), _pixels(height))
            case ["size", width, height, _]:
                return Resized(_pixels(width), _pixels(height))
    except (ValueError, OverflowError):
        return None
    return None


def _picked(key: str, u: float, v: float, views: Sequence[View]) -> Any:
    """A click on HTML with `data-k`: what the page itself understands, else the view whose name stands first."""
    if not (math.isfinite(u) and math.isfinite(v)):
        return None
    kind, _, words = key.partition(":")
    match kind:
        case "pixel":
            return ask.QueryFraction(u, v)
        case "cut":
            x, y, width, height = (int(part) for part in words.split(","))
            return ask.Query(int(x + u * width), int(y + v * height))
        case "at":
            x, y = (int(part) for part in words.split(","))
            return ask.Query(x, y)
        case "span":
            start, stop = (float(part) for part in words.split(","))
            return ask.SeekTime(start + u * (stop - start))
        case "mark":
            name, _, span = words.partition(":")
            start, stop = (float(part) for part in span.split(","))
            return ask.PutMark("a" if name == "a" else "b", start + u * (stop - start))
        case "goto":
            return ask.SeekTime(float(words))
    return _pressed(kind, words, views)


def _pressed(kind: str, words: str, views: Sequence[View]) -> Any:
    match kind:
        case "help":
            return AskHelp()
        case "open":
            return ask.OpenRecording(words)
        case "reopen":
            return ask.ReopenRecording(words)
        case "remove":
            return RemoveFile(words)
        case "workspace":
            return ask.ShowWorkspace(cast("Workspace", words)) if words in get_args(Workspace) else None
        case "tab":
            return ask.OpenTab(words)
        case "stage":
            return ask.StageCard(words)
        case "set":
            place, _, value = words.partition(":")
            view, _, field = place.partition(".")
            return ask.Set(view, field, value, is_word=True)
    return next((view.hear(words) for view in views if view.name == kind), None)


def _seconds(text: str) -> float | None:
    seconds = float(text) if text else math.nan
    return min(max(seconds, 0.0), 1e9) if math.isfinite(seconds) else None


def _pixels(text: str) -> int:
    return min(max(int(text), 1), 20_000)

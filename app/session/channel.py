"""What a page can say beyond viser's widgets: clicks on its images, three more keys, its size, which tab it is.

viser has no click on an HTML image. Its own end-to-end tests use a hook, `window.__viserMutable.sendMessage`, that is
in every build; through it `static/page/channel.js` writes into an invisible text field of ours. This module and that
file are all that knows of it. A browser test pins it; without it sliders, buttons and the plane still work.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from html import escape
from typing import get_args

import viser

from app.state import intents as ask
from app.views.compare.state import AddLane, ChooseLane, Lane, RemoveLane
from app.views.inspect import state as inside_view
from app.views.recording import state as source_view
from etnet.events.denoise import Cleaning

ON_PICK = 'data-pick="1"'
"""The attribute that makes an element of `data-k` clickable; the same for all visitors, so that HTML is shared."""
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
    """A hand is on the page, wherever: in public the demo then lets go of it."""


@dataclass(frozen=True, slots=True)
class FollowLink:
    """The page's address names a moment (`app.state.link`)."""

    value: str


@dataclass(frozen=True, slots=True)
class Copied:
    """The address of the moment on show went into the clipboard, or could not."""

    is_done: bool


@dataclass(frozen=True, slots=True)
class RemoveFile:
    """A file that was handed over is not wanted any more."""

    recording_id: str


Message = Hello | Resized | AskHelp | Touched | FollowLink | Copied | RemoveFile
_KEYS: dict[str, ask.Intent | AskHelp] = {"comma": ask.Move(-1), "period": ask.Move(1), "question": AskHelp()}


def open_channel(gui: viser.GuiApi, hear: Callable[[ask.Intent | Message], None], ticket: str = "") -> None:
    """Put the channel's ends into the page; `hear` gets what comes, on viser's event loop.

    `ticket` lets the page hand over files (`app.web.upload_endpoint`); without one it does not offer to.
    """
    field = gui.add_text("channel", "", visible=False)

    @field.on_update
    async def _(event: viser.GuiEvent[viser.GuiTextHandle]) -> None:
        if event.client is not None and (heard := parse(event.target.value)) is not None:
            hear(heard)

    # A script inside innerHTML does not run; an image that has loaded does. On a reconnect it names the new field.
    start = (
        f"window.etnetChannel='{field._impl.uuid}';"
        "if(window.etnetHello)window.etnetHello();else if(!document.getElementById('etnet-channel')){"
        "const s=document.createElement('script');s.id='etnet-channel';s.src='/static/channel.js';"
        "document.head.append(s)}"
    )
    pixel = "data:image/gif;base64,R0lGODlhAQABAIAAAAAAAP///yH5BAEAAAAALAAAAAABAAEAAAIBRAA7"
    lets = f' data-etv-ticket="{escape(ticket)}"' if ticket else ""
    gui.add_html(
        f'<link rel="stylesheet" href="/static/theme.css"{lets}>'
        f'<img alt="" style="display:none" src="{pixel}" onload="{escape(start)}">'
    )


def parse(text: str) -> ask.Intent | Message | None:
    """One message of the page, "kind|…|counter"; `None` for what cannot be understood. It is a stranger's word."""
    if text.startswith("link|"):
        return FollowLink(text[:LONGEST_LINK].split("|")[1])
    parts = text[:LONGEST_MESSAGE].split("|")
    try:
        match parts:
            case ["pick", key, u, v, _]:
                return _picked(key, float(u), float(v))
            case ["key", name, _]:
                return _KEYS.get(name)
            case ["copied", is_done, _]:
                return Copied(is_done == "1")
            case ["touch", _]:
                return Touched()
            case ["hello", tab, width, height, _]:
                return Hello(int(tab) % 256, _pixels(width), _pixels(height))
            case ["size", width, height, _]:
                return Resized(_pixels(width), _pixels(height))
    except ValueError:
        return None
    return None


def _picked(key: str, u: float, v: float) -> ask.Intent | AskHelp | RemoveFile | None:
    if not (math.isfinite(u) and math.isfinite(v)):
        return None
    kind, _, name = key.partition(":")
    match kind:
        case "pixel":
            return ask.QueryFraction(u, v)
        case "site":
            return ask.OpenSite(name)
        case "heads":
            return ask.CloseSite()
        case "help":
            return AskHelp()
        case "head":
            return ask.ChooseHead(None if name == "mean" else int(name))
        case "open":
            return ask.OpenRecording(name)
        case "workspace":
            return ask.ShowWorkspace(known) if (known := workspace_named(name)) is not None else None
        case "bin":
            return ask.OpenBin(int(name) if name else None)
        case "inside":
            return inside_view.heard(name)
        case "remove":
            return RemoveFile(name)
        case "source":
            return source_view.heard(name)
        case "lane":
            return _lane(name)
        case "cut":
            x, y, width, height = (int(part) for part in name.split(","))
            return ask.Query(int(x + u * width), int(y + v * height))
        case "at":
            x, y = (int(part) for part in name.split(","))
            return ask.Query(x, y)
        case "span":
            start, stop = (float(part) for part in name.split(","))
            return ask.SeekTime(start + u * (stop - start))
        case "goto":
            return ask.SeekTime(float(name))
    return None


def workspace_named(name: str) -> ask.Workspace | None:
    """The workspace of a name that a page sent."""
    return next((known for known in get_args(ask.Workspace) if known == name), None)


def _lane(name: str) -> ask.Intent:
    if name == "add":
        return AddLane()
    if name == "cleaned":
        return AddLane(Lane(cleaning=Cleaning(hot_pixels=True, support_within=5_000)))
    kind, _, number = name.rpartition(":")
    return RemoveLane(int(number)) if kind == "remove" else ChooseLane(int(number))


def _pixels(text: str) -> int:
    return min(max(int(text), 1), 20_000)

"""The demo: large live pictures that captions point at, and buttons a finger cannot miss."""

from __future__ import annotations

from html import escape

from app.catalogue.recording_id import listed_id
from app.html.attention.maps import places_html
from app.html.elements import ON_PICK
from app.html.moment import newest_of
from app.html.pictures import camera_frame_html, event_image_html
from app.html.uploads import public_handing_html
from app.views.attention.state import AttentionState, look_of
from app.views.demo.state import Act, DemoState
from app.views.events.state import EventsState
from app.views.page import Page
from app.views.reconstruction.html import reconstruction_of
from app.views.reconstruction.state import tones_of

SAYINGS: dict[Act, tuple[str, str]] = {
    "events": (
        "Changes the sensor reported",
        "This sensor takes no pictures: each pixel only tells when it became brighter or darker.",
    ),
    "image": (
        "Image the network makes of them",
        "A neural network paints this from the changes alone. It never sees the camera.",
    ),
    "places": (
        "Where the network looks",
        "To redraw the spot under the cross, the network reads the places that glow.",
    ),
}
"""What stands above each picture, and what is said while the demo points at it."""
_CAMERA = ("Ordinary camera, to compare", "Touch a picture to see which places the network compares that spot with.")
_YOURS = "Your turn. Drag the strip below, or touch a picture."
_INSIDE = f'<button class="etv-big" data-k="workspace:attention" {ON_PICK}>Where the network looks</button>'


def demo_html(page: Page) -> str:
    """Three live pictures; while nobody touches the page one of them is pointed at."""
    moment = page.moment
    if moment is None:
        return '<div class="etv-demo"></div>'
    act = page.state.of(DemoState).act
    style = page.state.of(EventsState).event_image
    shown = [
        _figure("events", act, event_image_html(newest_of(moment) if page.follows else moment, style)),
        _figure("image", act, reconstruction_of(page)),
        _third(page),
    ]
    public = " etv-public" if page.state.is_public else ""
    return f'<div class="etv-demo{public}" data-testid="demo" data-act="{act}">{"".join(shown)}</div>'


def caption_html(act: Act) -> str:
    """What is said of the picture that is pointed at, for a page without room for all of them."""
    if act == "none":
        return ""
    title, words = SAYINGS[act]
    return f'<div class="etv-caption" data-testid="caption"><b>{title}</b><span>{words}</span></div>'


def compact_html(page: Page) -> str:
    """The demo on a phone: what is said of the current picture and the invitation, or what there is to choose from."""
    return (
        f'<div class="etv-compact">{caption_html(page.state.of(DemoState).act)}{bar_html(page, ways_inside="")}</div>'
    )


def _third(page: Page) -> str:
    """The ordinary camera until somebody asks where the network looks, then what it reads from there."""
    act = page.state.of(DemoState).act
    assert page.moment is not None
    if page.state.query is not None or page.moment.recording.ground_truth is None:
        return _figure("places", act, places_html(page.ready, look_of(page), page.state.of(AttentionState).site))
    title, words = _CAMERA
    camera = camera_frame_html(page.moment, tones=tones_of(page))
    saying = words if act == "none" else ""
    return f"<figure><h2>{title}</h2>{camera}<figcaption>{saying}</figcaption></figure>"


def _figure(name: Act, act: Act, content: str) -> str:
    """A picture under its name; what it is, below it, while it is pointed at or a visitor leads."""
    title, words = SAYINGS[name]
    is_pointed = name == act
    mark = ' class="etv-pointed" data-testid="pointed"' if is_pointed else ""
    saying = words if is_pointed or act == "none" else ""
    return f"<figure{mark}><h2>{title}</h2>{content}<figcaption>{saying}</figcaption></figure>"


def bar_html(page: Page, ways_inside: str = _INSIDE) -> str:
    """Who leads, the recordings to choose from, and the way inside."""
    if page.state.of(DemoState).act != "none":
        return '<div class="etv-bar" data-testid="invitation"><b>Touch anything to try it yourself</b></div>'
    back = ""
    if page.is_live:
        words, chosen = ("You see it live", " etv-chosen") if page.follows else ("Back to live", "")
        back = f'<button class="etv-big{chosen}" data-k="live:follow" {ON_PICK}>{words}</button>'
    recordings = "".join(
        f'<button class="etv-big{" etv-chosen" if choice.id == listed_id(page.state.recording_id) else ""}" '
        f'data-k="open:{escape(choice.id)}" {ON_PICK}>{escape(choice.title)}</button>'
        for choice in page.recordings
        if not (page.is_live and choice.id == page.state.recording_id)
    )
    own = "" if page.uploads is None else public_handing_html(page.uploads)
    return (
        f'<div class="etv-bar" data-testid="yours"><span>{_YOURS}</span>'
        f'<span class="etv-choices">{back}{recordings}{ways_inside}{own}</span></div>'
    )

"""The demo's face: one sentence, three pictures, one slider, round buttons."""

from __future__ import annotations

import numpy as np

from app.catalogue.recording_id import listed_id
from app.html.elements import ON_PICK, empty, escape, marker, picture
from app.html.moment import ARRAYS, PICTURES, Moment
from app.html.pictures import camera_image
from app.html.pictures import reconstruction_image as grey_image
from app.html.timeline_marks import AXIS_WIDTH, curve_of, place_of, plan_of, seconds_of, span_of
from app.views.demo.map import map_html
from app.views.demo.sheets import delay_html
from app.views.demo.state import Act, DemoState
from app.views.page import Choice, Page
from app.views.reconstruction.state import tones_of
from etnet.render.encode import data_url

ACTS: tuple[Act, ...] = ("events", "image", "places", "invite")
SAYINGS: dict[Act, str] = {
    "events": "This camera takes no pictures. Each dot is a pixel that just got brighter or darker.",
    "image": "From these dots alone, a network paints the image. It never sees the camera.",
    "places": "To redraw the ringed spot, the network looks at the places that glow.",
    "invite": "Now you: touch a spot, drag through time, or see your own face as dots.",
}
"""What is said while the demo points at something."""
_IMAGE = "Image the network makes of them"
YOURS = "Your turn: touch a spot, drag through time, or see your own face as dots."
GUESSING = "What is this? Each dot is a pixel that got brighter or darker. Guess, then look."
MIRRORED = "This is you, as a simulated event sensor sees you: what does not move is not there."
TITLES = {
    "astronaut": "An astronaut, seen in passing",
    "prints": "Photographs on a wall",
    "rolling": "Things that roll",
}
"""Of the bundled recordings, in words."""
_TRACK = 56
_ICONS = {
    "spot": '<circle cx="10" cy="10" r="5"/><path d="M10 1v4M10 15v4M1 10h4M15 10h4"/>',
    "face": '<circle cx="10" cy="7" r="4"/><path d="M3 18c1-4 4-5 7-5s6 1 7 5"/>',
    "home": '<path d="M3 3h5v5H3zM12 3h5v5h-5zM3 12h5v5H3zM12 12h2v2h-2zM15 15h2v2h-2z"/>',
    "play": '<path d="M6 3.500v13l11-6.500z" fill="currentColor"/>',
    "pause": '<path d="M6.500 4v12M13.500 4v12" stroke-width="4"/>',
    "next": '<path d="M4 5h9l-3-3M16 15H7l3 3"/>',
    "guess": '<path d="M7 7a3 3 0 1 1 4.500 2.600c-1 .6-1.500 1.200-1.500 2.400M10 16v.2"/>',
    "help": '<circle cx="10" cy="10" r="8"/><path d="M8 8a2.200 2.200 0 1 1 3 2c-.7.400-1 .9-1 1.800M10 14v.2"/>',
    "cube": '<path d="M10 2 17 6v8l-7 4-7-4V6zM3 6l7 4 7-4M10 10v8"/>',
}


def title_of(choice: Choice) -> str:
    """A recording's title in words."""
    if choice.title in TITLES:
        return TITLES[choice.title]
    words = choice.title.rsplit(".", 1)[0].replace("_", " ").replace("-", " ").strip()
    return words[:1].upper() + words[1:] or choice.title


def lead_html(page: Page) -> str:
    """The sentence; how far the show is; small buttons."""
    state = page.state.of(DemoState)
    steps = "".join(f"<i{' class=etv-on' if act == state.act else ''}></i>" for act in ACTS)
    leads = f'<span class="etv-steps" aria-hidden="true">{steps}</span>' if state.act != "none" else ""
    who = "invitation" if state.act != "none" else "yours"
    return (
        f'<section class="etv-demo-bar etv-lead"><h1 data-testid="{who}">{escape(saying(page))}</h1>'
        f'{leads}<span class="etv-small">{_small(page)}</span></section>'
    )


def saying(page: Page) -> str:
    """The one sentence that is said now."""
    state = page.state.of(DemoState)
    if page.mirror is not None and page.mirror.is_live:
        return MIRRORED
    if state.guess == "asked":
        return GUESSING
    if state.act != "none":
        return SAYINGS[state.act]
    if state.large == "map" and page.state.query is not None:
        return SAYINGS["places"]
    return YOURS


def _small(page: Page) -> str:
    """Another recording, the guessing game, help."""
    listed = [choice.id for choice in page.recordings]
    now = listed_id(page.state.recording_id)
    following = page.recordings[(listed.index(now) + 1) % len(listed)] if now in listed else None
    parts = []
    if following is not None and following.id != now:
        title = title_of(following)
        parts.append(_round(f"open:{following.id}", "next", f"Another scene: {title}"))
    parts.append(_round("demo:guess", "guess", "Guess first"))
    parts.append(_round("help", "help", "Help"))
    return "".join(parts)


def pictures_html(page: Page) -> str:
    """The image, the camera's, and the map where that is the large one."""
    moment, state = page.moment, page.state.of(DemoState)
    if moment is None:
        said = empty("One moment", film_words(page) or page.trouble or "The next scene is being opened.")
        return f'<section class="etv-demo etv-three" data-testid="demo"><div class="etv-wait">{said}</div></section>'
    veil = {"asked": " etv-veiled", "shown": " etv-unveiled"}.get(state.guess, "")
    pointed = ' data-testid="pointed"' if state.act == "image" else ""
    chosen = " etv-pointed" if state.act == "image" else ""
    tools = delay_html(page) or film_html(page)
    image = _figure(f"etv-image{chosen}{veil}", _IMAGE, image_html(page), pointed, tools)
    camera = _figure(f"etv-camera{veil}", "What an ordinary camera saw", camera_html(page, moment))
    large = ""
    if state.large == "map":
        back = _round("demo:cloud", "cube", "Back to the events")
        large = _figure("etv-map", "Where the network looks", map_html(page), ' data-testid="map"', back)
    public = " etv-public" if page.state.is_public else ""
    return (
        f'<section class="etv-demo etv-three{public}" data-testid="demo" data-act="{state.act}"'
        f' data-large="{state.large}">{large}{image}{camera}</section>'
    )


def film_words(page: Page) -> str:
    """How far a video has become dots; empty for what is no video, and once it is whole."""
    film = page.video
    if film is None or film.is_over:
        return ""
    return f"The video becomes dots: {film.done:.1f} of {film.total:.1f} s"


def film_html(page: Page) -> str:
    """The same, beside the image."""
    words = film_words(page)
    return f'<span class="etv-delay" data-testid="film">{words}</span>' if words else ""


def _figure(classes: str, title: str, content: str, marks: str = "", tools: str = "") -> str:
    return (
        f'<figure class="etv-figure {classes}"{marks}><h2>{title}{tools}</h2>'
        f'<div class="etv-frame">{content}</div></figure>'
    )


def image_html(page: Page) -> str:
    """The newest image, or what is waited for."""
    ready = page.ready
    if ready is None:
        why = page.failed.message if page.failed is not None else "The network starts; its first image appears here."
        return empty("One moment" if page.failed is None else "No image", why)
    tones = tones_of(page)
    url = PICTURES.text(("frame", ready.key, tones), lambda: data_url(grey_image(ready, tones), is_lossless=False))
    name = f"Reconstruction of window {ready.request.index}"
    height, width = ready.frame.shape
    return picture(url, name, key="pixel", marks=_ring(page, width, height), size=(width, height))


def camera_html(page: Page, moment: Moment) -> str:
    """What an ordinary camera saw then, with the same ring."""
    tones = tones_of(page)
    found = camera_image(moment, tones)
    if found is None:
        return empty("No camera here", "This recording holds the changes only.")
    grey, stamp = found
    height, width = grey.shape
    url = PICTURES.text(("camera", moment.recording_id, stamp, tones), lambda: data_url(grey, is_lossless=False))
    return picture(url, "Camera frame", key="pixel", marks=_ring(page, width, height), size=(width, height))


def _ring(page: Page, width: int, height: int) -> list[str]:
    query = page.state.query
    return [] if query is None else [marker((query[0] + 0.5) / width, (query[1] + 0.5) / height)]


def foot_html(page: Page) -> str:
    """Play, the one slider, and three things to do."""
    state = page.state.of(DemoState)
    if page.mirror is not None and page.mirror.is_live:
        return '<section class="etv-demo-bar etv-foot" hidden></section>'  # the mirror's own stands there
    plays = page.state.is_playing
    play = _round("demo:play", "pause" if plays else "play", "Pause" if plays else "Play")
    if state.guess == "asked":
        ask = _ask("demo:reveal", "", "Show the image", is_first=True)
    else:
        mirror = "" if page.mirror is None else _ask("demo:mirror", "face", "Your own face", is_first=True)
        home = _ask("demo:home", "home", "Take it home") if page.gives_home else ""
        ask = _ask("demo:spot", "spot", "Touch a spot", is_first=not mirror) + mirror + home
        if page.is_live and not page.follows:
            ask = _ask("live:follow", "", "Back to live") + ask
    breathes = " etv-breathes" if state.act == "invite" else ""
    return (
        f'<section class="etv-demo-bar etv-foot{breathes}">{play}{track_html(page.moment)}'
        f'<span class="etv-ask">{ask}</span></section>'
    )


def track_html(moment: Moment | None) -> str:
    """The recording's time as one wide slider; its height is how much happened."""
    if moment is None:
        return '<div class="etv-track" data-testid="track"></div>'
    begin, end = seconds_of(moment)
    at = place_of(moment, moment.window.t_stop) / AXIS_WIDTH
    shape = ARRAYS.get(("demo track", *plan_of(moment)), lambda: _shape(moment), len)
    return (
        f'<div class="etv-track" data-testid="track" role="slider" tabindex="0" aria-label="Time"'
        f' aria-valuemin="{begin:.2f}" aria-valuemax="{end:.2f}" aria-valuenow="{begin + at * (end - begin):.2f}"'
        f' data-k="span:{span_of(moment)}"'
        f' data-drag="1" {ON_PICK} style="--x:{at:.3%}"><svg viewBox="0 0 {AXIS_WIDTH} {_TRACK}"'
        f' preserveAspectRatio="none" aria-hidden="true"><path d="{shape}"/></svg><b></b></div>'
    )


def _shape(moment: Moment) -> str:
    curve = curve_of(moment)
    if len(curve.stamps) == 0:
        return ""
    top = max(float(np.max(curve.rates)), 1e-9)
    points = [
        f"{place_of(moment, float(t)):.0f} {_TRACK - 0.75 * _TRACK * float(r) / top:.1f}"
        for t, r in zip(curve.stamps, curve.rates, strict=True)
    ]
    first = points[0].split()[1]
    return f"M0 {_TRACK}L0 {first}L{'L'.join(points)}L{AXIS_WIDTH} {points[-1].split()[1]}V{_TRACK}Z"


def _round(key: str, name: str, words: str) -> str:
    return (
        f'<button class="etv-round" data-k="{escape(key)}" {ON_PICK} title="{escape(words)}"'
        f' aria-label="{escape(words)}">{_icon(name)}</button>'
    )


def _ask(key: str, name: str, words: str, *, is_first: bool = False) -> str:
    first = " etv-first" if is_first else ""
    return f'<button class="etv-big{first}" data-k="{escape(key)}" {ON_PICK}>{_icon(name)}{escape(words)}</button>'


def _icon(name: str) -> str:
    if not name:
        return ""
    return (
        '<svg viewBox="0 0 20 20" aria-hidden="true" fill="none" stroke="currentColor" stroke-width="1.7"'
        f' stroke-linejoin="round">{_ICONS[name]}</svg>'
    )

"""The pictures of one moment: what the sensor reported, what the network makes of it, what a camera saw.

How grey values are shown, what a picture's colours stand for, two pictures under a sliding line, and the window's
events as a cloud of points.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float32, UInt8

from app.catalogue.cut import is_live
from app.engine.requests import Failed, Ready, Working
from app.html.attention.changed import change_words
from app.html.elements import bar, chip, empty, escape, legend, marker, panel, picture, swatch
from app.html.moment import ARRAYS, PICTURES, Moment
from app.html.units import count, milliseconds, short
from etnet.errors import RecordingError
from etnet.render.colours import OFF, ON, counting, css_gradient, diverging, hexadecimal
from etnet.render.encode import Indexed, data_url
from etnet.render.events import BUSY, EventStyle, event_image, polarity_colours
from etnet.render.tone import GAMMA, Tone, resolve, tone_map


@dataclass(frozen=True, slots=True)
class Tones:
    """`is_linear_light` is what the network's card says of its frames."""

    tone: Tone = "auto"
    is_linear_light: bool = True


_TONE_WORDS = {
    "raw": "linear",
    "gamma": "gamma 2.2",
    "robust": "percentile 1–99 %",
    "hdr": "auto HDR",
    "clahe": "CLAHE",
}


def reconstruction_image(ready: Ready, tones: Tones) -> UInt8[np.ndarray, "h w"]:
    """The reconstruction in grey levels."""
    key = ("grey", ready.key, tones)
    return ARRAYS.get(key, lambda: tone_map(ready.frame, tones.tone, tones.is_linear_light), lambda grey: grey.nbytes)


def camera_image(moment: Moment, tones: Tones) -> tuple[UInt8[np.ndarray, "h w"], int] | None:
    """The camera frame nearest to the window's end, in the reconstruction's tone, and its stamp (µs)."""
    truth = moment.recording.ground_truth
    if truth is None or len(truth) == 0:
        return None
    index = truth.nearest(moment.window.t_stop)
    stamp = int(truth.stamps[index])  # frames of a live recording change their numbers
    key = ("camera", moment.recording_id, stamp, tones)
    try:
        grey = ARRAYS.get(
            key, lambda: tone_map(truth.read_frame(index), tones.tone, tones.is_linear_light), lambda made: made.nbytes
        )
    except RecordingError:
        if is_live(moment.recording):
            return None  # it has left the buffer
        raise
    return grey, stamp


def reconstruction_html(
    ready: Ready | None,
    *,
    tones: Tones,
    wanted: int | None = None,
    query: tuple[int, int] | None = None,
    working: Working | None = None,
    failed: Failed | None = None,
    badge: str = "",
    beside: str = "",
) -> str:
    """The newest frame that is there, what kind of frame it is and, with `wanted`, how far that window has come.

    `badge`: a chip of the caller's, before the others.
    """
    lag = lag_line(ready, wanted, working, failed)
    if ready is None:
        headline = "No image yet" if failed is None else "No image"
        body = empty(headline, "The network rebuilds brightness from events alone; its first image appears here.")
        return panel("reconstruction", body, lag)
    height, width = ready.frame.shape
    url = PICTURES.text(
        ("frame", ready.key, tones), lambda: data_url(reconstruction_image(ready, tones), is_lossless=False)
    )
    marks = [marker((query[0] + 0.5) / width, (query[1] + 0.5) / height)] if query else []
    image = picture(
        url,
        f"Reconstruction of window {ready.request.index}",
        key="pixel",
        marks=marks,
        size=(width, height),
        reads=grey_reads(tones),
    )
    if beside:
        image = swiped(image, beside, ("reconstruction", "camera"), width / height)
    lags = "et-lags" if ready.is_former or wanted not in (None, ready.request.index) else ""
    return panel("reconstruction", f'<div class="{lags}">{image}</div>', lag, badges(ready, tones, badge))


def lag_line(ready: Ready | None, wanted: int | None, working: Working | None, failed: Failed | None) -> str:
    """What is shown and what is being computed; nothing when the wanted frame is there."""
    if failed is not None:
        return f'<div class="et-failed" role="alert" data-testid="failed">{escape(failed.message)}</div>'
    if wanted is None:
        return ""
    is_former = ready is not None and ready.is_former
    is_there = ready is not None and ready.request.index == wanted and not ready.is_approximate and not is_former
    if is_there and working is None:
        return ""
    total = working.total if working else 0
    share = working.done / total if working and total else 0.0
    shown = (
        ""
        if ready is None or is_former or ready.request.index == wanted
        else f" · shows frame {count(ready.request.index)}"
    )
    how_far = f": warm-up {working.done} of {total}" if working and total else ": computing"
    text = working.message if working and not total and working.message else f"Frame {count(wanted)}{how_far}{shown}"
    return f'<div class="et-lag" data-testid="lag"><span>{escape(text)}</span>{bar(share, waits=not total)}</div>'


def badges(ready: Ready, tones: Tones, first: str = "") -> str:
    """What may be claimed of this frame, as small badges; `first` stands before them."""
    found = [first] if first else []
    if ready.is_former:
        found.append(chip("former settings", "warning", "Made with another network, filter or cut into windows"))
    elif ready.is_exact:
        found.append(chip("exact", "exact", "Equal, bit for bit, to running every window from the first one on"))
    elif ready.is_approximate:
        found.append(
            chip(
                "approximate preview",
                "warning",
                f"From a cold start {ready.num_warm} windows earlier; the exact frame follows",
            )
        )
    elif not ready.request.is_original:
        found.append(chip("changed", "warning", change_words(*ready.request.change[:2])))
        found.append('<button class="et-button" data-k="inspect:reset" data-pick="1">Reset all</button>')
    elif ready.began_at:
        found.append(cold_start_chip(ready))
    else:
        found.append(chip("not the plain run", "warning", "Something inside the network or its runtime was changed"))
    if ready.is_cold and not ready.is_former:
        seen = f"warm-up {ready.num_seen} of {ready.warm_up}" if ready.warm_up else "warm-up"
        found.append(chip(seen, "plain", "Near the first window the network has seen too little to be sure"))
    tone = _TONE_WORDS[resolve(tones.tone, tones.is_linear_light)]
    found.append(f'<span class="et-note">{milliseconds(ready.milliseconds)} · {escape(tone)}</span>')
    return f'<div class="et-chips">{"".join(found)}</div>'


def cold_start_chip(ready: Ready) -> str:
    """Of a frame that was not come to from a live recording's first window."""
    began = f"The memory was empty at window {count(ready.began_at)}"
    why = "what came before had left the buffer, or was passed over to catch up"
    return chip("from a cold start", "warning", f"{began}: {why}")


def camera_picture(moment: Moment, tones: Tones) -> str:
    """The camera's frame as a picture alone; nothing where there is none."""
    if (found := camera_image(moment, tones)) is None:
        return ""
    grey, stamp = found
    height, width = grey.shape
    url = PICTURES.text(("camera", moment.recording_id, stamp, tones), lambda: data_url(grey, is_lossless=False))
    return picture(url, "Camera frame", key="pixel", size=(width, height), reads=grey_reads(tones))


def camera_frame_html(moment: Moment, *, tones: Tones) -> str:
    """The ordinary camera's frame at this moment, in the same tone, or why there is none."""
    found = camera_image(moment, tones)
    if found is None and is_live(moment.recording) and moment.recording.ground_truth is not None:
        return panel("camera", empty("Gone", "This camera frame has left the buffer of the live recording."))
    if found is None:
        body = empty(
            "No camera frame in this recording",
            "This sensor, or this file, holds events only. There is no ordinary image to compare with.",
        )
        return panel("camera", body)
    offset = (found[1] - moment.window.t_stop) / 1000
    when = "frame at window end" if abs(offset) < 0.05 else _beside(offset)
    return panel("camera", camera_picture(moment, tones), f'<div class="et-caption"><span>{escape(when)}</span></div>')


def _beside(offset_ms: float) -> str:
    side = "after" if offset_ms > 0 else "before"
    return f"{milliseconds(abs(offset_ms))} {side} window end"


def event_image_html(moment: Moment, style: EventStyle) -> str:
    """All events of the window in one picture, with a legend in numbers."""
    key = ("events", moment.key, style)
    return PICTURES.text(key, lambda: _event_image_html(moment, style))


def event_picture(moment: Moment, style: EventStyle) -> tuple[Indexed, float]:
    """The event image, and the number its brightest colour stands for."""
    window = moment.window
    return ARRAYS.get(
        ("event picture", moment.key, style),
        lambda: event_image(moment.events, style, window.t_start, window.t_stop),
        lambda made: made[0].nbytes,
    )


def _event_image_html(moment: Moment, style: EventStyle) -> str:
    image, limit = event_picture(moment, style)
    height, width = image.level.shape
    num_on = int((moment.events.p > 0).sum())
    total = moment.window.num_events
    shown = picture(
        data_url(image, is_lossless=True),
        f"{count(total)} events of window {moment.index}",
        key="pixel",
        size=(width, height),
        classes="et-sharp" if width < 200 else "",
    )
    hues = "".join(
        [
            swatch(hexadecimal(ON), f"brighter (ON) {count(num_on)}"),
            swatch(hexadecimal(OFF), f"darker (OFF) {count(total - num_on)}"),
        ]
    )
    if total == 0:
        return panel("events", shown, '<div class="et-note">No pixel reported a change in this window.</div>')
    return panel("events", shown, f'<div class="et-swatches">{hues}</div>', _event_legend(style, limit))


def _event_legend(style: EventStyle, limit: float) -> str:
    match style:
        case "polarity":
            return f'<div class="et-note">Colour: latest polarity; saturates at {BUSY} events</div>'
        case "count":
            ticks = [(0.0, "0"), (1.0, f"≥ {short(limit)}")]
            return legend("events per pixel, both polarities", css_gradient(counting()), ticks)
        case "time surface":
            return f'<div class="et-note">colour: latest polarity · bright: now · dark: {short(limit)} ms ago</div>'
        case "decay":
            ticks = [(0.0, f"−{short(limit)}"), (0.5, "0"), (1.0, f"+{short(limit)}")]
            return legend("signed events, older ones fading", css_gradient(diverging()), ticks)


_STOPS = 33
"""Colours of a ramp that are handed over; between two of them it runs straight."""


def grey_reads(tones: Tones) -> str:
    """A raw frame in grey levels. Nothing where a tone depends on the whole frame: its greys name no value."""
    match resolve(tones.tone, tones.is_linear_light):
        case "gamma":
            return f"grey:0:1:{GAMMA}"
        case "raw":
            return "grey:0:1:1"
    return ""


def ramp_reads(colours: UInt8[np.ndarray, "n 3"], low: float, high: float, unit: str = "") -> str:
    """Values from `low` to `high` in the colours of a ramp, from its first to its last; `unit` stands after them."""
    chosen = colours[np.linspace(0, len(colours) - 1, _STOPS).round().astype(int)]
    stops = ",".join(hexadecimal((int(red), int(green), int(blue))) for red, green, blue in chosen)
    return f"ramp:{low:.6g}:{high:.6g}:{stops}:{unit}"


def swiped(left: str, right: str, names: tuple[str, str], ratio: float) -> str:
    """`left` is seen left of the line, `right` right of it; `ratio` is their width to their height."""
    left_name, right_name = (escape(name) for name in names)
    return (
        f'<div class="et-swipe" data-testid="swipe" style="--ratio:{ratio:.4f}">{right}<div>{left}</div><i></i>'
        f'<span class="et-swiped">{left_name}</span><span class="et-swiped">{right_name}</span></div>'
    )


@dataclass(frozen=True, slots=True, eq=False)
class EventCloud:
    """`positions`: pixel x and y (their middles), and age: 0 at the window's end (newest) … 1 at its start."""

    positions: Float32[np.ndarray, "n 3"]
    colours: UInt8[np.ndarray, "n 3"]
    num_events: int
    duration_ms: float
    is_traced: bool = False
    """Whether the colours say what a pixel owes to the events, and not their polarity."""

    @property
    def is_thinned(self) -> bool:
        """Whether some events are left out."""
        return len(self.positions) < self.num_events


def event_cloud(moment: Moment, limit: int) -> EventCloud:
    """At most `limit` points: every k-th event, so that density over time and place is kept."""
    return ARRAYS.get(
        ("cloud", moment.key, limit), lambda: _cloud(moment, limit), lambda made: 15 * len(made.positions)
    )


def _cloud(moment: Moment, limit: int) -> EventCloud:
    events, window = moment.events, moment.window
    chosen = np.arange(len(events))
    if len(events) > limit:
        chosen = np.linspace(0, len(events) - 1, limit).round().astype(np.int64)
    positions = np.empty((len(chosen), 3), np.float32)
    positions[:, 0] = events.x[chosen] + 0.5
    positions[:, 1] = events.y[chosen] + 0.5
    positions[:, 2] = (window.t_stop - events.t[chosen]) / max(window.t_stop - window.t_start, 1)
    colours = polarity_colours(events, chosen)
    return EventCloud(positions, colours, len(events), (window.t_stop - window.t_start) / 1000)

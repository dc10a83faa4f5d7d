"""Which events made this pixel: a signed picture of what it owes them, how far back, and the cloud coloured by it."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float32

from app.html.controls import button, buttons, plain_bar, signed_legend, signed_picture
from app.html.elements import escape, marker, panel
from app.html.moment import ARRAYS
from app.html.units import count, milliseconds, of_whole
from app.views.inspect.results import Traced
from app.views.scene.points import EventCloud
from etnet.render.colours import diverge

BACK = (0, 1, 2, 4, 8)
"""Windows that can be traced back through."""
QUIET = 0.02
"""Of the colour range: what owes less is drawn small in number, so that the rest is seen."""


def traced_html(traced: Traced | None, key: object, num_back: int, on_pick: str) -> str:
    """Picture, windows and how to read them; only the choice of how far back while there is no answer."""
    far = "".join(
        button("this window" if back == 0 else f"{back} back", f"set:num_back:{back}", on_pick, is_on=back == num_back)
        for back in BACK
    )
    choice = buttons("Trace back", far)
    if traced is None:
        return panel("traced", choice)
    height, width = traced.windows[0].events.sensor.height, traced.windows[0].events.sensor.width
    owed = ARRAYS.get(("owed", key), lambda: _owed(traced, height, width), lambda made: made.nbytes)
    limit = max(float(np.percentile(np.abs(owed[owed != 0]), 99.5)) if owed.any() else 0.0, 1e-5)
    x, y = traced.pixel
    image = signed_picture(
        owed,
        limit,
        "what the pixel owes to events",
        ("owed", key),
        on_pick=on_pick,
        marks=marker((x + 0.5) / width, (y + 0.5) / height),
    )
    num = sum(len(window.weights) for window in traced.windows)
    near = _share_near(traced, 16)
    lead = (
        f"Pixel ({x}, {y}) has {100 * traced.value:.1f} % of full brightness. Its gradient goes back to {count(num)} "
        "events: orange ones made it brighter, blue ones darker. The events in the scene wear the same colours."
    )
    said = f"{of_whole(near)} of it comes from events within 16 pixels."
    return panel(
        "traced",
        choice,
        f'<div class="et-note">{escape(lead)}</div>',
        image,
        signed_legend("all events of a pixel together make it", limit),
        f'<div class="et-note" data-testid="near">{said}</div>',
        "<h4>How far back</h4>",
        _windows(traced),
        '<div class="et-note">A gradient says what a small change would do; near white or black it is close to 0. '
        "What came before the first window is taken as given.</div>",
    )


def traced_cloud(traced: Traced, key: object, limit: int) -> EventCloud:
    """The traced windows' events, oldest at age 1, coloured by what the pixel owes them; the strongest are all there.

    At most `limit` points: half of them the strongest, the others taken evenly from the rest, as a dim ground.
    """
    return ARRAYS.get(
        ("traced cloud", key, limit), lambda: _cloud(traced, limit), lambda made: 15 * len(made.positions)
    )


def weight_limit(traced: Traced) -> float:
    """Where colours end: the 99th percentile of what single pixels owe, at least a hair."""
    weights = np.abs(np.concatenate([window.weights for window in traced.windows]))
    active = weights[weights > 0]
    return max(float(np.percentile(active, 99)) if active.size else 0.0, 1e-5)


def _owed(traced: Traced, height: int, width: int) -> Float32[np.ndarray, "h w"]:
    total = np.zeros((height, width), np.float32)
    for window in traced.windows:
        np.add.at(total, (window.events.y, window.events.x), window.weights)
    return total


def _share_near(traced: Traced, pixels: int) -> float:
    x, y = traced.pixel
    near = whole = 0.0
    for window in traced.windows:
        events, weights = window.events, np.abs(window.weights)
        apart = np.hypot(events.x.astype(np.float32) - x, events.y.astype(np.float32) - y)
        near += float(weights[apart <= pixels].sum())
        whole += float(weights.sum())
    return near / whole if whole else 0.0


def _windows(traced: Traced) -> str:
    """Σ |weight| of each window, as shares."""
    amounts = [float(np.abs(window.weights).sum()) for window in traced.windows]
    whole = max(sum(amounts), 1e-20)
    stop = traced.windows[-1].t_stop
    rows = []
    for window, amount in zip(reversed(traced.windows), reversed(amounts), strict=True):
        ago = milliseconds((stop - window.t_stop) / 1000)
        when = "this window" if window is traced.windows[-1] else f"window {count(window.index)}, ended {ago} earlier"
        rows.append(
            f'<span class="et-note">{when}</span><span class="et-measure">{plain_bar(amount / whole, 1.0)}'
            f"<b>{of_whole(amount / whole)}</b></span>"
        )
    return f'<div class="et-table et-two">{"".join(rows)}</div>'


def _cloud(traced: Traced, limit: int) -> EventCloud:
    windows = traced.windows
    start, stop = windows[0].t_start, windows[-1].t_stop
    span = max(stop - start, 1)
    weights = np.concatenate([window.weights for window in windows])
    places = np.concatenate(
        [
            np.stack(
                [window.events.x + np.float32(0.5), window.events.y + np.float32(0.5), (stop - window.events.t) / span],
                axis=1,
            )
            for window in windows
        ]
    ).astype(np.float32)
    end = weight_limit(traced)
    is_loud = np.abs(weights) > QUIET * end
    loud, quiet = np.flatnonzero(is_loud), np.flatnonzero(~is_loud)
    if len(loud) > limit // 2:
        loud = loud[np.argpartition(-np.abs(weights[loud]), limit // 2)[: limit // 2]]
    room = min(limit - len(loud), len(loud) * 2 + 2000)  # the ground must not hide what matters
    if len(quiet) > room:
        quiet = quiet[np.linspace(0, len(quiet) - 1, room).round().astype(np.int64)] if room > 0 else quiet[:0]
    chosen = np.concatenate([quiet, loud])
    colours = np.maximum(diverge(weights[chosen], end), np.uint8(52))  # dim grey where nothing is owed
    return EventCloud(places[chosen], colours, len(weights), span / 1000, is_traced=True)

"""Which events made this pixel: a signed picture of what it owes them, how far back, and the cloud coloured by it."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float32

from app.html.controls import button, buttons, plain_bar, signed_legend, signed_picture
from app.html.elements import escape, marker, panel
from app.html.moment import ARRAYS
from app.html.units import count, milliseconds, of_whole
from app.views.inspect.results import Traced

BACK = (0, 1, 2, 4, 8)
"""Windows that can be traced back through."""


def traced_html(traced: Traced | None, key: object, num_back: int) -> str:
    """Picture, windows and how to read them; only the choice of how far back while there is no answer."""
    far = "".join(
        button("this window" if back == 0 else f"{back} back", f"set:inspect.num_back:{back}", is_on=back == num_back)
        for back in BACK
    )
    choice = buttons("Backpropagate", far, "through so many windows before this one")
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
        "<h4>Share of each window</h4>",
        _windows(traced),
        '<div class="et-note">A gradient says what a small change would do; near white or black it is close to 0. '
        "What came before the first window is taken as given.</div>",
    )


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

"""The events of the scene, coloured by what the traced pixel owes them."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np

from app.html.moment import ARRAYS
from app.html.pictures import EventCloud
from app.views.inspect.results import Traced
from app.views.page import Page
from etnet.render.colours import diverge

QUIET = 0.02
"""Of the colour range: what owes less is drawn small in number, so that the rest is seen."""


def scene_cloud(page: Page) -> Callable[[int], EventCloud] | None:
    """The cloud of the current window's attribution; `None` while there is none."""
    found, moment = page.results.get("inspect.traced"), page.moment
    traced = None if found is None else found.value
    if found is None or moment is None or not isinstance(traced, Traced):
        return None
    if traced.windows[-1].index != moment.index or not page.is_about(found.job.request):
        return None
    return partial(traced_cloud, traced, found.job)


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

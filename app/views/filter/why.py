"""Why is it bad here? What is wrong with the current frame's input, each with a button that helps."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from app.catalogue.cut import is_live
from app.engine.warmth import SPARSEST, first_warm
from app.html.elements import ON_PICK, escape
from app.html.moment import ARRAYS, Moment
from app.html.timeline_marks import curve_of, plan_of
from app.html.units import count, milliseconds, of_whole, short
from app.views.filter.state import STATISTICS_SLOT, SUITED_DENSITY
from app.views.page import Page
from etnet.events.fitness import Fitness
from etnet.windows import ByDensity

STILL = 0.02
"""Of the pixels: where fewer have had an event nothing moved to speak of."""
LITTLE_GAIN = 0.05
"""A frame–event offset that raises the correlation by less is not worth a correction."""
_RANGES = (
    ("noise_rate", "noise rate", " Hz/px"),
    ("on_off_ratio", "ON : OFF", ""),
    ("refractory_us", "refractory period", " µs"),
)


@dataclass(frozen=True, slots=True)
class Finding:
    """What is wrong, in one sentence, and the button that helps: its words and what a click sends."""

    name: str
    text: str
    button: str = ""
    key: str = ""


def why_html(page: Page) -> str:
    """The card; it says so where nothing is found."""
    if page.moment is None:
        return ""
    found = list(findings(page))
    rows = "".join(_row(finding) for finding in found)
    if not found:
        said = (
            "Measuring the recording …"
            if _is_unknown(page, page.moment)
            else "Nothing found: density, noise and warm-up suit."
        )
        rows = f'<div class="et-note">{said}</div>'
    return f'<div class="et" data-testid="why"><h4>Why is it bad here?</h4>{rows}</div>'


def _is_unknown(page: Page, moment: Moment) -> bool:
    """Whether this window's frame, or what the recording is like, is still on its way."""
    ready, result = page.ready, page.results.get(STATISTICS_SLOT)
    if result is None or not (result.is_whole or result.trouble):
        return True
    is_here = ready is not None and not ready.is_former and ready.request.index == moment.index
    return not is_here or result.job.request.playback != _playback(page)


def _row(finding: Finding) -> str:
    button = ""
    if finding.button:
        button = f'<button class="et-button" data-k="{escape(finding.key)}" {ON_PICK}>{escape(finding.button)}</button>'
    return (
        f'<div class="etv-finding" data-testid="why-{finding.name}"><span>{escape(finding.text)}</span>{button}</div>'
    )


def findings(page: Page) -> Iterator[Finding]:
    """What is known to be wrong at the current window, the most likely reason first."""
    moment = page.moment
    if moment is None:
        return
    yield from _warm_up(page, moment)
    yield from _density(page, moment)
    yield from _motion(moment)
    result = page.results.get(STATISTICS_SLOT)
    fitness: Fitness | None = None
    if result is not None and result.job.request.playback == _playback(page):
        fitness = result.value
    if fitness is not None:
        yield from _hot(page, fitness)
        yield from _offset(fitness)
        yield from _range(page, fitness)


def _playback(page: Page) -> object:
    return None if page.ready is None else replace(page.ready.request.plain, cold_at=0).playback


def _warm_up(page: Page, moment: Moment) -> Iterator[Finding]:
    ready = page.ready
    if ready is None or ready.is_former or not ready.is_cold or ready.request.index != moment.index:
        return
    band, num_pixels = page.model.trained_band, moment.recording.sensor.num_pixels
    sparsest = SPARSEST if band is None else band[0]
    warm = first_warm(moment.windows, ready.warm_up, num_pixels, sparsest, ready.began_at)
    text = f"Warm-up {ready.num_seen} of {ready.warm_up}: the state has seen too little to be sure of the brightness."
    if warm is None:
        yield Finding(
            "warm-up", text if is_live(moment.recording) else f"{text} It will not be warm in this recording."
        )
        return
    at = (moment.windows[warm].t_stop - moment.recording.span.start) / 1e6
    yield Finding("warm-up", text, f"Go to window {count(warm)}", f"goto:{at:.6f}")


def _density(page: Page, moment: Moment) -> Iterator[Finding]:
    band, value = page.model.trained_band, moment.events_per_pixel
    if band is None or band[0] <= value <= band[1]:
        return
    than = "fewer" if value < band[0] else "more"
    text = f"{short(value)} events per pixel: {than} than trained on ({short(band[0])} – {short(band[1])})."
    is_set = moment.policy == ByDensity(SUITED_DENSITY)
    yield Finding("density", text, *(() if is_set else (f"Set {SUITED_DENSITY} ev/px", "filter:density")))


def _motion(moment: Moment) -> Iterator[Finding]:
    share = _active(moment)
    if share >= STILL:
        return
    quiet = "more than 99 %" if 0 < share < 0.01 else of_whole(1 - share)
    text = f"No events in {quiet} of the pixels: nothing moved there."
    curve = curve_of(moment)
    moves = (curve.indices > moment.index) & (curve.rates > np.median(curve.rates))
    later = curve.indices[moves].tolist()
    if not later:
        yield Finding("static", text)
        return
    at = (moment.windows[later[0]].t_stop - moment.recording.span.start) / 1e6
    yield Finding("static", text, "Go to motion", f"goto:{at:.6f}")


def _active(moment: Moment) -> float:
    """The share of pixels that fired in the window."""

    def make() -> float:
        events, sensor = moment.events, moment.recording.sensor
        places = events.y.astype(np.int64) * sensor.width + events.x
        return len(np.unique(places)) / sensor.num_pixels

    return ARRAYS.get(("active", *plan_of(moment), moment.index), make)


def _hot(page: Page, fitness: Fitness) -> Iterator[Finding]:
    if not fitness.hot or page.state.cleaning.hot_pixels:
        return
    worst = fitness.hot[0]
    num = len(fitness.hot)
    plural = "s" if num > 1 else ""
    where = f"({worst.x}, {worst.y}), fired {count(worst.num_events)} times"
    text = f"{count(num)} hot pixel{plural}; the worst, {where}."
    cleaning = replace(page.state.cleaning, hot_pixels=True)
    yield Finding("hot", text, "Filter", f"filter:{cleaning.text}")


def _offset(fitness: Fitness) -> Iterator[Finding]:
    lag = fitness.lag
    if lag is None or lag.shift == 0 or lag.correlation - lag.correlation_unshifted < LITTLE_GAIN:
        return
    text = f"Camera frames fit best {milliseconds(abs(lag.shift) / 1000)} {'later' if lag.shift > 0 else 'earlier'}."
    yield Finding("offset", text, "Use this offset", f"set:compare.offset:{lag.shift}")


def _range(page: Page, fitness: Fitness) -> Iterator[Finding]:
    activity = fitness.activity
    if activity is None:
        return
    measured = {
        "noise_rate": activity.noise_rate,
        "on_off_ratio": activity.on_share / max(1 - activity.on_share, 1e-9),
        "refractory_us": activity.refractory,
    }
    outside = []
    for key, words, unit in _RANGES:
        band, value = page.model.card.get(key), measured[key]
        if isinstance(band, list) and len(band) == 2 and value is not None and not band[0] <= value <= band[1]:
            trained = f"{short(float(band[0]))} – {short(float(band[1]))}"
            outside.append(f"{words} {short(value)}{unit} (trained on {trained})")
    if outside:
        yield Finding("range", f"Out of the training range: {', '.join(outside)}.", "Statistics", "workspace:recording")

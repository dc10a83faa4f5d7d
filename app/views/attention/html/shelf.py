"""The shelf: the heads of the chosen site, and the site over time. Its tokens are in `tokens`."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np

from app.engine.jobs import JobResult
from app.html.attention.maps import base_url, head_words, map_facts, map_html
from app.html.chart import Line, chart
from app.html.controls import percent, under_way
from app.html.elements import escape, panel, segmented
from app.html.units import of_whole
from app.views.attention.html.atlas import effect_words, measured_of
from app.views.attention.html.shown import Shown, missing, not_button, shown_of
from app.views.attention.jobs.time import Curve
from app.views.attention.state import AttentionState, Quantity
from app.views.page import Page
from app.views.stretch import NEAR

QUANTITIES: dict[Quantity, str] = {"entropy": "entropy", "mass": "local mass", "effect": "effect"}


def heads_html(page: Page) -> tuple[str, str, str]:
    """Note, tools and body of the card of heads."""
    shown, tools = shown_of(page), not_button(page.state.of(AttentionState))
    if shown is None:
        return "", tools, panel("site-heads", missing(page, is_brief=True))
    effects = measured_of(shown).get(shown.site)
    cells: list[tuple[float, str]] = []
    for head, row in enumerate(shown.rows()):
        bits, pixels = map_facts(shown.attention, row, shown.look.query)
        map_ = map_html(shown.attention, row, shown.look, f"head {head}", f"set:attention.head:{head}")
        mark = " et-chosen" if head == shown.look.head else ""
        value = float("nan") if effects is None else float(effects[head])
        effect = "…" if np.isnan(value) else effect_words(value)
        muted = (shown.site, head) in shown.ready.request.intervention.masked_heads
        title = f"{bits:.2f} bits, mean distance {pixels:.0f} px"
        label = f'<span class="et-label" title="{title}"><b>{head}</b><span>{effect}</span></span>'
        places = {"network": head, "effect": -abs(value), "image": -abs(value), "entropy": bits, "distance": -pixels}
        place = places[shown.look.order]
        mark += " et-muted" if muted else ""
        cell = f'<div class="et-thumb{mark}" data-testid="head-{head}">{map_}{label}</div>'
        cells.append((float("inf") if np.isnan(place) else float(place), cell))
    in_order = "".join(cell for _, cell in sorted(cells, key=lambda cell: cell[0]))
    style = f"--base:url({base_url(shown.ready, shown.attention, shown.look.tones)})"
    body = f'<div class="et-heads et-row-of-heads">{in_order}</div>'
    where = "image" if shown.look.order == "image" else "pixel"
    return f"effect on this {where} when masked", tools, panel("site-heads", body, style=style)


def time_html(page: Page) -> tuple[str, str, str]:
    """Note, tools and body of the card of the site over time."""
    slice_ = page.state.of(AttentionState)
    quantities = {f"set:attention.curve:{name}": words for name, words in QUANTITIES.items()}
    tools = segmented("Quantity", quantities, f"set:attention.curve:{slice_.curve}")
    tools += not_button(slice_)
    shown = shown_of(page)
    if shown is None:
        return "", tools, panel("time", missing(page, is_brief=True))
    result = shown.found("curve")
    if result is None or not isinstance(result.value, Curve) or not _answers(shown, result):
        return "", tools, panel("time", waits(result, "one window after the other"))
    curve = result.value
    rest = "" if result.is_whole else under_way(result.share, f"{len(curve.indices)} of {curve.wanted} windows")
    return "", tools, panel("time", _drawn(shown, curve), rest)


def _answers(shown: Shown, result: JobResult) -> bool:
    job: Any = result.job
    slice_, state = shown.slice_, shown.page.state
    head = slice_.head if slice_.quantity_has_a_head else None
    asked = (state.query, slice_.site, slice_.curve, head, slice_.anchored(state.index))
    return (job.pixel, job.site, job.quantity, job.head, job.anchor) == asked


def _curve_words(shown: Shown) -> str:
    """Of what the loud line is."""
    head = shown.look.head
    match shown.slice_.curve:
        case "effect":
            return "masking " + head_words(head, "mean") if head is not None else "ablating this site"
        case "mass":
            return f"mass within {NEAR} px, " + (f"head {head}" if head is not None else "mean of the heads")
    return f"head {head}" if head is not None else "mean of the heads’ entropies"


def _drawn(shown: Shown, curve: Curve) -> str:
    """Every head in grey, the chosen one or the mean of all in the accent; a click goes to its moment."""
    moment, index = shown.page.moment, shown.page.state.index
    assert moment is not None
    start = moment.recording.span.start
    times = [(stamp - start) / 1e6 for stamp in curve.stamps]
    head = shown.look.head
    lines: list[Line] = []
    if curve.values.shape[1] > 1:
        lines = [
            Line(values.tolist(), name=f"head {each}", key=f"set:attention.head:{each}")
            for each, values in enumerate(curve.values.T)
        ]
    chosen = curve.values[:, head] if head is not None and head < curve.values.shape[1] else curve.values.mean(1)
    lines.append(Line(chosen.tolist(), is_loud=True))
    low, high = min(0.0, float(curve.values.min())), max(float(curve.values.max()), 1e-6)
    say: Callable[[float], str] = percent if shown.slice_.curve == "effect" else partial(of_whole, digits=1)
    if shown.slice_.curve == "entropy":
        low, high, say = 0.0, float(np.log2(shown.grid.num_tokens)), _bits
    place = curve.indices.index(index) if index in curve.indices else None
    said = _curve_words(shown)
    if place is not None:
        said = f"now {say(float(chosen[place]))} · {said}"
    return chart(times, lines, (low, high), say(high), index=place, said=said)


def _bits(value: float) -> str:
    return f"{value:.2f} bits"


def waits(result: JobResult | None, what: str) -> str:
    """How far a job is, or why its answer never comes."""
    if result is not None and result.trouble:
        return f'<div class="et-say" data-testid="lacks">{escape(result.trouble)}.</div>'
    return under_way(0.0 if result is None else result.share, what)

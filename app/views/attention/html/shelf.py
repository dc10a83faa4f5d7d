"""The shelf: the heads of the chosen site, and the site over time. Its tokens are in `tokens`."""

from __future__ import annotations

from typing import Any

import numpy as np

from app.engine.jobs import JobResult
from app.html.attention.maps import base_url, head_words, map_facts, map_html
from app.html.card import segmented
from app.html.controls import under_way
from app.html.elements import ON_PICK, escape, panel
from app.html.units import seconds
from app.views.attention.html.atlas import effect_words, effects_of
from app.views.attention.html.shown import Shown, missing, shown_of
from app.views.attention.jobs.time import NEAR, Curve
from app.views.attention.state import AttentionState, Quantity
from app.views.page import Page

QUANTITIES: dict[Quantity, str] = {"entropy": "entropy", "mass": "local", "effect": "effect"}
_WIDTH, _HEIGHT = 1000, 200


def heads_html(page: Page) -> tuple[str, str]:
    """Note and body of the card of heads."""
    shown = shown_of(page)
    if shown is None:
        return "", panel("site-heads", missing(page, is_brief=True))
    effects = effects_of(shown).get(shown.site)
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
        place = {"network": head, "effect": -abs(value), "entropy": bits, "distance": -pixels}[shown.look.order]
        mark += " et-muted" if muted else ""
        cell = f'<div class="et-thumb{mark}" data-testid="head-{head}">{map_}{label}</div>'
        cells.append((float("inf") if np.isnan(place) else float(place), cell))
    in_order = "".join(cell for _, cell in sorted(cells, key=lambda cell: cell[0]))
    style = f"--base:url({base_url(shown.ready, shown.attention, shown.look.tones)})"
    body = f'<div class="et-heads et-row-of-heads">{in_order}</div>'
    return "effect on this pixel when masked", panel("site-heads", body, style=style)


def time_html(page: Page) -> tuple[str, str, str]:
    """Note, tools and body of the card of the site over time."""
    slice_ = page.state.of(AttentionState)
    quantities = {f"set:attention.curve:{name}": words for name, words in QUANTITIES.items()}
    toggle = f"set:attention.follows:{not slice_.follows}"
    tools = segmented("Quantity", quantities, f"set:attention.curve:{slice_.curve}") + segmented(
        "Follow the patch along its events", {toggle: "patch"}, toggle if slice_.follows else ""
    )
    shown = shown_of(page)
    if shown is None:
        return "", tools, panel("time", missing(page, is_brief=True))
    result = shown.found("curve")
    if result is None or not isinstance(result.value, Curve) or not _answers(shown, result):
        return "", tools, panel("time", waits(result, "one window after the other"))
    curve, note = result.value, _curve_words(shown, slice_)
    rest = "" if result.is_whole else under_way(result.share, f"{len(curve.indices)} of {curve.wanted} windows")
    return note, tools, panel("time", _drawn(shown, curve), rest)


def _answers(shown: Shown, result: JobResult) -> bool:
    job: Any = result.job
    slice_ = shown.slice_
    head = slice_.head if slice_.quantity_has_a_head else None
    asked = (shown.look.query, slice_.site, slice_.curve, head, slice_.follows)
    return (job.pixel, job.site, job.quantity, job.head, job.follows) == asked


def _curve_words(shown: Shown, slice_: AttentionState) -> str:
    head = shown.look.head
    match slice_.curve:
        case "effect":
            return "masking " + head_words(head, "mean") if head is not None else "ablating this site"
        case "mass":
            return f"mass within {NEAR} px"
    return "bits, " + (f"head {head}" if head is not None else "mean of the heads’ entropies")


def _drawn(shown: Shown, curve: Curve) -> str:
    """Every head in grey, the chosen one or the mean of all in the accent; a click goes to its moment."""
    moment, index = shown.page.moment, shown.page.state.index
    assert moment is not None
    start = moment.recording.span.start
    times = [(stamp - start) / 1e6 for stamp in curve.stamps]
    first, last = times[0], max(times[-1], times[0] + 1e-6)
    head = shown.look.head
    lines = [(values, False) for values in curve.values.T] if curve.values.shape[1] > 1 else []
    chosen = curve.values[:, head] if head is not None and head < curve.values.shape[1] else curve.values.mean(1)
    lines.append((chosen, True))
    low, high = min(0.0, float(curve.values.min())), max(float(curve.values.max()), 1e-6)
    if shown.slice_.curve == "entropy":
        low, high = 0.0, float(np.log2(shown.grid.num_tokens))

    def path(values: np.ndarray) -> str:
        points = zip(times, values.tolist(), strict=True)
        return " ".join(
            f"{_WIDTH * (t - first) / (last - first):.1f},{_HEIGHT * (1 - (v - low) / (high - low)):.1f}"
            for t, v in points
        )

    drawn = "".join(
        f'<polyline points="{path(values)}" class="{"et-loud" if is_chosen else ""}"></polyline>'
        for values, is_chosen in lines
    )
    now, unit = "", " bits" if shown.slice_.curve == "entropy" else ""
    if index in curve.indices:
        at = 100 * (times[curve.indices.index(index)] - first) / (last - first)
        now = f'<i class="et-head-line" style="left:{at:.2f}%"></i>'
        here = float(chosen[curve.indices.index(index)])
        now += f'<span class="et-chart-high" data-testid="curve-now">now {here:.4g}{unit}</span>'
    return (
        f'<div class="et-chart et-pick et-over-time" data-k="span:{first:.6f},{last:.6f}" {ON_PICK}'
        f' title="Click to go there"><svg viewBox="0 0 {_WIDTH} {_HEIGHT}" preserveAspectRatio="none">{drawn}</svg>'
        f'{now}<span class="et-chart-low">{escape(seconds(first))}</span>'
        f'<span class="et-chart-low et-chart-end">{escape(seconds(last))}</span>'
        f'<span class="et-chart-high et-chart-end">{high:.3g}{unit}</span></div>'
    )


def waits(result: JobResult | None, what: str) -> str:
    """How far a job is, or why its answer never comes."""
    if result is not None and result.trouble:
        return f'<div class="et-say" data-testid="lacks">{escape(result.trouble)}.</div>'
    return under_way(0.0 if result is None else result.share, what)

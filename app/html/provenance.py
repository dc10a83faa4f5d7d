"""One strip that says what is on show and how it was made."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from app.engine.requests import Ready
from app.html.elements import chip, escape, panel
from app.html.moment import Moment
from app.html.units import milliseconds, policy, short

_BAND_ENDS = 0.01, 10.0
"""Events per pixel at either end of the small scale."""


@dataclass(frozen=True, slots=True)
class ModelFacts:
    """What the strip says of a model: its name, and the events per pixel it was trained on (None: not known)."""

    title: str
    trained_band: tuple[float, float] | None = None
    card: Mapping[str, Any] = field(default_factory=dict)
    """All that the weights file says of itself."""
    is_linear_light: bool = True
    """Whether its frames are near linear light."""
    source: str = ""
    """What the command line calls it."""


def provenance_html(moment: Moment, model: ModelFacts, ready: Ready | None, step_milliseconds: float | None) -> str:
    """file · sensor · model and weights · precision · window policy · ms a step · events per pixel · exact."""
    recording = moment.recording
    facts = [
        ("recording", escape(f"{recording.name} ({recording.format})")),
        ("sensor", escape(f"{recording.sensor} px")),
        ("windows", escape(policy(moment.policy))),
        ("events per pixel", density_html(moment.events_per_pixel, model.trained_band)),
        ("network", escape(model.title)),
        ("computed in", escape(_runtime(ready))),
        ("one step", milliseconds(step_milliseconds) if step_milliseconds else "not measured yet"),
        ("memory", _memory(ready)),
    ]
    listed = "".join(f"<div><dt>{name}</dt><dd>{value}</dd></div>" for name, value in facts)
    return panel("provenance", f'<dl class="et-facts">{listed}{_badge(ready)}</dl>')


def _runtime(ready: Ready | None) -> str:
    if ready is None:
        return "nothing computed yet"
    contract = ready.contract
    cores = "1 thread" if contract.threads == 1 else f"{contract.threads} threads"
    return f"{contract.runtime.precision}, {contract.device}, {cores}"


def _memory(ready: Ready | None) -> str:
    if ready is None:
        return "–"
    if ready.is_approximate:
        return f"cold start {ready.num_warm} windows ago"
    return f"warming up: window {ready.request.index}" if ready.is_cold else "warm"


def _badge(ready: Ready | None) -> str:
    if ready is None:
        return ""
    return chip("exact", "exact") if ready.is_exact else chip("not exact", "warning")


def density_html(value: float, band: tuple[float, float] | None) -> str:
    """Events per pixel beside the band that a network was trained on; just the number where that is not known."""
    if band is None:
        return short(value)
    low, high = (_place(edge) for edge in band)
    verdict = "" if band[0] <= value <= band[1] else " et-warning"
    words = f"trained on {short(band[0])} to {short(band[1])} events per pixel"
    outside = "" if not verdict else (" · fewer" if value < band[0] else " · more") + " than trained on"
    return (
        f'<span class="{verdict.strip()}">{short(value)}{outside}</span>'
        f'<span class="et-band" title="{words}"><i style="left:{low:.0%};width:{high - low:.0%}"></i>'
        f'<b style="left:{_place(value):.0%}"></b></span>'
    )


def _place(value: float) -> float:
    low, high = (math.log10(end) for end in _BAND_ENDS)
    return min(max((math.log10(max(value, 1e-9)) - low) / (high - low), 0.0), 1.0)

"""One strip that says what is shown and how it was made."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from app.engine.requests import Ready
from app.html.elements import escape, panel
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
    architecture: str = ""
    """The class of the network, where a weights file names it."""
    is_untrained: bool = False
    """Whether its weights file knows of no training."""

    @property
    def estimates_variance(self) -> bool:
        """Whether it gives a second map beside its frame: its own estimate of the variance."""
        return self.architecture == "PIENet"


def provenance_html(moment: Moment, model: ModelFacts, ready: Ready | None, step_milliseconds: float | None) -> str:
    """sensor · density · network and precision · windowing · step time · recurrent state: one line of facts.

    The recording's name stands beside it in the bar, and the badge on the picture that it is about.
    """
    listed = "".join(
        f'<div data-fact="{name}" title="{escape(title)}"><dd>{value}</dd></div>'
        for name, _, value, title in _facts(moment, model, ready, step_milliseconds)
    )
    return panel("provenance", f'<dl class="et-facts">{listed}</dl>')


def all_facts_html(moment: Moment, model: ModelFacts, ready: Ready | None, step_milliseconds: float | None) -> str:
    """The same, each with its name, for where a line is too narrow for all of them."""
    return "".join(
        f"<dt>{words}</dt><dd>{value}</dd>" for _, words, value, _ in _facts(moment, model, ready, step_milliseconds)
    )


def _facts(
    moment: Moment, model: ModelFacts, ready: Ready | None, step_milliseconds: float | None
) -> list[tuple[str, str, str, str]]:
    """A fact's mark, its name, its value as HTML, and more of it in words; those that are known."""
    density = density_html(moment.events_per_pixel, model.trained_band)
    network = f"<b>{escape(model.title)}</b> {escape(_precision(ready))}{_untrained(model)}"
    step = f"{milliseconds(step_milliseconds)} a step" if step_milliseconds else ""
    facts = [
        ("sensor", "Sensor", escape(f"{moment.recording.sensor}"), moment.recording.format),
        ("density", "Density", f"{density} ev/px", "events per pixel and window"),
        ("network", "Network", network, _runtime(ready)),
        ("windowing", "Windowing", escape(policy(moment.policy)), "which events make one frame"),
        ("step", "Step time", step, "one encode and one decode"),
        ("state", "Recurrent state", _state(ready), "recurrent state"),
    ]
    return [fact for fact in facts if fact[2]]


def _untrained(model: ModelFacts) -> str:
    return (
        ' <span class="et-chip et-warning" data-testid="untrained">untrained weights</span>'
        if model.is_untrained
        else ""
    )


def _precision(ready: Ready | None) -> str:
    return "" if ready is None else ready.contract.runtime.precision


def _runtime(ready: Ready | None) -> str:
    if ready is None:
        return "nothing computed yet"
    contract = ready.contract
    cores = "1 thread" if contract.threads == 1 else f"{contract.threads} threads"
    return f"{contract.runtime.precision}, {contract.device}, {cores}, torch {contract.torch_version}"


def _state(ready: Ready | None) -> str:
    if ready is None or ready.is_former:
        return ""
    if ready.is_approximate:
        return f"state: cold start {ready.num_warm} windows ago"
    if not ready.is_cold:
        return "state warm"
    return f"warm-up {ready.num_seen} of {ready.warm_up}" if ready.warm_up else "state cold"


def density_html(value: float, band: tuple[float, float] | None) -> str:
    """Events per pixel beside the band that a network was trained on; just the number where that is not known."""
    if band is None:
        return short(value)
    low, high = (_place(edge) for edge in band)
    verdict = "" if band[0] <= value <= band[1] else " et-warning"
    words = f"trained on {short(band[0])} to {short(band[1])} events per pixel"
    outside = "" if not verdict else (" fewer" if value < band[0] else " more") + " than trained on"
    return (
        f'<span class="{verdict.strip()}"><b>{short(value)}</b>{outside}</span>'
        f'<span class="et-band" title="{words}"><i style="left:{low:.0%};width:{high - low:.0%}"></i>'
        f'<b style="left:{_place(value):.0%}"></b></span>'
    )


def _place(value: float) -> float:
    low, high = (math.log10(end) for end in _BAND_ENDS)
    return min(max((math.log10(max(value, 1e-9)) - low) / (high - low), 0.0), 1.0)

"""Words of lists and the values they stand for: windowing, precision, speed, entries of the catalogue."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

from app.engine.requests import Precision
from etnet.windows import BetweenFrames, ByActivity, ByCount, ByCountOrDuration, ByDensity, ByDuration, ByStamps, Policy

KINDS = ("events per pixel", "milliseconds", "number of events", "camera frames")
PRECISIONS: dict[Precision, str] = {"auto": "auto", "fp32": "fp32", "bf16": "bf16"}
DEFAULTS: dict[str, float] = {"events per pixel": 0.35, "milliseconds": 20.0, "number of events": 15_000}
STEPS: dict[str, float] = {"events per pixel": 0.05, "milliseconds": 5.0, "number of events": 1000}

PLAYED: dict[str, float] = {"1×": 1.0, "½": 0.5, "¼": 0.25, "1/10": 0.1}
"""Speeds of playing on the page, recording seconds per second."""

SPEEDS: dict[str, float] = {
    "real time": 1.0,
    "1/2 of real time": 0.5,
    "1/4 of real time": 0.25,
    "1/10 of real time": 0.1,
    "1/20 of real time": 0.05,
    "1/50 of real time": 0.02,
}
"""Recording seconds per second."""


class Named(Protocol):
    """An entry of the catalogue as a list names it."""

    @property
    def id(self) -> str:
        """What intents speak of."""
        ...

    @property
    def title(self) -> str:
        """What a visitor reads."""
        ...

    @property
    def subtitle(self) -> str:
        """What tells two of one title apart."""
        ...


def policy_of(kind: str, number: float) -> Policy:
    """A window policy from its words; every number is brought to the least that the policy takes."""
    match kind:
        case "milliseconds":
            return ByDuration(max(1, round(min(number, 1e7) * 1000)))
        case "number of events":
            return ByCount(max(1, round(min(number, 1e9))))
        case "camera frames":
            return BetweenFrames()
    return ByDensity(min(max(number, 1e-4), 1e4))


def words_of(policy: Policy) -> tuple[str, float]:
    """The words of a policy, and its number (0 for none)."""
    match policy:
        case ByDuration(duration, _):
            return "milliseconds", duration / 1000
        case ByCount(num_events):
            return "number of events", float(num_events)
        case ByDensity(events_per_pixel):
            return "events per pixel", events_per_pixel
        case BetweenFrames() | ByStamps():
            return "camera frames", 0.0
        case ByCountOrDuration(num_events, _):
            return "number of events", float(num_events)
        case ByActivity(active_pixels):
            return "events per pixel", active_pixels


def offered(choices: Sequence[Named]) -> dict[str, str]:
    """Ids by the titles of a dropdown. Two of one name are told apart by where they come from, at last by a sign."""
    titles: dict[str, str] = {}
    for choice in choices:
        title = choice.title if choice.title not in titles else f"{choice.title} ({choice.subtitle})"
        while title in titles:
            title += " ·"
        titles[title] = choice.id
    return titles

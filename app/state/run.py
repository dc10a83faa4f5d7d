"""A run beside the main one: the same recording by another network, in other windows, filtered, from a cold start."""

from __future__ import annotations

from dataclasses import dataclass

from app.engine.frame_scores import Rule
from app.engine.requests import Precision
from etnet.events.cleaning import Cleaning
from etnet.windows import Policy


@dataclass(frozen=True, slots=True)
class Run:
    """A reconstruction of the page; `None` is "as the main one", and `Run()` the main one itself."""

    model_id: str | None = None
    precision: Precision | None = None
    policy: Policy | None = None
    cleaning: Cleaning | None = None
    cold_from: int | None = None
    """Stamp (µs) of the first event that the network sees: its state is zero there."""
    replays: Rule | None = None
    """The protocol whose windows it sees, from that protocol's cold start, in place of windows of its own."""

"""Event cameras that are simulated: for training, for videos, for arrays. `simulate` takes frames and gives events."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from etnet.simulation.arrays import simulate
    from etnet.simulation.settings import CAMERAS, PixelSettings
    from etnet.simulation.streaming import EventSimulator
    from etnet.simulation.tone import Tone
    from etnet.simulation.walk import Stepping

_HOMES = {
    "CAMERAS": "etnet.simulation.settings",
    "EventSimulator": "etnet.simulation.streaming",
    "PixelSettings": "etnet.simulation.settings",
    "Stepping": "etnet.simulation.walk",
    "Tone": "etnet.simulation.tone",
    "simulate": "etnet.simulation.arrays",
}

__all__ = ["CAMERAS", "EventSimulator", "PixelSettings", "Stepping", "Tone", "simulate"]


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(_HOMES[name]), name)

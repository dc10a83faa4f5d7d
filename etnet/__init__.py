"""Event-camera recordings to video with ET-Net. Importing this loads neither torch nor h5py: names load when used."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from etnet.errors import Cancelled, EtnetError, ModelError, RecordingError, WeightsError, WindowError
    from etnet.events.edit import EventEdit
    from etnet.events.events import Events, Sensor
    from etnet.events.open import open_recording
    from etnet.events.recording import GroundTruth, Recording
    from etnet.events.triggers import Triggers
    from etnet.nets.attention import Attention, AttentionProbe
    from etnet.nets.base import State, Step
    from etnet.nets.intervention import Intervention
    from etnet.nets.presets import build_model
    from etnet.nets.weights import load_model
    from etnet.playback.playback import Playback
    from etnet.reconstruction import reconstruct
    from etnet.voxel import voxel_grid
    from etnet.windows import (
        BetweenFrames,
        ByActivity,
        ByCount,
        ByCountOrDuration,
        ByDensity,
        ByDuration,
        ByStamps,
        Window,
        plan_windows,
    )

__version__ = "0.1.0"

_HOMES = {
    "Attention": "etnet.nets.attention",
    "AttentionProbe": "etnet.nets.attention",
    "BetweenFrames": "etnet.windows",
    "ByActivity": "etnet.windows",
    "ByCount": "etnet.windows",
    "ByCountOrDuration": "etnet.windows",
    "ByDensity": "etnet.windows",
    "ByDuration": "etnet.windows",
    "ByStamps": "etnet.windows",
    "Cancelled": "etnet.errors",
    "EtnetError": "etnet.errors",
    "EventEdit": "etnet.events.edit",
    "Events": "etnet.events.events",
    "GroundTruth": "etnet.events.recording",
    "Intervention": "etnet.nets.intervention",
    "ModelError": "etnet.errors",
    "Playback": "etnet.playback.playback",
    "Recording": "etnet.events.recording",
    "RecordingError": "etnet.errors",
    "Sensor": "etnet.events.events",
    "State": "etnet.nets.base",
    "Step": "etnet.nets.base",
    "Triggers": "etnet.events.triggers",
    "WeightsError": "etnet.errors",
    "Window": "etnet.windows",
    "WindowError": "etnet.errors",
    "build_model": "etnet.nets.presets",
    "load_model": "etnet.nets.weights",
    "open_recording": "etnet.events.open",
    "plan_windows": "etnet.windows",
    "reconstruct": "etnet.reconstruction",
    "voxel_grid": "etnet.voxel",
}

__all__ = [  # noqa: RUF022  in the order of the pipeline
    "open_recording", "Recording", "Events", "Sensor", "GroundTruth", "Triggers",
    "plan_windows", "Window", "BetweenFrames", "ByCount", "ByDuration", "ByDensity",
    "ByCountOrDuration", "ByActivity", "ByStamps",
    "voxel_grid",
    "load_model", "build_model", "State", "Step", "Attention", "AttentionProbe", "Intervention", "EventEdit",
    "reconstruct", "Playback",
    "EtnetError", "RecordingError", "WindowError", "ModelError", "WeightsError", "Cancelled",
]  # fmt: skip


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module 'etnet' has no attribute {name!r}")
    value = getattr(import_module(_HOMES[name]), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted([*__all__, "__version__"])

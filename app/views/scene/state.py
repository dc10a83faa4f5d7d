"""What stands in the 3-D scene and from where it is looked at."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, ClassVar, Literal, cast, get_args

from app.state import intents as ask
from app.state.checks import passing
from app.views.view import Here

Camera = Literal["orbit", "front", "side", "booth"]
"""Presets; "booth" is the demo's: the image large in front, its events behind it."""


@dataclass(frozen=True, slots=True)
class ChooseCamera:
    """Look at the scene from a preset. Asking for the same one again puts the camera back."""

    camera: Camera


@dataclass(frozen=True, slots=True)
class SceneState:
    """One visitor's scene."""

    view: ClassVar[str] = "scene"
    camera: Camera = "orbit"
    shows_events: bool = True
    num_asked: int = passing(0)
    """Counts the times a preset was asked for: asking for the same one again puts the camera back."""


def reduce_scene(slice_: SceneState, intent: Any, here: Here) -> SceneState:
    """The attention workspace is a flat view of one map; the others look into the window's depth."""
    match intent:
        case ChooseCamera("orbit" | "front" | "side" | "booth"):
            return replace(slice_, camera=intent.camera, num_asked=slice_.num_asked + 1)
        case ask.ShowWorkspace(workspace):
            cameras: dict[str, Camera] = {"attention": "front", "demo": "booth"}
            return replace(slice_, camera=cameras.get(workspace, "orbit"))
    return slice_


def hear(words: str) -> Any:
    """What a click on one of the view's own buttons says; `None` for what none of them sends."""
    verb, _, camera = words.partition(":")
    return ChooseCamera(cast("Camera", camera)) if verb == "camera" and camera in get_args(Camera) else None

"""What stands in the 3-D scene and from where it is looked at."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, ClassVar, Literal

from app.state import intents as ask
from app.views.view import Here

Camera = Literal["orbit", "front", "side"]


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


def reduce_scene(slice_: SceneState, intent: Any, here: Here) -> SceneState:
    """The attention workspace is a flat view of one map; the others look into the window's depth."""
    match intent:
        case ChooseCamera("orbit" | "front" | "side"):
            return replace(slice_, camera=intent.camera)
        case ask.ShowWorkspace(workspace):
            return replace(slice_, camera="front" if workspace == "attention" else "orbit")
    return slice_

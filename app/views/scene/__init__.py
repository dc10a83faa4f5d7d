"""The window in space and time: its events as a cloud, the frame in front of them."""

from __future__ import annotations

from typing import TYPE_CHECKING

from app.state import intents as ask
from app.views.scene.state import ChooseCamera, SceneState, hear, reduce_scene
from app.views.view import Card, Command, View

if TYPE_CHECKING:
    import viser

    from app.views.panel import Panel


def _panel(client: viser.ClientHandle) -> Panel:
    from app.views.scene.panel import ScenePanel

    return ScenePanel(client)


VIEW = View(
    "scene",
    "Event cloud",
    "CUBE",
    SceneState(),
    _panel,
    workspaces=frozenset({"inspect", "recording", "demo"}),
    cards=(Card("scene", frozenset({"demo"}), frozenset({"inspect", "recording"})),),
    commands=(
        Command("Camera: perspective", None, ChooseCamera("orbit")),
        Command("Camera: front", "F", ChooseCamera("front")),
        Command("Camera: side", None, ChooseCamera("side")),
    ),
    is_public=True,
    in_public=SceneState(camera="booth"),
    reduce=reduce_scene,
    intents=(ask.ShowWorkspace,),
    hear=hear,
)

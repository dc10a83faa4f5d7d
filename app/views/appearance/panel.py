"""How the page is arranged and from where the scene is looked at."""

from __future__ import annotations

from typing import Any

import viser

from app.state import intents as ask
from app.state.view_state import choices
from app.views.view import Dispatch, Page, assign, on_visitor

WORKSPACES: dict[str, ask.Workspace] = {"Inspect": "inspect", "Attention": "attention", "Demo": "demo"}
CAMERAS: dict[str, ask.Camera] = {"In depth": "orbit", "Front": "front", "Side": "side"}


class ViewPanel:
    """Workspace, camera, what stands in the scene."""

    def build(self, gui: viser.GuiApi, dispatch: Dispatch) -> None:
        """Buttons that are also keys and commands."""
        self._workspace = gui.add_button_group("Workspace", tuple(WORKSPACES))
        self._camera = gui.add_button_group("Camera", tuple(CAMERAS))
        self._events = gui.add_checkbox("Events in the scene", True)

        @self._workspace.on_click
        async def _(event: viser.GuiEvent[Any]) -> None:
            if event.client is not None and event.target.value in WORKSPACES:
                dispatch(ask.ShowWorkspace(WORKSPACES[event.target.value]))

        @self._camera.on_click
        async def _(event: viser.GuiEvent[Any]) -> None:
            if event.client is not None and event.target.value in CAMERAS:
                dispatch(ask.ChooseCamera(CAMERAS[event.target.value]))

        on_visitor(self._events, lambda value: ask.ShowEvents(bool(value)), dispatch)

    def show(self, page: Page) -> None:
        """Only the checkbox holds a value."""
        assign(self._events, page.state.shows_events)


assert set(WORKSPACES.values()) == set(choices(ask.Workspace))
assert set(CAMERAS.values()) == set(choices(ask.Camera))

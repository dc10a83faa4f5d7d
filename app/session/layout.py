"""Where everything stands: two columns and a strip at the foot, or one sheet on a phone; keys; the camera's presets."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import viser

from app.html.assets import page_folder
from app.session.channel import AskHelp, Message, open_channel
from app.state import intents as ask
from app.views.appearance.panel import ViewPanel
from app.views.attention.panel import AttentionPanel
from app.views.compare.panel import ComparePanel
from app.views.demo.panel import Demo, Provenance, SceneLegend
from app.views.demo.public import PublicDemo
from app.views.export.panel import ExportPanel
from app.views.inspect.panel import InspectPanel
from app.views.reconstruction.panel import EventPicture, Reconstruction, Voxels
from app.views.recording.panel import RecordingPanel
from app.views.scene.space import Space, camera_place
from app.views.timeline.panel import TimelinePanel
from app.views.view import Dispatch, Page, Panel

if TYPE_CHECKING:
    from viser._gui_handles import GuiModalHandle

PHONE_ASPECT = 0.9
"""A canvas narrower than this is a phone's, on which viser folds all panels into one sheet."""
WIDTHS: dict[ask.Workspace, tuple[int, int]] = {"inspect": (470, 400), "attention": (360, 560), "demo": (470, 400)}
"""Pixels of the left and the right column."""
COMPARE_WIDTH = 560
"""Pixels of the right column while lanes are compared."""
COMMANDS: tuple[tuple[str, str | None, ask.Intent], ...] = (
    ("Play or pause", "space", ask.TogglePlay()),
    ("Play or pause ", "K", ask.TogglePlay()),
    ("One window back", "J", ask.Move(-1)),
    ("One window on", "L", ask.Move(1)),
    ("Ten windows back", "pageup", ask.Move(-10)),
    ("Ten windows on", "pagedown", ask.Move(10)),
    ("First window", "home", ask.Seek(0)),
    ("Last window", "end", ask.Seek(10**9)),
    ("Workspace: Inspect", "1", ask.ShowWorkspace("inspect")),
    ("Workspace: Attention", "2", ask.ShowWorkspace("attention")),
    ("Workspace: Demo", "3", ask.ShowWorkspace("demo")),
    ("Camera: in depth", None, ask.ChooseCamera("orbit")),
    ("Camera: front", "F", ask.ChooseCamera("front")),
    ("Camera: side", None, ask.ChooseCamera("side")),
)


@dataclass(frozen=True, slots=True)
class Layout:
    """The panels of one page, and the handles that a workspace moves."""

    client: viser.ClientHandle
    panels: tuple[Panel, ...]
    legend: SceneLegend
    is_phone: bool
    left: viser.PanelHandle | None = None

    def arrange(self, workspace: ask.Workspace, compares: bool = False) -> None:
        """Give the columns the widths of a workspace; the theme does the rest by the workspace's mark.

        Lanes beside each other need a wider column than a list of settings.
        """
        if self.left is None:
            return
        left, right = WIDTHS[workspace]
        self.left.set_width(left)
        self.client.gui.main_panel.set_width(max(right, COMPARE_WIDTH) if compares else right)

    def show(self, page: Page) -> None:
        """Draw what has changed."""
        for panel in self.panels:
            panel.show(page)


def build_layout(
    client: viser.ClientHandle,
    dispatch: Dispatch,
    hear: Callable[[ask.Intent | Message], None],
    is_public: bool = False,
    ticket: str = "",
) -> Layout:
    """Lay out one visitor's page; in public without what only the host may change. `ticket`: see `open_channel`."""
    is_phone = client.camera.aspect < PHONE_ASPECT
    open_channel(client.gui, hear, ticket)
    _add_commands(client.gui, dispatch, hear)
    return _build_phone(client, dispatch, is_public) if is_phone else _build_desk(client, dispatch, is_public)


def place_camera(client: viser.ClientHandle, space: Space, camera: ask.Camera) -> None:
    """Put the camera where a preset wants it on this canvas."""
    place = camera_place(space, camera, client.camera.aspect)
    with client.atomic():
        client.camera.up_direction = (0.0, -1.0, 0.0)
        client.camera.fov = place.fov
        client.camera.near = place.near
        client.camera.far = place.far
        client.camera.position = place.position
        client.camera.look_at = place.look_at


def show_help(client: viser.ClientHandle) -> GuiModalHandle:
    """Keys and words of the page, in a window of their own."""
    with client.gui.add_modal("Keys and words") as modal:
        client.gui.add_html((page_folder() / "help.html").read_text("utf-8"))
        close = client.gui.add_button("Close")

    @close.on_click
    async def _(event: viser.GuiEvent[viser.GuiButtonHandle]) -> None:
        if event.client is not None:
            close_modal(modal)

    return modal


def close_modal(modal: GuiModalHandle | None) -> None:
    """Close a window over the page, if it is still open."""
    if modal is not None and not modal.closed:
        modal.close()


def _build_desk(client: viser.ClientHandle, dispatch: Dispatch, is_public: bool) -> Layout:
    gui = client.gui
    provenance, legend, demo = Provenance(), SceneLegend(), PublicDemo() if is_public else Demo()
    reconstruction, events, voxels, transport = Reconstruction(), EventPicture(), Voxels(), TimelinePanel()
    attention, view = AttentionPanel(), ViewPanel()
    # In public there is nothing to open or to change, and nothing is handed out.
    open_tabs = (("Attention", viser.Icon.FOCUS_2, attention), ("View", viser.Icon.ADJUSTMENTS_HORIZONTAL, view))
    private_tabs = (
        ("Inside", viser.Icon.MICROSCOPE, InspectPanel()),
        ("Recording", viser.Icon.DATABASE, RecordingPanel()),
        ("View", viser.Icon.ADJUSTMENTS_HORIZONTAL, view),
        ("Compare", viser.Icon.COLUMNS_3, ComparePanel()),
        ("Take away", viser.Icon.DOWNLOAD, ExportPanel()),
    )
    shown_tabs = open_tabs if is_public else (open_tabs[0], *private_tabs)

    left = gui.add_panel()
    with left.add_tab("Window on show", viser.Icon.PHOTO):
        for panel in (reconstruction, events, voxels):
            panel.build(gui, dispatch)
    left.dock_left()

    gui.main_panel.dock_right()
    tabs = gui.add_tab_group()
    for title, icon, panel in shown_tabs:
        with tabs.add_tab(title, icon):
            panel.build(gui, dispatch)

    large = gui.add_panel()
    with large.add_tab("Demo", viser.Icon.PRESENTATION):
        demo.build(gui, dispatch)
    large.float(x=0, y=0, width=900)

    foot = gui.add_panel()
    with foot.add_tab("Timeline", viser.Icon.TIMELINE):
        for panel in (provenance, legend, transport):
            panel.build(gui, dispatch)
    foot.float(x=20, y=-15, width=900)

    columns = (reconstruction, events, voxels, *(panel for _, _, panel in shown_tabs))
    panels = (transport, *columns, provenance, legend, demo)
    return Layout(client, panels, legend, False, left)


def _build_phone(client: viser.ClientHandle, dispatch: Dispatch, is_public: bool) -> Layout:
    gui = client.gui
    legend, reconstruction, transport = SceneLegend(is_phone=True), Reconstruction(), TimelinePanel()
    for panel in (legend, reconstruction, transport):
        panel.build(gui, dispatch)
    folded: tuple[tuple[str, Panel], ...] = (
        ("Events", EventPicture()),
        ("Time bins", Voxels()),
        *(() if is_public else (("Recording", RecordingPanel()),)),
        ("Attention", AttentionPanel()),
        *(() if is_public else (("Inside", InspectPanel()), ("Compare", ComparePanel()), ("Take away", ExportPanel()))),
    )
    for title, panel in folded:
        with gui.add_panel().add_tab(title):
            panel.build(gui, dispatch)
    panels = (transport, reconstruction, *(panel for _, panel in folded), legend)
    return Layout(client, panels, legend, True)


def _add_commands(gui: viser.GuiApi, dispatch: Dispatch, hear: Callable[[ask.Intent | Message], None]) -> None:
    for label, key, intent in COMMANDS:
        command = gui.add_command(label, hotkey=key)  # pyright: ignore[reportArgumentType]  a key of viser's list

        def speak(intent: ask.Intent = intent) -> Callable[[viser.CommandEvent], object]:
            async def heard(event: viser.CommandEvent) -> None:
                if event.client is not None:
                    dispatch(intent)

            return heard

        command.on_trigger(speak())  # pyright: ignore[reportArgumentType]
    help_command = gui.add_command("Keys and words")

    @help_command.on_trigger
    async def _(event: viser.CommandEvent) -> None:
        if event.client is not None:
            hear(AskHelp())

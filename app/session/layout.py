"""Where everything stands: cards, inspector column and timeline, or one sheet on a phone; keys; help."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import viser

from app.html.assets import page_folder
from app.html.elements import segmented
from app.session.channel import AskHelp, open_channel
from app.session.commands import PUBLIC_COMMANDS, commands_of
from app.state.view_state import ViewState, Workspace
from app.views.page import Page
from app.views.panel import Dispatch, Html, Panel
from app.views.view import Command, View, open_tab, tabs

if TYPE_CHECKING:
    from viser._gui_handles import GuiModalHandle

INSPECTOR_WIDTH: dict[Workspace, int] = {
    "inspect": 356, "attention": 356, "compare": 356, "recording": 420, "demo": 356,
}  # fmt: skip
"""CSS pixels of the right column."""


@dataclass(slots=True)
class Layout:
    """The panels of one page. What cannot be seen is not drawn; it is drawn in full when it is opened."""

    views: Sequence[View]
    panels: dict[str, Panel]
    cards: dict[str, list[Html]]
    """What each view has in the page itself."""
    folders: dict[str, viser.GuiFolderHandle]
    strip: Html
    main: viser.MainPanelHandle
    width: int = 0
    _open: set[str] = field(default_factory=set)
    _unsuited: frozenset[str] = frozenset()
    _suited_to: str | None = None

    def arrange(self, state: ViewState) -> None:
        """Open the tab that a state names, close the others."""
        tab = open_tab(state, self.views)
        for name, folder in self.folders.items():
            is_open = tab is not None and name == tab.name
            if folder.visible != is_open:
                folder.visible = is_open
        self._show_tabs(state)
        width = INSPECTOR_WIDTH[state.workspace]
        if width != self.width:
            self.width = width
            self.main.set_width(width)

    def suit(self, page: Page) -> None:
        """Note which views can do something for what is open; while windows pass, these stay the same."""
        if page.is_moving and page.state.recording_id == self._suited_to:
            return
        self._suited_to = page.state.recording_id
        self._unsuited = frozenset(view.name for view in self.views if not view.suits(page))

    def _show_tabs(self, state: ViewState) -> None:
        """The tabs that suit what is open, and the one that is open."""
        tab = open_tab(state, self.views)
        listed = [view for view in tabs(state, self.views) if view is tab or view.name not in self._unsuited]
        offered = {f"tab:{view.name}": view.title for view in listed}
        chosen = "" if tab is None else f"tab:{tab.name}"
        self.strip.show(f'<div class="etv-tabs">{segmented("Settings", offered, chosen) if offered else ""}</div>')

    def show(self, page: Page) -> None:
        """Draw what has changed in what can be seen."""
        tab = open_tab(page.state, self.views)
        self.suit(page)
        self._show_tabs(page.state)
        for view in self.views:
            if (panel := self.panels.get(view.name)) is None:
                continue
            is_open = page.state.workspace in view.workspaces
            if is_open:
                panel.show(page)
            if is_open != (view.name in self._open) and view.workspaces:
                for part in self.cards[view.name]:
                    part.set_visible(is_open)
                (self._open.add if is_open else self._open.discard)(view.name)
            if view is tab:
                panel.show_settings(page)


def build_layout(
    client: viser.ClientHandle,
    dispatch: Dispatch,
    views: Sequence[View],
    is_public: bool = False,
    ticket: str = "",
) -> Layout:
    """Lay out one visitor's page; in public without what only the host may change. `ticket`: see `open_channel`."""
    gui = client.gui
    offered = [view for view in views if view.is_public or not is_public]
    open_channel(gui, dispatch, views, ticket)
    _add_commands(gui, dispatch, PUBLIC_COMMANDS if is_public else commands_of(views))
    panels = {view.name: view.make_panel(client) for view in offered}
    folders: dict[str, viser.GuiFolderHandle] = {}

    page = gui.add_panel()
    with page.add_tab("Page", viser.Icon.LAYOUT):
        Html(gui, '<i class="etv-page-mark"></i>')
        for view in offered:
            if view.workspaces and not view.at_foot:
                panels[view.name].build(gui, dispatch)
    page.float(x=0, y=0, width=900)
    cards = {name: [part for part in vars(panel).values() if isinstance(part, Html)] for name, panel in panels.items()}

    gui.main_panel.dock_right()
    strip = Html(gui, '<div class="etv-tabs"></div>')
    for view in offered:
        if view.settings_in:
            folders[view.name] = gui.add_folder(view.title, visible=False)
            with folders[view.name]:
                panels[view.name].build_settings(gui, dispatch)

    foot = gui.add_panel()
    with foot.add_tab("Timeline", viser.Icon.TIMELINE):
        for view in offered:
            if view.at_foot:
                panels[view.name].build(gui, dispatch)
    foot.float(x=20, y=-15, width=900)
    layout = Layout(views, panels, cards, folders, strip, gui.main_panel)
    layout.suit(Page(ViewState()))
    return layout


def watch_canvas(client: viser.ClientHandle, hears: Callable[[], bool], tell: Callable[[], None]) -> None:
    """Docks reach their width after the page is up, and windows are resized: the camera must fit."""
    seen = round(client.camera.aspect, 2)

    @client.camera.on_update
    async def _(camera: viser.CameraHandle) -> None:
        nonlocal seen
        aspect = round(camera.aspect, 2)
        if aspect != seen and hears():
            seen = aspect
            tell()


def show_help(client: viser.ClientHandle) -> GuiModalHandle:
    """Keys and words of the page, in a window of their own."""
    with client.gui.add_modal("Shortcuts and glossary") as modal:
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


def _add_commands(gui: viser.GuiApi, dispatch: Callable[[Any], None], commands: Sequence[Command]) -> None:
    for each in (*commands, Command("Shortcuts and glossary", None, AskHelp())):
        intent, command = each.intent, gui.add_command(each.label, hotkey=each.key)  # pyright: ignore[reportArgumentType]  a key of viser's list

        def speak(intent: Any = intent) -> Callable[[viser.CommandEvent], object]:
            async def heard(event: viser.CommandEvent) -> None:
                if event.client is not None:
                    for each in intent if isinstance(intent, tuple) else (intent,):
                        dispatch(each)

            return heard

        command.on_trigger(speak())  # pyright: ignore[reportArgumentType]


def arrangement_of(state: ViewState) -> tuple[object, ...]:
    """What of a state decides how the page is arranged."""
    return state.workspace, state.tab, state.is_public

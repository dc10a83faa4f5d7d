"""What a visitor can take home of the current recording, and the address of the moment."""

from __future__ import annotations

from html import escape
from typing import Any

import viser

from app.engine.downloads import plain_name
from app.html.choices import SPEEDS
from app.state.intents import FormChanged
from app.views.export.command import command_line_of, export_command
from app.views.export.jobs import file_name
from app.views.export.state import (
    EXPORT_SLOT,
    ArrayName,
    DropExport,
    ExportFormat,
    ExportState,
    Panels,
    Sheet,
    StartExport,
)
from app.views.inspect.state import Change, InspectState
from app.views.page import Page
from app.views.panel import Dispatch, Html, Panel, assign, on_press, on_visitor, seconds_since_touched

FORMATS: dict[str, ExportFormat] = {
    "Video (MP4)": "mp4",
    "Animated GIF": "gif",
    "Picture of this window (PNG)": "png",
    "One page with everything (HTML)": "page",
    "Arrays (NPZ)": "npz",
    "Arrays (HDF5)": "h5",
    "Numbers of every window (CSV)": "csv",
    "Reproducible session (JSON)": "session",
}
PANELS: dict[str, Panels] = {
    "reconstruction": ("reconstruction",),
    "events, reconstruction": ("events", "reconstruction"),
    "events, reconstruction, camera": ("events", "reconstruction", "camera"),
}
SHEETS: dict[str, Sheet] = {
    "voxel bins": "voxels",
    "attention maps of the pixel": "attention",
    "the whole layout": "layout",
}
MOVING, RANGED = ("mp4", "gif"), ("mp4", "gif", "page", "npz", "h5", "csv", "session")
NUMBERS = ("npz", "h5")
ARRAYS: dict[ArrayName, str] = {
    "frames": "Frames",
    "voxels": "Voxel grids",
    "camera": "Camera frames",
    "attention": "Attention of the pixel",
    "states": "States (large)",
}
_LINK = '<div class="et"><button class="et-back" data-etv-copy>Copy a link to this moment (C)</button></div>'


class ExportPanel(Panel):
    """Choose, make, wait a little, and the browser saves it."""

    def build_settings(self, gui: viser.GuiApi, dispatch: Dispatch) -> None:
        """Widgets hold the choice until it is made; what is being made stands in the view."""
        Html(gui, _LINK)
        self._format = gui.add_dropdown("Format", tuple(FORMATS))
        self._panels = gui.add_dropdown("Pictures", tuple(PANELS))
        self._picture = gui.add_dropdown("Picture", (*PANELS, *SHEETS), visible=False)
        self._speed = gui.add_dropdown("Speed", tuple(SPEEDS))
        self._has_stamps = gui.add_checkbox("Burn in timestamps", True)
        usual = StartExport("npz").arrays
        self._arrays: dict[ArrayName, viser.GuiCheckboxHandle] = {
            name: gui.add_checkbox(words, name in usual, visible=False) for name, words in ARRAYS.items()
        }
        self._takes_range = gui.add_checkbox("Limit range", False)
        self._first = gui.add_number("From window", 0, min=0, step=1, visible=False)
        self._last = gui.add_number("To window", 0, min=0, step=1, visible=False)
        self._make = gui.add_button("Export", icon=viser.Icon.DOWNLOAD)
        self._cancel = gui.add_button("Cancel", icon=viser.Icon.X, visible=False)
        self._news = Html(gui)
        on_press(self._cancel, DropExport(), dispatch)
        shaping = (self._format, self._panels, self._picture, self._speed, self._has_stamps)
        for handle in (*shaping, *self._arrays.values(), self._takes_range, self._first, self._last):
            on_visitor(handle, lambda _: FormChanged(), dispatch)

        @self._make.on_click
        async def _(event: viser.GuiEvent[Any]) -> None:
            if event.client is not None and (wanted := self._chosen()) is not None:
                dispatch(wanted)

    def show_settings(self, page: Page) -> None:
        """Offer what suits the choice, and say how far it has come."""
        format = FORMATS.get(self._format.value, "mp4")
        takes_range = format in RANGED and self._takes_range.value
        is_busy = page.state.of(ExportState).order is not None
        result = page.results.get(EXPORT_SLOT)
        is_made = is_busy and (result is None or not result.trouble)
        for handle, is_shown in (
            (self._panels, format in MOVING),
            (self._picture, format == "png"),
            (self._speed, format in MOVING),
            (self._has_stamps, format in MOVING or (format == "png" and self._picture.value not in SHEETS)),
            *((handle, self._offers(name, format, page)) for name, handle in self._arrays.items()),
            (self._takes_range, format in RANGED),
            (self._first, takes_range),
            (self._last, takes_range),
            (self._make, not is_made),
            (self._cancel, is_made),
        ):
            if handle.visible != is_shown:
                handle.visible = is_shown
        if page.moment is not None:
            last = max(len(page.moment.windows) - 1, 0)
            if self._last.max != last:
                self._first.max = self._last.max = last
                assign(self._last, last)
                if seconds_since_touched(self._first) > 0.4:
                    self._first.value = 0
        wanted = self._chosen()
        self._news.show(_news(page, is_made, wanted) or ("" if wanted is None else _told(page, wanted)))

    @staticmethod
    def _offers(name: ArrayName, format: ExportFormat, page: Page) -> bool:
        """Whether there is such an array."""
        truth = None if page.moment is None else page.moment.recording.ground_truth
        is_there = {"camera": bool(truth), "attention": page.state.query is not None}.get(name, True)
        return format in NUMBERS and is_there

    def _chosen(self) -> StartExport | None:
        format = FORMATS.get(self._format.value)
        sheet = SHEETS.get(self._picture.value, "panels") if format == "png" else "panels"
        chosen = self._picture.value if format == "png" and sheet == "panels" else self._panels.value
        panels, speed = PANELS.get(chosen), SPEEDS.get(self._speed.value)
        if format is None or panels is None or speed is None:
            return None  # no page of ours sends another word
        takes_range = format in RANGED and self._takes_range.value
        first, last = (int(self._first.value), int(self._last.value)) if takes_range else (None, None)
        arrays: tuple[ArrayName, ...] = tuple(name for name, handle in self._arrays.items() if handle.value)
        return StartExport(format, first, last, panels, speed, bool(self._has_stamps.value), arrays, sheet)


def _news(page: Page, is_made: bool, wanted: StartExport | None) -> str:
    """What is to be said instead of how the command line does it."""
    result = page.results.get(EXPORT_SLOT)
    if page.moment is None:
        return '<div class="et"><div class="et-note">Open a recording first.</div></div>'
    if is_made:
        share = 0.0 if result is None else result.share
        waits = " et-bar-wait" if result is None else ""
        return (
            '<div class="et" data-testid="taking"><div class="et-lag">'
            f'<span>being made, {share:.0%}</span><div class="et-bar{waits}"><i style="width:{share:.0%}"></i></div>'
            "</div></div>"
        )
    if page.state.of(ExportState).order is not None and result is not None:
        trouble = f'<div class="et-failed" role="alert" data-testid="taking">{escape(result.trouble)}</div>'
        return f'<div class="et">{trouble}</div>'
    change = page.state.of(InspectState).change
    if wanted is not None and wanted.format == "session" and change.run_from is not None:
        words = f"It holds what is changed in the network, from window {change.run_from} on."
        return f'<div class="et"><div class="et-note">{words}</div></div>'
    if change != Change():
        return (
            '<div class="et"><div class="et-note">What is made is of the network and the events unchanged.</div></div>'
        )
    return ""


def _told(page: Page, wanted: StartExport) -> str:
    """The command that makes the same."""
    moment, line = page.moment, command_line_of(page)
    if wanted.sheet != "panels":
        words = "The browser saves it. It is made of this moment as it is shown; the scene is left out."
        return f'<div class="et"><div class="et-note">{words}</div></div>'
    if moment is None or line is None:
        words = "The browser saves it. <code>etnet export</code> opens what <code>etnet simulate --video</code> makes."
        return f'<div class="et"><div class="et-note">{words}</div></div>'
    name = moment.recording.name
    out = f"{plain_name(name)}_frames" if wanted.format == "png" else file_name(name, wanted.format)
    command = export_command(wanted, moment, line, page.state.query, out)
    return (
        '<div class="et"><div class="et-note">The browser saves it. This makes the same, of any size:</div>'
        f'<code class="etv-command" data-testid="command">{_unbroken(command)}</code></div>'
    )


def _unbroken(command: str) -> str:
    """A line of it ends between two words, and not after a hyphen of an option."""
    return " ".join(f"<span>{escape(word)}</span>" for word in command.split(" "))

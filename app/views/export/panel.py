"""What a visitor can take home of the current recording, and the address of the moment."""

from __future__ import annotations

from html import escape
from typing import Any

import viser

from app.engine.downloads import plain_name
from app.html.choices import SPEEDS
from app.html.elements import bar
from app.state.intents import FormChanged
from app.state.view_state import Limits
from app.views.attention.state import followed_place
from app.views.compare.state import NAMES
from app.views.events.state import EventsState
from app.views.export.command import command_line_of, export_command
from app.views.export.jobs import file_name
from app.views.export.runs import ordered_runs
from app.views.export.state import (
    DRAWN,
    EXPORT_SLOT,
    RANGED,
    ArrayName,
    DropExport,
    ExportFormat,
    ExportState,
    OrderedRun,
    Panels,
    Sheet,
    StartExport,
    order_of,
)
from app.views.inspect.state import InspectState
from app.views.page import Page
from app.views.panel import Dispatch, Html, Panel, on_press, on_visitor, set_options
from app.views.reconstruction.state import ReconstructionState

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
RUN_PANELS: dict[str, Panels] = {
    "runs, camera": ("reconstruction", "camera"),
    "runs": ("reconstruction",),
    "events, runs, camera": ("events", "reconstruction", "camera"),
    "events, runs": ("events", "reconstruction"),
}
"""In *Compare*: every run stands where the reconstruction would."""
SHEETS: dict[str, Sheet] = {
    "voxel bins": "voxels",
    "attention maps of the pixel": "attention",
    "the whole layout": "layout",
}
SCALES: dict[str, int] = {"1×": 1, "2×": 2, "3×": 3, "4×": 4}
RATES: dict[str, float | None] = {"as the windows come": None, "25": 25.0, "30": 30.0, "50": 50.0}
MOVING = ("mp4", "gif")
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
        self._runs: tuple[OrderedRun, ...] = ()
        self._followed: tuple[int, int] | None = None
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
        self._scale = gui.add_dropdown("Scale", tuple(SCALES))
        self._fps = gui.add_dropdown("Frames a second", tuple(RATES))
        self._range = Html(gui)
        self._make = gui.add_button("Export", icon=viser.Icon.DOWNLOAD)
        self._cancel = gui.add_button("Cancel", icon=viser.Icon.X, visible=False)
        self._news = Html(gui)
        on_press(self._cancel, DropExport(), dispatch)
        shaping = (self._format, self._panels, self._picture, self._speed, self._has_stamps, self._scale, self._fps)
        for handle in (*shaping, *self._arrays.values()):
            on_visitor(handle, lambda _: FormChanged(), dispatch)

        @self._make.on_click
        async def _(event: viser.GuiEvent[Any]) -> None:
            if event.client is not None and (wanted := self._chosen()) is not None:
                dispatch(wanted)

    def show_settings(self, page: Page) -> None:
        """Offer what suits the choice, and say how far it has come."""
        self._runs, self._followed = ordered_runs(page), followed_place(page)
        self._offer_panels(page)
        format = FORMATS.get(self._format.value, "mp4")
        is_drawn = format in MOVING or (format == "png" and self._picture.value not in SHEETS)
        is_busy = page.state.of(ExportState).order is not None
        result = page.results.get(EXPORT_SLOT)
        is_made = is_busy and (result is None or not result.trouble)
        for handle, is_shown in (
            (self._panels, format in MOVING),
            (self._picture, format == "png"),
            (self._speed, format in MOVING),
            (self._fps, format in MOVING),
            (self._scale, is_drawn),
            (self._has_stamps, is_drawn),
            *((handle, self._offers(name, format, page)) for name, handle in self._arrays.items()),
            (self._make, not is_made),
            (self._cancel, is_made),
        ):
            if handle.visible != is_shown:
                handle.visible = is_shown
        self._range.show(_range_html(page) if format in RANGED else "")
        wanted = self._chosen()
        self._news.show(_news(page, is_made, wanted) or ("" if wanted is None else _told(page, wanted)))

    def _offer_panels(self, page: Page) -> None:
        """The runs where some are compared, and the camera where there is one."""
        has_camera = page.moment is None or bool(page.moment.recording.ground_truth)
        known = RUN_PANELS if self._runs else PANELS
        offered = tuple(name for name, panels in known.items() if has_camera or "camera" not in panels)
        for handle, options in ((self._panels, offered), (self._picture, (*offered, *SHEETS))):
            if tuple(handle.options) != options:
                set_options(handle, options, options[0])

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
        panels, speed = (RUN_PANELS if self._runs else PANELS).get(chosen), SPEEDS.get(self._speed.value)
        if format is None or panels is None or speed is None:
            return None  # no page of ours sends another word
        scale, fps = SCALES.get(self._scale.value, 1), RATES.get(self._fps.value)
        arrays: tuple[ArrayName, ...] = tuple(name for name, handle in self._arrays.items() if handle.value)
        stamps = bool(self._has_stamps.value)
        runs = self._runs if format in DRAWN and sheet == "panels" else ()
        pixel = None if sheet == "panels" else self._followed
        return StartExport(format, None, None, panels, speed, stamps, scale, fps, arrays, sheet, pixel, runs)


def _news(page: Page, is_made: bool, wanted: StartExport | None) -> str:
    """What is to be said instead of how the command line does it."""
    result = page.results.get(EXPORT_SLOT)
    if page.moment is None:
        return '<div class="et"><div class="et-note">Open a recording first.</div></div>'
    if is_made:
        share = 0.0 if result is None else result.share
        return (
            '<div class="et" data-testid="taking"><div class="et-lag">'
            f"<span>being made, {share:.0%}</span>{bar(share, waits=result is None)}</div></div>"
        )
    if page.state.of(ExportState).order is not None and result is not None:
        trouble = f'<div class="et-failed" role="alert" data-testid="taking">{escape(result.trouble)}</div>'
        return f'<div class="et">{trouble}</div>'
    change = page.state.of(InspectState).change
    if wanted is not None and wanted.format == "session" and change.run_from is not None:
        words = f"It holds what is changed in the network, from window {change.run_from} on."
        return f'<div class="et"><div class="et-note">{words}</div></div>'
    return ""


def _ranged(page: Page, wanted: StartExport) -> StartExport:
    """With the windows between the page's marks."""
    moment = page.moment
    if moment is None:
        return wanted
    order = order_of(page.state, wanted, Limits(moment.recording.sensor, moment.windows, moment.recording.span.start))
    return wanted if order is None else order.wanted


def _range_html(page: Page) -> str:
    """The stretch that is exported: between the timeline's marks."""
    moment, state = page.moment, page.state
    if moment is None:
        return ""
    words = "all windows; mark A and B on the timeline to export what lies between"
    if state.mark_a is not None or state.mark_b is not None:
        limits = Limits(moment.recording.sensor, moment.windows, moment.recording.span.start)
        stretch = limits.stretch(state.mark_a, state.mark_b)
        start = moment.recording.span.start
        begin, end = moment.windows[stretch[0]].t_start - start, moment.windows[stretch[-1]].t_stop - start
        words = f"{begin / 1e6:.3f} – {end / 1e6:.3f} s (A–B), windows {stretch[0]} – {stretch[-1]}"
    return f'<div class="et"><div class="et-note" data-testid="export-range">Range: {words}</div></div>'


def _told(page: Page, wanted: StartExport) -> str:
    """The command that makes the same."""
    moment, line = page.moment, command_line_of(page)
    if wanted.sheet != "panels":
        words = "The browser saves it. It is made of this moment as it is shown; the scene is left out."
        return f'<div class="et"><div class="et-note">{words}</div></div>'
    if moment is None or line is None:
        words = "The browser saves it. <code>etnet export</code> opens what <code>etnet simulate --video</code> makes."
        return f'<div class="et"><div class="et-note">{words}</div></div>'
    if wanted.is_replayed:
        words = "The browser saves it, with the windows that the protocol feeds, from its cold start."
        return f'<div class="et"><div class="et-note">{words}</div></div>'
    name = moment.recording.name
    out = f"{plain_name(name)}_frames" if wanted.format == "png" else file_name(name, wanted.format)
    tone, style = page.state.of(ReconstructionState).tone, page.state.of(EventsState).event_image
    command = export_command(_ranged(page, wanted), moment, line, page.state.query, out, tone, style, page.state)
    words = "This makes the same, of any size:"
    if wanted.runs:
        *others, last = [NAMES[run.number] for run in wanted.runs]
        words = f"Runs {', '.join(others)} and {last} stand side by side, as on the stage. {words}"
    if not page.state.of(InspectState).change.is_nothing:
        words = "It has what is changed in the network; this makes the same without the change:"
    return (
        f'<div class="et"><div class="et-note">The browser saves it. {words}</div>'
        f'<code class="etv-command" data-testid="command">{_unbroken(command)}</code></div>'
    )


def _unbroken(command: str) -> str:
    """A line of it ends between two words, and not after a hyphen of an option."""
    return " ".join(f"<span>{escape(word)}</span>" for word in command.split(" "))

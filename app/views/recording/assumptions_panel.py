"""What a visitor states about a file that does not say everything: the command line's options, as widgets."""

from __future__ import annotations

import re
from typing import Literal

import viser

from app.catalogue.recording_id import RecordingId, listed_id, stated_id
from app.html.elements import escape
from app.state import intents as ask
from app.views.page import Page
from app.views.panel import Dispatch, Html, assign
from etnet.errors import EtnetError, RecordingError
from etnet.events.assumptions import NOTHING_ASSUMED, Assumptions, TimeUnit

AS_FOUND = "as the file says"
UNITS: dict[str, TimeUnit | None] = {
    AS_FOUND: None,
    "seconds": "s",
    "milliseconds": "ms",
    "microseconds": "us",
    "nanoseconds": "ns",
}
POLARITIES: dict[str, Literal["auto", "inverted", "positive"]] = {
    AS_FOUND: "auto",
    "ON and OFF swapped": "inverted",
    "all above 0 is ON": "positive",
}
_SENSOR = re.compile(r"\s*(\d{1,5})\s*[x×,; ]\s*(\d{1,5})\s*")


class Statement:
    """A folder that is there for a visitor's own files. Nothing is opened before the button is pressed."""

    def build(self, gui: viser.GuiApi, dispatch: Dispatch) -> None:
        """Lay out the widgets, once. They name the options that errors and remarks speak of."""
        self._recording_id = ""
        self._folder = gui.add_folder("Import options", expand_by_default=False, visible=False)
        with self._folder:
            self._of = Html(gui)
            self._sensor = gui.add_text("Sensor", "", hint="--assume: width×height in pixels, for example 640×480")
            self._unit = gui.add_dropdown("Time unit", tuple(UNITS), hint="--time-unit")
            self._polarity = gui.add_dropdown("Polarity", tuple(POLARITIES), hint="--polarity")
            self._sorts = gui.add_checkbox("Sort timestamps", False, hint="--sort: loads the whole file")
            self._drops = gui.add_checkbox(
                "Drop outside", False, hint="--drop-outside: events beyond the sensor; loads the whole file"
            )
            button = gui.add_button("Reopen", icon=viser.Icon.FOLDER_OPEN)

        async def pressed(event: viser.GuiEvent[viser.GuiButtonHandle]) -> None:
            if event.client is None or not self._recording_id:
                return
            try:
                dispatch(ask.OpenRecording(stated_id(self._recording_id, self._stated())))
            except EtnetError as error:
                event.client.add_notification("Not understood", str(error), auto_close_seconds=8.0)

        button.on_click(pressed)

    def show(self, page: Page) -> None:
        """Say what is stated of the recording, once it is another one: what is being typed stays."""
        is_offered, is_refused = bool(page.stated_id), page.stated_id not in ("", page.state.recording_id)
        if self._folder.visible != is_offered:
            self._folder.visible = is_offered
        self._of.show(_of_html(page) if is_refused else "")
        if page.stated_id == self._recording_id:
            return
        self._recording_id = page.stated_id
        try:
            stated = RecordingId.of(self._recording_id).stated
        except EtnetError:
            stated = NOTHING_ASSUMED
        assign(self._sensor, "" if stated.sensor is None else f"{stated.width}×{stated.height}")
        assign(self._unit, next(text for text, unit in UNITS.items() if unit == stated.time_unit))
        assign(self._polarity, next(text for text, rule in POLARITIES.items() if rule == stated.polarity))
        assign(self._sorts, stated.sort)
        assign(self._drops, stated.drop_outside)

    def _stated(self) -> Assumptions:
        width, height = sensor_of(str(self._sensor.value))
        unit, polarity = UNITS.get(self._unit.value), POLARITIES.get(self._polarity.value, "auto")
        return Assumptions(width, height, unit, polarity, bool(self._sorts.value), bool(self._drops.value))


def _of_html(page: Page) -> str:
    """Which file the options are for, where it is not the one that is open."""
    names = (choice.title for choice in page.recordings if choice.id == listed_id(page.stated_id))
    said = f"{next(names, 'The file')} could not be opened as it is."
    return f'<div class="et"><div class="et-note">{escape(said)}</div></div>'


def sensor_of(text: str) -> tuple[int | None, int | None]:
    """Sides from "640×480", "640x480" or "640, 480"; none from an empty text.

    Raises:
        RecordingError: any other text.
    """
    if not text.strip():
        return None, None
    found = _SENSOR.fullmatch(text)
    if found is None:
        raise RecordingError(f'the sensor "{text[:40]}" is not understood; give it as 640×480, or leave it empty')
    return int(found[1]), int(found[2])

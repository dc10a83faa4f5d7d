"""What the sensor reported, what the network makes of it, what a camera saw: side by side, and the voxel bins."""

from __future__ import annotations

import viser

from app.html.elements import empty, panel
from app.html.pictures import camera_frame_html, event_image_html, reconstruction_html
from app.session.channel import ON_PICK
from app.state import intents as ask
from app.state.view_state import choices
from app.views.view import Dispatch, Html, Page, assign, on_visitor
from app.views.voxels.html import voxel_html

TONES: dict[ask.Tone, str] = {
    "auto": "as the network needs",
    "raw": "as it comes",
    "robust": "stretched",
    "gamma": "gamma 2.2",
    "hdr": "auto HDR",
    "clahe": "local contrast",
}


class Reconstruction:
    """What the network makes of the events, beside what an ordinary camera saw."""

    def build(self, gui: viser.GuiApi, dispatch: Dispatch) -> None:
        """Two pictures; a click on either asks where the network looks from there."""
        self._reconstruction = Html(gui)
        self._camera = Html(gui)

    def show(self, page: Page) -> None:
        """Draw the newest frame and the camera's nearest one."""
        self._reconstruction.show(titled("Reconstruction", reconstruction(page)))
        if page.moment is None:
            self._camera.show("")
            return
        self._camera.show(titled("Camera", camera_frame_html(page.moment, tones=page.tones, on_pick=ON_PICK)))


class EventPicture:
    """All events of the window in one image, and how it and the greys are drawn."""

    def build(self, gui: viser.GuiApi, dispatch: Dispatch) -> None:
        """The image, then its two settings."""
        self._events = Html(gui)
        self._style = gui.add_dropdown("Events as", choices(ask.EventImage))
        self._tone = gui.add_dropdown("Brightness", tuple(TONES.values()))
        words: dict[str, ask.Tone] = {text: tone for tone, text in TONES.items()}
        on_visitor(self._style, ask.ChooseEventImage, dispatch)
        on_visitor(self._tone, lambda text: ask.ChooseTone(words[text]) if text in words else None, dispatch)

    def show(self, page: Page) -> None:
        """Draw the moment; without one, say why."""
        assign(self._style, page.state.event_image)
        assign(self._tone, TONES[page.state.tone])
        if page.moment is None:
            nothing = panel("events", empty("No recording", page.trouble or "Choose one under Recording."))
            self._events.show(titled("Events", nothing))
            return
        self._events.show(titled("Events", event_image_html(page.moment, page.state.event_image, on_pick=ON_PICK)))


class Voxels:
    """The grid that the network is given."""

    def build(self, gui: viser.GuiApi, dispatch: Dispatch) -> None:
        """Five tiles; a click enlarges one."""
        self._voxels = Html(gui)

    def show(self, page: Page) -> None:
        """Draw the bins of the moment."""
        if page.moment is None:
            self._voxels.show("")
            return
        self._voxels.show(
            titled("What the network is given", voxel_html(page.moment, page.state.voxel_bin, on_pick=ON_PICK))
        )


def reconstruction(page: Page, is_plain: bool = False) -> str:
    """The reconstruction's panel; plain, it takes no clicks and marks no pixel."""
    return reconstruction_html(
        page.ready,
        tones=page.tones,
        wanted=page.missed,
        query=None if is_plain else page.state.query,
        working=page.working,
        failed=page.failed,
        on_pick="" if is_plain else ON_PICK,
    )


def titled(title: str, content: str) -> str:
    """A picture under its name."""
    return f'<section class="etv-titled"><h3>{title}</h3>{content}</section>'

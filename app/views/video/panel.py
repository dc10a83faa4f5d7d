"""The tab of a video: sliders of the sensor, progress, scores."""

from __future__ import annotations

import math
from dataclasses import replace

import viser

from app.catalogue.videos import CONTRASTS, NOISES, FilmSetting, film_id
from app.state import intents as ask
from app.views.page import Page
from app.views.panel import Dispatch, Html, Panel, assign, on_visitor
from app.views.video.html import choices_html, film_html, no_video_html, strip_html


class VideoPanel(Panel):
    """A setting is part of the recording's id: whatever moves asks for another film of the same video."""

    def build_settings(self, gui: viser.GuiApi, dispatch: Dispatch) -> None:
        """Two sliders between HTML of our own."""
        self._missing = Html(gui)
        usual = FilmSetting()
        low, high = CONTRASTS
        self._contrast = gui.add_slider("Contrast threshold", low, high, 0.05, usual.contrast, visible=False)
        self._noise = gui.add_slider("Sensor noise", *NOISES, 0.1, usual.noise, visible=False)
        self._choices = Html(gui)
        self._film = Html(gui)
        self._strip = Html(gui)
        self._shown: tuple[str, FilmSetting] | None = None
        on_visitor(self._contrast, lambda value: self._seen("contrast", value), dispatch)
        on_visitor(self._noise, lambda value: self._seen("noise", value), dispatch)

    def show_settings(self, page: Page) -> None:
        """Say how the video is seen, how far it is, and how good the frames are; or how one is opened."""
        film = page.video
        self._shown = None if film is None else (page.state.recording_id, film.setting)
        for slider in (self._contrast, self._noise):
            if slider.visible != (film is not None):
                slider.visible = film is not None
        if film is None:
            self._missing.show(no_video_html(page))
            for part in (self._choices, self._film, self._strip):
                part.show("")
            return
        self._missing.show("")
        assign(self._contrast, film.setting.contrast)
        assign(self._noise, film.setting.noise)
        self._choices.show(choices_html(page.state.recording_id, film.setting))
        self._film.show(film_html(film))
        self._strip.show(strip_html(page))

    def _seen(self, name: str, value: float) -> ask.Intent | None:
        """The same video with one setting changed."""
        if self._shown is None or not math.isfinite(value):
            return None
        recording_id, setting = self._shown
        return ask.ReopenRecording(film_id(recording_id, replace(setting, **{name: float(value)})))

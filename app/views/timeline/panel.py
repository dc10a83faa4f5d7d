"""The timeline and what moves along it: one strip, one slider that lies over it, five buttons, speed, typed time."""

from __future__ import annotations

import viser

from app.html.choices import SPEEDS
from app.html.live import live_line
from app.state import intents as ask
from app.views.page import Page
from app.views.panel import Dispatch, Html, Panel, assign, on_press, on_visitor
from app.views.timeline.html import now_html, timeline_html, timeline_key_html

EVERY_FRAME = "every window"
CHOICES: dict[str, ask.ChooseSpeed] = {
    EVERY_FRAME: ask.ChooseSpeed(0.1, waits_for_frames=True),
    **{words: ask.ChooseSpeed(speed) for words, speed in SPEEDS.items()},
}
_WAITING = '<div class="etv-strip"></div>'


class TimelinePanel(Panel):
    """The strip at the foot of the page."""

    def build(self, gui: viser.GuiApi, dispatch: Dispatch) -> None:
        """In the order in which `static/page/theme.css` puts them on a grid."""
        self._now = Html(gui)
        self._strip = Html(gui, _WAITING)
        self._slider = gui.add_slider("Window", 0, 1, 1, 0)
        buttons = (
            ("First window", viser.Icon.PLAYER_SKIP_BACK, ask.Seek(0)),
            ("Previous window", viser.Icon.PLAYER_TRACK_PREV, ask.Move(-1)),
            ("Play", viser.Icon.PLAYER_PLAY, ask.TogglePlay()),
            ("Next window", viser.Icon.PLAYER_TRACK_NEXT, ask.Move(1)),
            ("Last window", viser.Icon.PLAYER_SKIP_FORWARD, ask.Seek(10**9)),
        )
        made = [gui.add_button(label, icon=icon) for label, icon, _ in buttons]
        for button, (_, _, intent) in zip(made, buttons, strict=True):
            on_press(button, intent, dispatch)
        self._play = made[2]
        self._speed = gui.add_dropdown("Speed", tuple(CHOICES), initial_value="1/10 of real time")
        self._loop = gui.add_checkbox("Loop", True)
        self._time = gui.add_number("Time (s)", 0.0, min=0.0, step=0.001)
        on_visitor(self._slider, lambda value: ask.Seek(int(value)), dispatch)
        on_visitor(self._speed, CHOICES.get, dispatch)
        on_visitor(self._loop, lambda value: ask.SetLoop(bool(value)), dispatch)
        on_visitor(self._time, lambda value: ask.SeekTime(float(value)), dispatch)
        self._is_playing = False

    def show(self, page: Page) -> None:
        """Move the head, redraw what is cached, and set the widgets to what is so."""
        state = page.state
        assign(self._speed, _speed_words(state.speed, state.waits_for_frames))
        assign(self._loop, state.loops)
        runs = state.is_playing or page.follows
        if runs != self._is_playing:
            self._is_playing = runs
            self._play.label = "Pause" if runs else "Play"
            self._play.icon = viser.Icon.PLAYER_PAUSE if runs else viser.Icon.PLAYER_PLAY
        live = ""
        if page.live is not None:
            live = live_line(page.live, page.is_live, page.follows, page.gone, state.is_public)
        moment = page.placed if page.moment is None else page.moment
        if moment is None:
            self._now.show(f'<div class="etv-now">{live}</div>' if live else "")
            self._strip.show(_WAITING)
            return
        last = max(len(moment.windows) - 1, 1)
        if self._slider.max != last:
            # viser leaves a value beyond a smaller maximum where it is: bring it inside first.
            self._slider.value = min(self._slider.value, last)
            self._slider.max = last
        assign(self._slider, state.index)
        assign(self._time, round(max(moment.seconds[1], 0.0), 3))
        self._now.show(f'<div class="etv-now">{now_html(moment)}{live or timeline_key_html(moment)}</div>')
        self._strip.show(f'<div class="etv-strip">{timeline_html(moment, page.cached, over=page.over_timeline)}</div>')


def _speed_words(speed: float, waits_for_frames: bool) -> str:
    return EVERY_FRAME if waits_for_frames else min(SPEEDS, key=lambda words: abs(SPEEDS[words] - speed))

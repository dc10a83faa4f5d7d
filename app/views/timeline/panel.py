"""The timeline and what moves along it: buttons of our own, the strip, and viser's slider for who cannot see it."""

from __future__ import annotations

import viser

from app.html.elements import escape
from app.html.live import live_line
from app.html.moment import PICTURES
from app.html.pictures import Tones
from app.html.units import count, seconds
from app.state import intents as ask
from app.views.compare.state import CompareState
from app.views.inspect.state import NO_CHANGE, InspectState
from app.views.page import Page
from app.views.panel import Dispatch, Html, Panel, assign, on_visitor, set_value
from app.views.reconstruction.state import tones_in
from app.views.timeline.html import legend_html, marks_html, now_html, speed_html, timeline_html, transport_html
from etnet.render.encode import data_url
from etnet.render.tone import tone_map

_WAITING = '<div class="etv-strip"></div>'
_NOTHING_HOVERED = '<i class="etv-hovered"></i>'


class TimelinePanel(Panel):
    """The strip at the foot of the page."""

    def build(self, gui: viser.GuiApi, dispatch: Dispatch) -> None:
        """In the order in which `static/page/page.css` puts them on a grid."""
        self._transport = Html(gui)
        self._now = Html(gui)
        self._strip = Html(gui, _WAITING)
        self._slider = gui.add_slider("Window", 0, 1, 1, 0)
        self._time = gui.add_number("Time (s)", 0.0, min=0.0, step=0.001)
        self._hovered = Html(gui, _NOTHING_HOVERED)
        self._ruler = Html(gui, '<div class="etv-ruler"></div>')
        on_visitor(self._slider, lambda value: ask.Seek(int(value)), dispatch)
        on_visitor(self._time, lambda value: ask.SeekTime(float(value)), dispatch)

    def show(self, page: Page) -> None:
        """Move the head, redraw what is cached, and set the widgets to what is so."""
        state = page.state
        moment = page.placed if page.moment is None else page.moment
        live = ""
        if page.live is not None:
            live = live_line(page.live, page.is_live, page.follows, page.gone, state.is_public)
        self._transport.show(transport_html(state, runs=state.is_playing or page.follows))
        self._hovered.show(hovered_html(page))
        if moment is None:
            self._now.show(f'<div class="etv-now">{live}</div>' if live else "")
            self._strip.show(_WAITING)
            return
        last = max(len(moment.windows) - 1, 1)
        if self._slider.max != last:
            # viser leaves a value beyond a smaller maximum where it is: bring it inside first.
            set_value(self._slider, min(self._slider.value, last))
            self._slider.max = last
        assign(self._slider, state.index)
        assign(self._time, round(max(moment.seconds[1], 0.0), 3))
        approximate, changed = approximate_windows(page), changed_windows(page)
        legend = legend_html(
            moment, is_approximate=bool(approximate), is_changed=bool(changed), measure=measure_of(page)
        )
        marks = marks_html(moment, state)
        beside = live or f'<span class="etv-beside">{marks}{legend}{speed_html(state)}</span>'
        self._now.show(f'<div class="etv-now">{now_html(moment)}{beside}</div>')
        strip = timeline_html(
            moment, page.cached, state, approximate=approximate, changed=changed, over=page.over_timeline
        )
        self._strip.show(f'<div class="etv-strip">{strip}</div>')


def measure_of(page: Page) -> str:
    """What the curves over the strip are of, if there are any."""
    has_curves = " data-run=" in page.over_timeline  # of a run each; what is changed is marked there, too
    return page.state.of(CompareState).measure.upper() if has_curves else ""


def approximate_windows(page: Page) -> range:
    """The window whose frame is a preview from a cold start, if the page shows one."""
    ready = page.ready
    if ready is None or not ready.is_approximate:
        return range(0)
    return range(ready.request.index, ready.request.index + 1)


def changed_windows(page: Page) -> range:
    """The windows in which something is changed on purpose."""
    change = page.state.of(InspectState).change
    if change is NO_CHANGE or change.is_nothing or page.moment is None:
        return range(0)
    if change.since is None:
        return range(page.state.index, page.state.index + 1)
    if change.at(change.since + 1).is_nothing:
        return range(change.since, change.since + 1)
    return range(change.since, len(page.moment.windows))


def hovered_html(page: Page) -> str:
    """What the pointer is over, for `static/page/channel.js`, which shows it beside the pointer."""
    hovered = page.hovered
    if hovered is None or page.moment is None:
        return _NOTHING_HOVERED
    words = f"{seconds(hovered.seconds)} · window {count(hovered.index)}"
    picture = ""
    if hovered.frame is not None:
        tones = tones_in(page.state, page.model.is_linear_light)
        frame, key = hovered.frame, (*hovered.key, tones)
        picture = PICTURES.text(("thumbnail", *key), lambda: _small(frame, tones))
    return (
        f'<i class="etv-hovered" data-at="{hovered.seconds:.4f}" data-words="{escape(words)}"'
        f' data-picture="{picture}"></i>'
    )


def _small(frame, tones: Tones) -> str:
    return data_url(tone_map(frame, tones.tone, tones.is_linear_light), is_lossless=False)

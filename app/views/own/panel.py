"""A view of one's own as a tab: its widgets, and what it returns, computed beside the page; the newest moment wins."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import viser

from app.catalogue.threads import THREADS
from app.engine.requests import Ready
from app.html.elements import empty, panel
from app.html.moment import Moment
from app.state.intents import FormChanged
from app.views.own.html import error_html, own_html
from app.views.own.jobs import step_in
from app.views.own.values import OwnMoment, OwnView
from app.views.page import Page
from app.views.panel import Dispatch, Html, Panel, on_visitor

if TYPE_CHECKING:
    from etnet.nets.base import Step


class OwnPanel(Panel):
    """Nothing of the page waits for the user's code, and nothing of it ends with an error in there."""

    def __init__(self, name: str, own: OwnView) -> None:
        """`name` is the view's."""
        self._name, self._own = name, own
        self._lock = threading.Lock()
        self._wanted: tuple[object, Any] | None = None
        self._shown: object = None
        self._is_running = False
        self._content = ""

    def build_settings(self, gui: viser.GuiApi, dispatch: Dispatch) -> None:
        """One widget for each value that the file declares, then what it returns."""
        self._dispatch = dispatch
        self._widgets = {name: _widget(gui, name, first) for name, first in self._own.widgets.items()}
        for handle in self._widgets.values():
            on_visitor(handle, lambda _: FormChanged(), dispatch)
        self._body = Html(gui)

    def show_settings(self, page: Page) -> None:
        """Ask for the current moment, and draw the newest answer."""
        if page.moment is None:
            self._body.show(panel("own", empty("No recording", page.trouble or "Choose one in the bar.")))
            return
        values = {name: handle.value for name, handle in self._widgets.items()}
        ready = page.ready if page.ready is not None and page.ready.request.index == page.state.index else None
        step = step_in(page.results, self._name, ready)
        made = None if ready is None else ready.key, step is not None
        key = (page.moment.key, made, page.state.query, tuple(values.items()))
        moment, query = page.moment, page.state.query
        with self._lock:
            if key != self._shown and (self._wanted is None or self._wanted[0] != key):
                self._wanted = (key, lambda: self._own.show(moment_of(moment, ready, query, step), **values))
            starts = self._wanted is not None and not self._is_running
            self._is_running |= starts
        if starts:
            THREADS.start(self._run, "own view")
        self._body.show(self._content or panel("own", '<div class="et-note">computing</div>'))

    def _run(self) -> None:
        while True:
            with self._lock:
                if self._wanted is None:
                    self._is_running = False
                    return
                key, compute = self._wanted
                self._wanted = None
            try:
                value = compute()
                for part in value if isinstance(value, Iterator) else (value,):
                    self._tell(own_html(part))
            except BaseException as error:  # the user's code may raise anything, SystemExit as well
                self._tell(error_html(error, self._own.path))
            self._shown = key

    def _tell(self, content: str) -> None:
        if content != self._content:
            self._content = content
            self._dispatch(FormChanged())


def _widget(gui: viser.GuiApi, name: str, first: Any) -> Any:
    """A checkbox, a number, a list or a text, by the value that it begins with."""
    label = name.replace("_", " ").capitalize()
    if isinstance(first, bool):
        return gui.add_checkbox(label, first)
    if isinstance(first, int | float):
        return gui.add_number(label, first)
    if isinstance(first, list | tuple) and first:
        if len(first) == 3 and all(isinstance(part, int | float) for part in first):
            low, high, value = first
            return gui.add_slider(label, low, high, (high - low) / 100, value)
        return gui.add_dropdown(label, tuple(str(part) for part in first))
    return gui.add_text(label, str(first))


def moment_of(
    moment: Moment, ready: Ready | None, query: tuple[int, int] | None, step: Step | None = None
) -> OwnMoment:
    """What the user's code is given of a window, with what has come of it."""
    probed = None if step is None else step.attention
    source = moment.recording.ground_truth
    truth = None if source is None or not len(source) else source.read_frame(source.nearest(moment.window.t_stop))
    return OwnMoment(
        moment.recording,
        moment.window,
        moment.windows,
        moment.events,
        moment.voxel,
        None if ready is None else ready.frame,
        truth,
        query,
        probed if ready is None or ready.attention is None else ready.attention,
        ready is not None and ready.is_exact,
        step,
    )

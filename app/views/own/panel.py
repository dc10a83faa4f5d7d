"""A view of one's own as a tab: its widgets, and what it returns, computed beside the page; the newest moment wins."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING, Any, NamedTuple

import viser

from app.catalogue.threads import THREADS
from app.engine.requests import Ready
from app.html.elements import empty, panel
from app.html.moment import Moment
from app.state.intents import FormChanged
from app.views.own.html import error_html, own_html
from app.views.own.jobs import step_in
from app.views.own.values import OwnMoment, OwnView, is_slider
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
        self._asked: object = None
        """What the newest computation is of, whether it waits, runs or is done: each is made once."""
        self._wanted: tuple[_Key, Callable[[], Any]] | None = None
        """The one that waits."""
        self._is_running = False
        self._shown: _Key | None = None
        """What `_content` is of."""
        self._content = ""

    def build_settings(self, gui: viser.GuiApi, dispatch: Dispatch) -> None:
        """One widget for each value that the file declares, then what it returns."""
        self._dispatch = dispatch
        self._widgets = {name: _Widget(gui, name, first) for name, first in self._own.widgets.items()}
        for widget in self._widgets.values():
            on_visitor(widget.handle, lambda _: FormChanged(), dispatch)
        self._body, self._lag = Html(gui), Html(gui)

    def show_settings(self, page: Page) -> None:
        """Ask for the current moment, and draw the newest answer."""
        if page.moment is None:
            self._body.show(panel("own", empty("No recording", page.trouble or "Choose one in the bar.")))
            self._lag.show("")
            return
        chosen = {name: widget.handle.value for name, widget in self._widgets.items()}
        values = {name: self._widgets[name].meant(value) for name, value in chosen.items()}
        ready = _ready_in(page)
        step = step_in(page.results, self._name, ready)
        made = None if ready is None else (*ready.key, ready.is_exact, ready.attention is not None)
        key = _Key(page.moment.key, (made, step is not None, page.state.query), tuple(chosen.values()))
        moment, query = page.moment, page.state.query
        with self._lock:
            if key != self._asked:
                self._asked = key
                self._wanted = key, lambda: self._own.show(moment_of(moment, ready, query, step), **values)
            starts = self._wanted is not None and not self._is_running
            self._is_running |= starts
        if starts:
            THREADS.start(self._run, "own view")
        with self._lock:
            content, shown = self._content, self._shown
        self._body.show(content or panel("own", '<div class="et-note">computing</div>'))
        self._lag.show(_lag_html(shown, key))

    def _run(self) -> None:
        while True:
            with self._lock:
                if self._wanted is None:
                    self._is_running = False
                    return
                (key, compute), self._wanted = self._wanted, None
            try:
                value = compute()
                if isinstance(value, Iterator):
                    self._tell_parts(value, key)
                else:
                    self._tell(own_html(value), key)
            except BaseException as error:  # the user's code may raise anything, SystemExit as well
                self._tell(error_html(error, self._own.path), key)

    def _tell_parts(self, parts: Iterator[object], key: _Key) -> None:
        """What has been yielded so far, until there is no more or a newer moment waits."""
        try:
            for part in parts:
                self._tell(own_html(part), key)
                if self._wanted is not None:
                    break
        finally:
            close = getattr(parts, "close", None)
            if close is not None:
                close()

    def _tell(self, content: str, key: _Key) -> None:
        with self._lock:
            is_news = (content, key) != (self._content, self._shown)
            self._content, self._shown = content, key
        if is_news:
            self._dispatch(FormChanged())


class _Key(NamedTuple):
    """What an answer depends on: the moment, what has come of it, and the widgets' values."""

    moment: tuple[object, ...]
    found: tuple[object, ...]
    values: tuple[object, ...]


def _lag_html(shown: _Key | None, wanted: _Key) -> str:
    """What is said below an answer to what is no longer asked. It is seen only where the next one takes a while."""
    if shown is None or shown == wanted:
        return ""
    words = "computing" if shown.moment == wanted.moment else "shows a former moment; the current one follows"
    late = "animation:etv-late 400ms steps(1,end)"
    return panel("own-lag", f'<div class="et-lag"><span>{words}</span></div>', style=late)


class _Widget:
    """A checkbox, a number, a slider, a list or a text, by the value that it begins with."""

    def __init__(self, gui: viser.GuiApi, name: str, first: Any) -> None:
        label = name.replace("_", " ").capitalize()
        self._options: dict[str, Any] = {}
        """Values of a list, by what stands there."""
        if isinstance(first, bool):
            self.handle: Any = gui.add_checkbox(label, first)
        elif isinstance(first, int | float):
            self.handle = gui.add_number(label, first)
        elif is_slider(first):
            low, high, value = first
            is_whole = all(isinstance(part, int) for part in first)
            self.handle = gui.add_slider(label, low, high, 1 if is_whole else (high - low) / 100, value)
        elif isinstance(first, list | tuple) and first:
            self._options = {str(part): part for part in first}
            self.handle = gui.add_dropdown(label, tuple(self._options))
        else:
            self.handle = gui.add_text(label, str(first))

    def meant(self, value: Any) -> Any:
        """What the user's code is given for what stands in the widget."""
        return self._options.get(value, value) if self._options else value


def _ready_in(page: Page) -> Ready | None:
    """The frame of the current window, as it is asked for now; `None` while a former one stands in."""
    ready = page.ready
    return None if ready is None or ready.is_former or ready.request.index != page.state.index else ready


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

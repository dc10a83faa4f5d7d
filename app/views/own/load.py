"""A user's own file as a view: a `show(moment)` of the common case, or a whole `VIEW`."""

from __future__ import annotations

import hashlib
import importlib.util
import math
import os
import re
import sys
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

from app.engine.jobs import Job
from app.engine.requests import FrameRequest
from app.state.view_state import ViewState
from app.views.own.jobs import step_jobs
from app.views.own.values import OwnView, is_slider
from app.views.view import EXPERT, View
from etnet.errors import EtnetError

if TYPE_CHECKING:
    import viser

    from app.views.panel import Panel


class OwnViewError(EtnetError):
    """A file of the user's own is no view."""


def own_views(sources: Iterable[Path | str | Callable[..., Any] | View], is_open: bool = False) -> tuple[View, ...]:
    """The views of files, functions and ready views, in order. `is_open`: others than their user may come in.

    Raises:
        OwnViewError: a file cannot be run, or defines neither `show` nor `VIEW`; two views have one name; others come.
    """
    views: list[View] = []
    sources = list(sources)
    if sources and is_open:
        raise OwnViewError("views of your own run your code: they are not for a demo, a public URL or another host")
    for source in sources:
        view = source if isinstance(source, View) else _view_of(source)
        if any(view.name == known.name for known in views):
            raise OwnViewError(f"two views are called {view.name}; rename one of the files")
        views.append(view)
    return tuple(views)


def _view_of(source: Path | str | Callable[..., Any]) -> View:
    if callable(source):
        name = getattr(source, "__name__", "view")
        path = getattr(getattr(source, "__code__", None), "co_filename", "")
        widgets, probe = _widgets_of(source, name), bool(getattr(source, "probe", False))
        return _short_form(OwnView(_title(name), path, source, widgets, probe))
    path = Path(source)
    module = _run(path)
    view = getattr(module, "VIEW", None)
    if isinstance(view, View):
        return view
    show = getattr(module, "show", None)
    if not callable(show):
        raise OwnViewError(f"{path.name}: defines neither show(moment) nor VIEW; docs/own_view.md has an example")
    title = str(getattr(module, "title", _title(path.stem)))
    widgets, probe = _widgets_of(module, path.name), bool(getattr(module, "probe", False))
    return _short_form(OwnView(title[:40], module.__file__, show, widgets, probe))


def _widgets_of(source: object, called: str) -> dict[str, Any]:
    """What a file or a function declares; what no page can show is refused here, where one line says why."""
    declared = getattr(source, "widgets", {})
    if not isinstance(declared, Mapping) or not all(isinstance(name, str) for name in declared):
        raise OwnViewError(f"{called}: widgets is {declared!r}; wanted a dict of names and first values")
    for name, first in declared.items():
        if not is_slider(first):
            continue
        low, high, value = first
        if not (math.isfinite(high - low) and low < high and low <= value <= high):
            raise OwnViewError(
                f"{called}: widget {name} is {first!r}; three numbers are a slider (from, to, first value), and the "
                f"first value lies between the other two; for a list write texts, {tuple(map(str, first))!r}"
            )
    return dict(declared)


def _run(path: Path) -> Any:
    if not path.is_file():
        raise OwnViewError(f"--view {path}: there is no such file")
    mark = hashlib.sha256(os.fsencode(path.resolve())).hexdigest()[:12]
    spec = importlib.util.spec_from_file_location(f"own_view_{_plain(path.stem)}_{mark}", path)
    if spec is None or spec.loader is None:
        raise OwnViewError(f"--view {path}: not a Python file; wanted a .py")
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module  # dataclasses and get_type_hints look there for a file's names
    try:
        spec.loader.exec_module(module)
    except Exception as error:
        sys.modules.pop(spec.name, None)
        raise OwnViewError(f"--view {path}: {type(error).__name__}: {error}") from error
    return module


def _short_form(own: OwnView) -> View:
    name = f"own-{_plain(own.title)}"

    @dataclass(frozen=True, slots=True)
    class OwnState:
        """Widgets hold what is chosen; the page keeps nothing."""

        view: ClassVar[str] = name

    def panel(client: viser.ClientHandle) -> Panel:
        from app.views.own.panel import OwnPanel

        return OwnPanel(name, own)

    def jobs(state: ViewState, request: FrameRequest) -> Mapping[str, Job]:
        return step_jobs(name, request) if own.probe else {}

    return View(name, own.title, "PUZZLE", OwnState(), panel, settings_in=EXPERT, jobs=jobs)


def _title(stem: str) -> str:
    return stem.replace("_", " ").strip().capitalize() or "Own view"


def _plain(text: str) -> str:
    return re.sub(r"[^a-z0-9]+", "-", text.lower()).strip("-") or "view"

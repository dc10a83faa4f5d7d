"""Importing torch without holding up a page: between two of its thousand modules, whoever draws goes first."""

from __future__ import annotations

import gc
import sys
import threading
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from importlib.abc import MetaPathFinder
from importlib.machinery import ModuleSpec, PathFinder, SourceFileLoader
from types import ModuleType

PAUSE = 2.0
"""Seconds that a page gets at most, from its visitor's coming until its events are drawn."""
COMING = 0.4
"""Seconds from the start in which a browser comes that has waited for the port."""
AFTERWARDS = 0.15
"""Seconds in which a page draws what it has just asked for."""
MOST_PAUSES = 6.0
"""Seconds that an import may be held up in all: a crowd must not keep the network away for ever."""
_GLANCE = 0.01
_NETWORKS_OWN = ("torch", "functorch")
"""Packages before whose modules to wait. While a module is imported Python keeps it locked: to wait before one that
a page may need, too, would hold up the page."""


class GentleImport:
    """Knows until when pages are drawn. Every import holds Python's lock for milliseconds, all of torch for seconds."""

    def __init__(self, coming: float = 0.0) -> None:
        """`coming`: seconds in which the first page may come; so long nothing is imported."""
        self._until = time.monotonic() + coming
        self._paused = 0.0

    def page_begins(self) -> None:
        """A visitor has come: their page is laid out and drawn next."""
        self._until = time.monotonic() + PAUSE

    def page_asks(self) -> None:
        """A page asks for its first frame: it draws its events, and is done."""
        self._until = min(self._until, time.monotonic() + AFTERWARDS)

    def wait(self) -> None:
        """Wait while a page is drawn, as long as it is allowed to."""
        while self._paused < MOST_PAUSES and time.monotonic() < self._until:
            time.sleep(_GLANCE)
            self._paused += _GLANCE

    def import_network(self) -> None:
        """Import torch and what of ours needs it."""
        if "etnet.playback.playback" not in sys.modules:
            with self.imports(), _without_collecting():
                import etnet.nets.weights
                import etnet.playback.playback  # noqa: F401

    @contextmanager
    def imports(self) -> Iterator[None]:
        """Imports of this thread, in here, wait before each module while a page is drawn."""
        finder = _Waiting(self, threading.get_ident())
        sys.meta_path.insert(0, finder)
        try:
            self.wait()
            yield
        finally:
            sys.meta_path.remove(finder)


@contextmanager
def _without_collecting() -> Iterator[None]:
    """Python looks for garbage the more often the more is made; an import makes none, and takes a tenth less so."""
    was_on = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if was_on:
            gc.enable()


class _Waiting(MetaPathFinder):
    """Finds the network's modules where they are, and waits before it runs them.

    Not while it looks for them: Python then holds the one lock of all imports, and a page that is laid out imports.
    """

    def __init__(self, gentle: GentleImport, thread: int) -> None:
        self._gentle = gentle
        self._thread = thread

    def find_spec(
        self, fullname: str, path: Sequence[str] | None = None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        """`None` for what is not the network's; the next finder is asked."""
        if threading.get_ident() != self._thread or not fullname.startswith(_NETWORKS_OWN):
            return None
        spec = PathFinder.find_spec(fullname, path, target)
        if spec is not None and isinstance(spec.loader, SourceFileLoader):
            loader, run = spec.loader, spec.loader.exec_module

            def waits_and_runs(module: ModuleType) -> None:
                del loader.exec_module  # from now on it is as it was
                self._gentle.wait()
                run(module)

            loader.exec_module = waits_and_runs  # pyright: ignore[reportAttributeAccessIssue]  of this instance
        return spec

"""A file that stays open and is read by slice: what is read of it after it changed is an error, never other events."""

from __future__ import annotations

import os
import weakref
from collections.abc import Callable
from dataclasses import replace
from typing import TypeVar

from etnet.errors import RecordingError
from etnet.events.formats.archive import sign_of
from etnet.events.formats.base import Opened, Request
from etnet.events.formats.paged import PagedSource

Read = TypeVar("Read")


class Unchanged:
    """Knows the file of a request as it was when this was made."""

    def __init__(self, request: Request) -> None:
        self._name = request.name
        self._descriptor = os.open(request.path, os.O_RDONLY | getattr(os, "O_CLOEXEC", 0))
        self._end = weakref.finalize(self, os.close, self._descriptor)
        request.resources.callback(self._end)
        self._sign = sign_of(os.fstat(self._descriptor))

    def check(self) -> None:
        """An error where it has changed."""
        if not self._end.alive:
            raise RecordingError(f"{self._name}: is closed; open it again")
        if sign_of(os.fstat(self._descriptor)) != self._sign:
            raise RecordingError(f"{self._name}: was changed while it was open; open it again")

    def during(self, act: Callable[[], Read]) -> Read:
        """What `act` reads, if the file is still the same behind it. What went wrong in it is said by that, too."""
        try:
            found = act()
        except Exception:
            self.check()
            raise
        self.check()
        return found

    def guarding(self, opened: Opened) -> Opened:
        """The same recording, of which nothing is read from a file that has changed; what is a copy stays as it is."""
        source, truth = opened.source, opened.ground_truth
        if isinstance(source, PagedSource):
            read = source.read_columns
            source = replace(source, read_columns=lambda start, stop: self.during(lambda: read(start, stop)))
        if truth is not None:
            readers = {name: getattr(truth, name) for name in ("read_frame", "read_flow", "read_colour")}
            truth = replace(truth, **{name: self._each(read) for name, read in readers.items() if read is not None})
        return replace(opened, source=source, ground_truth=truth)

    def _each(self, read: Callable[[int], Read]) -> Callable[[int], Read]:
        return lambda index: self.during(lambda: read(index))

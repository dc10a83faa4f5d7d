"""Logs that no visitor can fill: one line a record, and of each kind of record one a minute."""

from __future__ import annotations

import logging
import sys
import time
import traceback
from collections import OrderedDict
from collections.abc import Callable
from threading import Lock
from typing import TextIO

EVERY = 60.0
"""Seconds between two lines of one kind."""
MOST_LINES = 60
"""Lines a minute, of all kinds together."""
LONGEST = 400
"""Characters of a line."""
KEPT_KINDS = 256
QUIET_KINDS = ("opening handshake failed", "connection rejected")
"""A connection that ends before it asked for anything: a port check does that all day."""


class BoundedHandler(logging.Handler):
    """Writes warnings and errors as single lines; an exception is named with the place where it was raised."""

    def __init__(self, stream: TextIO | None = None, clock: Callable[[], float] = time.monotonic) -> None:
        super().__init__(logging.WARNING)
        self._stream = stream
        self._clock = clock
        self._kinds: OrderedDict[tuple[object, ...], tuple[float, int]] = OrderedDict()
        self._minute, self._num_lines = -1, 0
        self._guard = Lock()

    def emit(self, record: logging.LogRecord) -> None:
        """Write a line, unless one of its kind, or enough of others, came within the minute."""
        if str(record.msg).startswith(QUIET_KINDS):
            return
        repeated = self._admit((record.name, _kind_of(record), _place(record)))
        if repeated is None:
            return
        try:
            stream = self._stream or sys.stderr
            stream.write(one_line(record, repeated) + "\n")
            stream.flush()
        except (OSError, ValueError, AttributeError):
            pass  # nobody listens any more: a terminal that was closed

    def _admit(self, kind: tuple[object, ...]) -> int | None:
        """How many of this kind were left out since the last line; `None` leaves this one out, too."""
        now = self._clock()
        with self._guard:
            written, left_out = self._kinds.get(kind, (-EVERY, 0))
            minute = int(now // EVERY)
            if minute != self._minute:
                self._minute, self._num_lines = minute, 0
            is_left_out = now - written < EVERY or self._num_lines >= MOST_LINES
            self._kinds[kind] = (written, left_out + 1) if is_left_out else (now, 0)
            self._kinds.move_to_end(kind)
            while len(self._kinds) > KEPT_KINDS:
                self._kinds.popitem(last=False)
            self._num_lines += not is_left_out
            return None if is_left_out else left_out


def _kind_of(record: logging.LogRecord) -> str:
    """What two records of one kind share: what `extra` says, their template where they tell of an exception, or their
    words."""
    said = getattr(record, "kind", "")
    return said or (str(record.msg)[:200] if record.exc_info else _text(record)[:120])


def _text(record: logging.LogRecord) -> str:
    try:
        return record.getMessage()
    except Exception:  # a message whose arguments do not fit is still worth its template
        return str(record.msg)


def one_line(record: logging.LogRecord, repeated: int = 0) -> str:
    """A record as one line of bounded length, whatever it carries."""
    text = _text(record)
    if record.exc_info and record.exc_info[1] is not None:
        error = record.exc_info[1]
        text = f"{text[: LONGEST // 2]} ({_place(record)}): {type(error).__name__}: {error}"
    plain = "".join(sign if sign.isprintable() else " " for sign in text)[:LONGEST]
    again = f" (and {repeated:,} more like it)" if repeated else ""
    return f"{record.name}: {plain.encode('utf-8', 'backslashreplace').decode()}{again}"


def bound_logs() -> BoundedHandler:
    """Make this process's warnings and errors bounded lines on standard error; asyncio's and websockets' included."""
    handler = BoundedHandler()
    logging.getLogger().addHandler(handler)
    return handler


def _place(record: logging.LogRecord) -> str:
    """The file and line that raised a record's exception; empty where there is none."""
    if not record.exc_info or record.exc_info[2] is None:
        return ""
    last = traceback.extract_tb(record.exc_info[2])[-1]
    return f"{last.filename.rsplit('/', 1)[-1]}:{last.lineno}"

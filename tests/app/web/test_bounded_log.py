"""However much goes wrong in however many ways, the log is a page a minute, and nothing of it is kept."""

import io
import logging

from app.web.bounded_log import KEPT_KINDS, MOST_LINES, BoundedHandler


def told(handler, words, kind=None):
    record = logging.LogRecord("app.x", logging.WARNING, "x.py", 1, words, None, None)
    if kind is not None:
        record.kind = kind
    handler.emit(record)


def test_of_all_kinds_together_there_are_sixty_lines_a_minute_and_few_are_remembered():
    stream, now = io.StringIO(), [0.0]
    handler = BoundedHandler(stream, lambda: now[0])
    for number in range(10_000):
        told(handler, f"{number} went wrong")
    assert len(stream.getvalue().splitlines()) == MOST_LINES == 60
    assert len(handler._kinds) <= KEPT_KINDS
    now[0] = 61.0
    told(handler, "the next minute")
    assert stream.getvalue().endswith("the next minute\n")


def test_one_kind_is_one_line_a_minute_and_says_how_many_there_were():
    stream, now = io.StringIO(), [0.0]
    handler = BoundedHandler(stream, lambda: now[0])
    for second in (0.0, 1.0, 2.0, 59.0, 60.0):
        now[0] = second
        told(handler, f"cut off at {second}", "cut off")
    assert stream.getvalue().splitlines() == [
        "app.x: cut off at 0.0", "app.x: cut off at 60.0 (and 3 more like it)",
    ]  # fmt: skip

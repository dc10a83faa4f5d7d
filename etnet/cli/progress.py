"""Progress bars: the one place where the library's callbacks become something to look at."""

from __future__ import annotations

import time
from collections.abc import Callable, Generator, Iterable, Iterator
from contextlib import contextmanager
from typing import TypeVar

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TaskProgressColumn, TextColumn, TimeRemainingColumn

T = TypeVar("T")
SAYS_EVERY = 60.0
"""Seconds from one line to the next where there is no terminal."""
console = Console(stderr=True, highlight=False)


class LineLog:
    """Where no terminal draws bars: one line a minute, with the share done and how long the rest takes."""

    def __init__(self, description: str, clock: Callable[[], float] = time.monotonic) -> None:
        self._description = description
        self._clock = clock
        self._began = self._said_at = clock()

    def tell(self, done: float, total: float) -> None:
        """So much is done now; it is said when a minute has passed."""
        now = self._clock()
        if console.is_terminal or now - self._said_at < SAYS_EVERY or total <= 0:
            return
        self._said_at = now
        share = min(done / total, 1.0)
        left = (now - self._began) * (1 - share) / share if share else 0.0
        counted = "" if total == 1.0 else f" {done:,.0f} of {total:,.0f},"
        rest = f", about {left / 60:.0f} min left" if share else ""
        console.print(f"{self._description}:{counted} {share:.0%}{rest}", markup=False, soft_wrap=True)


def _counting_bar() -> Progress:
    columns = TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn()
    return Progress(*columns, console=console, transient=True)


def track(items: Iterable[T], total: int, description: str) -> Iterator[T]:
    """Pass items on and draw how many are done."""
    log = LineLog(description)
    with _counting_bar() as bar:
        task = bar.add_task(description, total=total)
        for done, item in enumerate(items, start=1):
            yield item
            bar.advance(task)
            log.tell(done, total)


@contextmanager
def fraction_callback(description: str) -> Generator[Callable[[float], None]]:
    """A `progress(fraction done)` for library functions; the bar appears with the first call."""
    columns = TextColumn("{task.description}"), BarColumn(), TaskProgressColumn(), TimeRemainingColumn()
    with Progress(*columns, console=console, transient=True) as bar:
        task = bar.add_task(description, total=1.0, visible=False)
        log = LineLog(description)

        def progress(fraction: float) -> None:
            bar.update(task, completed=fraction, visible=True)
            log.tell(fraction, 1.0)

        yield progress


@contextmanager
def progress_callback(description: str) -> Generator[Callable[[int, int], None]]:
    """A `progress(done, total)` for library functions."""
    with _counting_bar() as bar:
        task = bar.add_task(description, total=None)
        log = LineLog(description)

        def progress(done: int, total: int) -> None:
            bar.update(task, completed=done, total=total)
            log.tell(done, total)

        yield progress

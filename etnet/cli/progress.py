"""Progress bars: the one place where the library's callbacks become something to look at."""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterable, Iterator
from contextlib import contextmanager
from typing import TypeVar

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TaskProgressColumn, TextColumn, TimeRemainingColumn

T = TypeVar("T")
console = Console(stderr=True, highlight=False)


def _counting_bar() -> Progress:
    columns = TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn()
    return Progress(*columns, console=console, transient=True)


def track(items: Iterable[T], total: int, description: str) -> Iterator[T]:
    """Pass items on and draw how many are done."""
    with _counting_bar() as bar:
        task = bar.add_task(description, total=total)
        for item in items:
            yield item
            bar.advance(task)


@contextmanager
def fraction_callback(description: str) -> Generator[Callable[[float], None]]:
    """A `progress(fraction done)` for library functions; the bar appears with the first call."""
    columns = TextColumn("{task.description}"), BarColumn(), TaskProgressColumn(), TimeRemainingColumn()
    with Progress(*columns, console=console, transient=True) as bar:
        task = bar.add_task(description, total=1.0, visible=False)
        yield lambda fraction: bar.update(task, completed=fraction, visible=True)


@contextmanager
def progress_callback(description: str) -> Generator[Callable[[int, int], None]]:
    """A `progress(done, total)` for library functions."""
    with _counting_bar() as bar:
        task = bar.add_task(description, total=None)
        yield lambda done, total: bar.update(task, completed=done, total=total)

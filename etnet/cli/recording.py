"""Opening and writing recordings from the command line: the same options and words for every command."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from etnet.cli.progress import console, fraction_callback
from etnet.errors import WindowError
from etnet.events.cleaning import parse_cleaning
from etnet.events.denoise import cleaned, removed_share
from etnet.events.open import open_recording
from etnet.events.opened_as import OpenedAs, View
from etnet.events.recording import Recording
from etnet.events.stated import Stated
from etnet.events.write import Layout, write_recording
from etnet.stretch import windows_between
from etnet.windows import Window


@dataclass(frozen=True)
class Opening(Stated):
    """How to take a file that does not say everything itself, and which part of it."""

    region: tuple[int, int, int, int] | None = None
    """x y width height, pixels."""
    downsample: Literal[1, 2, 4] = 1
    """Bin this many pixels a side into one."""
    flip: Literal["none", "horizontal", "vertical", "both"] = "none"
    rotate: Literal[0, 90, 180, 270] = 0
    """Degrees clockwise."""
    filter: str | None = None
    """Take noise out first: hot (pixels that fire all the time), a time such as 5ms (events that no neighbour supports
    within it), both (hot,5ms), or with a number of neighbours (hot,5ms,2)."""

    def opened_as(self) -> OpenedAs:
        """What is stated of it, which part of it is seen, and how."""
        view = View(self.region, self.downsample, self.flip, self.rotate)
        return OpenedAs(self.assumptions(), view, parse_cleaning(self.filter))


def open_with_progress(path: Path, opening: Opening) -> Recording:
    """Open `path`, with a bar while a format without an index is decoded."""
    return open_as_with_progress(path, opening.opened_as())


def open_as_with_progress(path: Path, opened: OpenedAs) -> Recording:
    """The same, as it was opened before."""
    with fraction_callback(f"opening {path.name}") as progress:
        recording = open_recording(path, assume=opened.assumed, view=opened.view, progress=progress)
    if opened.cleaning.changes_nothing:
        return recording
    filtered = cleaned(recording, opened.cleaning, closes=True)
    said = f"{recording.name}: the filter {opened.cleaning.text} removes {removed_share(filtered):.1%} of the events"
    console.print(said, markup=False, soft_wrap=True)
    return filtered


def chosen_windows(recording: Recording, windows: Sequence[Window], begin: float | None, end: float | None) -> range:
    """The windows that end after `begin` and by `end` (seconds since the first event; `None`: its own ends)."""
    if not windows:
        raise WindowError(f"{recording.name}: holds no window of events, so there is nothing to choose from")
    unending = [f"{seconds:g}" for seconds in (begin, end) if seconds is not None and not math.isfinite(seconds)]
    if unending:
        raise WindowError(
            f"--from and --to take seconds, got {' and '.join(unending)}; leave one out for the recording's own end"
        )
    start = recording.span.start
    stamps = (None if seconds is None else start + round(seconds * 1e6) for seconds in (begin, end))
    found = windows_between(windows, *stamps)
    if not found:
        until = "the end" if end is None else f"{end:g} s"
        raise WindowError(f"{recording.name}: no window ends from {begin or 0:g} s to {until}; widen the range")
    return found


def write_with_progress(
    recording: Recording,
    path: Path,
    layout: Layout | None,
    start: int = 0,
    stop: int | None = None,
    *,
    span: tuple[int, int] | None = None,
    overwrite: bool,
    told: Callable[[float], None] | None = None,
) -> int:
    """Write events start … stop − 1 with a bar; then say what was assumed, repaired or left out, and how many they are.

    `told` hears the fraction done, beside the bar.
    """
    stop = recording.num_events if stop is None else stop
    with fraction_callback(f"writing {path.name}") as bar:

        def progress(share: float) -> None:
            bar(share)
            if told is not None:
                told(share)

        remarks = write_recording(
            recording, path, layout, start=start, stop=stop, span=span, overwrite=overwrite, progress=progress
        )
    for remark in (*recording.remarks, *remarks):
        console.print(f"  {remark}", markup=False, soft_wrap=True, style="dim")
    console.print(f"{path}: {stop - start:,} events of {recording.sensor}", markup=False, soft_wrap=True)
    return stop - start

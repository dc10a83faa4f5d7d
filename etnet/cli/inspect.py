"""`etnet inspect FILE`: what a recording is, what is odd in it, what was assumed, which window would suit."""

from __future__ import annotations

import json
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated

import numpy as np
import tyro
from rich.table import Table

from etnet.cli.progress import fraction_callback
from etnet.cli.recording import Opening, open_with_progress
from etnet.errors import EtnetError
from etnet.events.examine import Examination, TriggersExam, examine
from etnet.files import check_target

_BARS = " ▁▂▃▄▅▆▇█"


@dataclass(frozen=True)
class Inspect:
    """Look a recording through once and say what it is."""

    file: tyro.conf.Positional[Path]
    """A recording: a file, a folder or a zip."""
    opening: Annotated[Opening, tyro.conf.arg(name="")] = field(default_factory=Opening)
    json: bool = False
    """Print JSON instead of the page."""
    picture: Path | None = None
    """Write a PNG (a name that ends in .png): rate curve, events per pixel, steps between events."""


def run(config: Inspect) -> int:
    """Do it; returns the exit code."""
    if config.picture is not None:
        _check_picture(config.picture, config.file)
    with (
        open_with_progress(config.file, config.opening) as recording,
        fraction_callback("looking through") as progress,
    ):
        found = examine(recording, progress)
    if config.picture is not None:
        _write_picture(config.picture, found)
    if config.json:
        print(json.dumps(found.as_dict(), indent=1))
    else:
        _print_page(found)
    return 0


def _check_picture(path: Path, recording: Path) -> None:
    """A slip of the keyboard must not cost a recording."""
    if path.suffix.lower() != ".png":
        raise EtnetError(f"--picture {path}: a PNG is written; give it a name that ends in .png")
    if path.exists() and recording.exists() and path.samefile(recording):
        raise EtnetError(f"--picture {path}: is the recording itself; choose another name")
    check_target(path)


def _print_page(found: Examination) -> None:
    from rich.console import Console
    from rich.markup import escape

    console = Console(highlight=False)
    table = Table(
        title=f"{found.name} · {found.format}", show_header=False, box=None, title_justify="left", padding=(0, 2, 0, 0)
    )
    for what, value in _rows(found):
        table.add_row(f"[dim]{what}[/dim]", value)
    console.print(table)
    for remark in found.remarks:
        if not remark.startswith("advice: "):  # these come next, among all advice
            console.print(f"  [dim]{escape(remark)}[/dim]", soft_wrap=True)
    for advice in found.advice:
        console.print(f"  → {escape(advice)}", soft_wrap=True)


def _rows(found: Examination) -> list[tuple[str, str]]:
    seconds = (found.stop - found.start) / 1e6
    share = found.num_on / found.num_looked_at if found.num_looked_at else 0.0
    mean, peak = found.mean_rate / 1e6, found.peak_rate / 1e6
    rates = f"mean {mean:.3f} Mev/s, peak {peak:.3f} Mev/s" if seconds else "no rate: all have one timestamp"
    first_gap = f", first {found.gaps[0].start:,} … {found.gaps[0].stop:,} µs" if found.gaps else ""
    rows = [
        ("sensor", f"{found.width} × {found.height} pixels"),
        ("span", f"{seconds:.6f} s, timestamps {found.start:,} … {found.stop:,} µs"),
        ("events", f"{found.num_events:,}; {share:.1%} ON; {rates}"),
        ("rate", _sparkline(found.rates) if seconds else "–"),
        ("gaps", f"{len(found.gaps)}{first_gap}"),
        ("timestamps", f"{found.num_equal_stamps:,} duplicate, {found.num_repeated_events:,} events repeated"),
        ("pixels", _pixels(found)),
    ]
    if found.frames is not None:
        frames = found.frames
        size = f"{frames.num_frames} of {frames.width} × {frames.height}, {frames.frames_per_second:.1f} a second"
        since = f"the first {frames.first_after_first_event:+,} µs from the first event"
        rows.append(("frames", f"{size}; {since}, {frames.num_outside_span} outside the events' span"))
    if found.triggers is not None:
        rows.append(("triggers", _triggers(found.triggers)))
    if found.num_looked_at < found.num_events:
        rows.append(("looked at", f"{found.num_looked_at:,} events, in blocks spread evenly over it"))
    duration = f" or {found.suggested_duration:,} µs" if found.suggested_duration else ""
    rows.append(("window", f"{found.suggested_events:,} events{duration} would suit"))
    return rows


def _triggers(found: TriggersExam) -> str:
    inputs = ", ".join(map(str, found.channels))
    edges = f"{found.num_rising:,} rising, {found.num_falling:,} falling"
    span = f"timestamps {found.first:,} … {found.last:,} µs, {found.num_outside_span:,} outside the events' span"
    return f"{found.num_triggers:,} on input {inputs}: {edges}; {span}"


def _pixels(found: Examination) -> str:
    if found.num_silent_pixels is None:
        return f"counted in cells of {found.cell} × {found.cell}"
    return f"{found.num_silent_pixels:,} silent, {len(found.hot_pixels)} hot"


def _sparkline(rates: tuple[float, ...], width: int = 60) -> str:
    if not rates or max(rates) == 0:
        return "no events"
    binned = [float(np.max(part)) for part in np.array_split(np.array(rates), min(width, len(rates)))]
    return "".join(_BARS[round(rate / max(binned) * (len(_BARS) - 1))] for rate in binned)


def _write_picture(path: Path, found: Examination) -> None:
    from etnet.export.images import write_png
    from etnet.render.examination import draw_examination

    write_png(path, draw_examination(found))

"""`etnet cut IN OUT --from S --to S`: a stretch of a recording becomes one of its own, with its frames."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated

import tyro

from etnet.cli.recording import Opening, open_with_progress, write_with_progress
from etnet.events.cut import events_between, stretch_between
from etnet.events.write import Layout


@dataclass(frozen=True)
class Cut:
    """Write the events from one time up to another, and the camera's frames among them where the format has frames.

    Seconds count from the first event. Stamps stay those of the whole recording.
    """

    source: tyro.conf.Positional[Path]
    """A recording: a file, a folder or a zip."""
    target: tyro.conf.Positional[Path]
    """The file to write; its suffix names the format as for `etnet convert-events`."""
    begin: Annotated[float, tyro.conf.arg(name="from")] = 0.0
    """Seconds since the first event; an event at this time is in."""
    end: Annotated[float | None, tyro.conf.arg(name="to")] = None
    """Seconds since the first event; an event at this time is out. Default: the end."""
    layout: Layout | None = None
    """The format, where the suffix is another one or could mean others (DSEC and MVSEC end in .h5 too)."""
    overwrite: bool = False
    """Replace the target if it is there."""
    opening: Annotated[Opening, tyro.conf.arg(name="")] = field(default_factory=Opening)


def run(config: Cut) -> int:
    """Do it; returns the exit code."""
    with open_with_progress(config.source, config.opening) as recording:
        start, stop = events_between(recording, config.begin, config.end)
        span = stretch_between(recording, config.begin, config.end)
        write_with_progress(recording, config.target, config.layout, start, stop, span=span, overwrite=config.overwrite)
    return 0

"""`etnet cut IN OUT --from S --to S`: a stretch of a recording becomes one of its own, with its frames."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Annotated

import tyro

from etnet.cli.many_files import several_in, sources_and_target, write_many
from etnet.cli.recording import Opening, open_with_progress, write_with_progress
from etnet.events.cut import events_between, stretch_between
from etnet.events.write import Layout


@dataclass(frozen=True)
class Cut:
    """Write the events from one time up to another, and the camera's frames among them where the format has frames.

    Seconds count from the first event. Stamps stay those of the whole recording. Of several recordings, or a folder of
    them, the same stretch of each is written into a folder (docs/many.md).
    """

    paths: Annotated[tyro.conf.Positional[tuple[Path, ...]], tyro.conf.arg(metavar="IN … OUT")]
    """A recording (a file, a folder or a zip) or several, and at last the file to write, whose suffix names the format
    as for `etnet convert-events`, or the folder."""
    begin: Annotated[float, tyro.conf.arg(name="from")] = 0.0
    """Seconds since the first event; an event at this time is in."""
    end: Annotated[float | None, tyro.conf.arg(name="to")] = None
    """Seconds since the first event; an event at this time is out. Default: the end."""
    layout: Layout | None = None
    """The format, where the suffix is another one or could mean others (DSEC and MVSEC end in .h5 too). Of several
    recordings event_utils by default."""
    overwrite: bool = False
    """Replace the target if it is there. Of several recordings those that are finished are left as they are; with it
    they are done again."""
    opening: Annotated[Opening, tyro.conf.arg(name="")] = field(default_factory=Opening)


def run(config: Cut) -> int:
    """Do it; returns the exit code."""
    sources, target = sources_and_target(config.paths, "etnet cut")
    found = several_in(sources, target)
    if found is None:
        _cut(config, sources[0], target, config.layout, config.overwrite)
        return 0
    layout = config.layout or "event_utils"

    def work(path: Path, out: Path, told: Callable[[float], None]) -> int:
        return _cut(config, path, out, layout, True, told)

    settings = f"{replace(config, paths=(), overwrite=False)}"
    return write_many(found, target, layout, settings, work, config.overwrite, "events")


def _cut(
    config: Cut,
    source: Path,
    target: Path,
    layout: Layout | None,
    overwrite: bool,
    told: Callable[[float], None] | None = None,
) -> int:
    """How many events were written."""
    with open_with_progress(source, config.opening) as recording:
        start, stop = events_between(recording, config.begin, config.end)
        span = stretch_between(recording, config.begin, config.end)
        return write_with_progress(recording, target, layout, start, stop, span=span, overwrite=overwrite, told=told)

"""`etnet convert-events IN OUT`: recordings of any format in another one."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Annotated

import tyro

from etnet.cli.many_files import several_in, sources_and_target, write_many
from etnet.cli.recording import Opening, open_with_progress, write_with_progress
from etnet.events.write import Layout


@dataclass(frozen=True)
class ConvertEvents:
    """Write a recording in another format, with its frames where that has frames. The file appears whole or not at all.

    The format follows from the suffix: .h5 and .hdf5 event_utils, .aedat4, .raw EVT3, .es Event Stream, .txt RPG's "t
    x y p", .csv, .npz; --layout dsec, mvsec and rpg (a folder with the pictures) must be said. What it cannot hold is
    said. Several recordings, or a folder of them, become a folder of files (docs/many.md).
    """

    paths: Annotated[tyro.conf.Positional[tuple[Path, ...]], tyro.conf.arg(metavar="IN … OUT")]
    """A recording (a file, a folder or a zip) or several, and at last the file to write, or the folder."""
    layout: Layout | None = None
    """The format, where the suffix is another one or could mean others (DSEC and MVSEC end in .h5 too). Of several
    recordings event_utils by default."""
    overwrite: bool = False
    """Replace the target if it is there. Of several recordings those that are finished are left as they are; with it
    they are done again."""
    opening: Annotated[Opening, tyro.conf.arg(name="")] = field(default_factory=Opening)


def run(config: ConvertEvents) -> int:
    """Do it; returns the exit code."""
    sources, target = sources_and_target(config.paths, "etnet convert-events")
    found = several_in(sources, target)
    if found is None:
        with open_with_progress(sources[0], config.opening) as recording:
            write_with_progress(recording, target, config.layout, overwrite=config.overwrite)
        return 0
    layout = config.layout or "event_utils"

    def work(path: Path, out: Path, told: Callable[[float], None]) -> int:
        with open_with_progress(path, config.opening) as recording:
            return write_with_progress(recording, out, layout, overwrite=True, told=told)

    settings = f"{replace(config, paths=(), overwrite=False)}"
    return write_many(found, target, layout, settings, work, config.overwrite, "events")

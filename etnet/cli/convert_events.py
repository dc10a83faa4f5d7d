"""`etnet convert-events IN OUT`: a recording of any format in another one."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated

import tyro

from etnet.cli.recording import Opening, open_with_progress, write_with_progress
from etnet.events.write import Layout


@dataclass(frozen=True)
class ConvertEvents:
    """Write a recording in another format, with its frames where that has frames. The file appears whole or not at all.

    The format follows from the suffix: .h5 and .hdf5 event_utils, .aedat4, .raw EVT3, .es Event Stream, .txt RPG's "t
    x y p", .csv, .npz; --layout dsec, mvsec and rpg (a folder with the pictures) must be said. What it cannot hold is
    said.
    """

    source: tyro.conf.Positional[Path]
    """A recording: a file, a folder or a zip."""
    target: tyro.conf.Positional[Path]
    """The file to write, or the folder."""
    layout: Layout | None = None
    """The format, where the suffix is another one or could mean others (DSEC and MVSEC end in .h5 too)."""
    overwrite: bool = False
    """Replace the target if it is there."""
    opening: Annotated[Opening, tyro.conf.arg(name="")] = field(default_factory=Opening)


def run(config: ConvertEvents) -> int:
    """Do it; returns the exit code."""
    with open_with_progress(config.source, config.opening) as recording:
        write_with_progress(recording, config.target, config.layout, overwrite=config.overwrite)
    return 0

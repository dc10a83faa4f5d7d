"""`etnet convert-events IN OUT`: a recording of any format becomes event_utils, DSEC, AEDAT4, EVT3, CSV or npz."""

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

    The format follows from the suffix: .h5 and .hdf5 event_utils, .aedat4, .raw EVT3, .csv, .npz. What it cannot hold
    is said.
    """

    source: tyro.conf.Positional[Path]
    """A recording: a file, a folder or a zip."""
    target: tyro.conf.Positional[Path]
    """The file to write."""
    layout: Layout | None = None
    """The format, where the suffix is another one or could mean two (DSEC ends in .h5 too)."""
    overwrite: bool = False
    """Replace the target if it is there."""
    opening: Annotated[Opening, tyro.conf.arg(name="")] = field(default_factory=Opening)


def run(config: ConvertEvents) -> int:
    """Do it; returns the exit code."""
    with open_with_progress(config.source, config.opening) as recording:
        write_with_progress(recording, config.target, config.layout, overwrite=config.overwrite)
    return 0

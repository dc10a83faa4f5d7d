"""Opening a recording from the command line: the same assumptions and views for every command."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

from etnet.cli.progress import fraction_callback
from etnet.events.assumptions import Assumptions
from etnet.events.open import open_recording
from etnet.events.recording import Recording
from etnet.events.view import View


@dataclass(frozen=True)
class Opening:
    """How to take a file that does not say everything itself, and which part of it."""

    assume: Assumptions = field(default_factory=Assumptions)
    view: View = field(default_factory=View)


def open_with_progress(path: Path, opening: Opening) -> Recording:
    """Open `path`, with a bar while a format without an index is decoded."""
    with fraction_callback(f"opening {path.name}") as progress:
        return open_recording(path, assume=opening.assume, view=opening.view, progress=progress)

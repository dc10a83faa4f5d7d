"""`etnet replay SESSION --check`: render a session file's frames again and hold every one against its hash."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated

import tyro

from etnet.cli.progress import console, progress_callback
from etnet.cli.recording import Opening, open_as_with_progress


@dataclass(frozen=True)
class Replay:
    """Say what a session file holds; with --check, render it headless and verify each frame to the bit."""

    session: tyro.conf.Positional[Path]
    """A file that `etnet export session` or the viewer wrote."""
    check: bool = False
    """Render again and compare; exit code 1 when a frame differs."""
    recording: Path | None = None
    """The recording; default: the file of the session's name beside it, here, or among the bundled samples."""
    model: str | None = None
    """A bundled model's name, or a weights file; default: the session's."""
    device: str = "cpu"
    opening: Annotated[Opening, tyro.conf.arg(name="")] = field(default_factory=Opening)
    """If anything of it is given, it holds instead of what the session says of how its recording was opened."""


def run(config: Replay) -> int:
    """Do it; returns the exit code."""
    from etnet.export.session_file import check_session, find_recording, read_session
    from etnet.nets.weights import load_model

    session = read_session(config.session)
    last = session.start + len(session.frames) - 1
    print(f"{session.recording}, model {session.model}, {session.policy}, windows {session.start} … {last}")
    if not config.check:
        return 0
    folders = (config.session.parent, Path())
    path = config.recording or find_recording(session, folders, "name it with --recording")
    is_given = config.opening != Opening()
    opened = config.opening.opened_as() if is_given or session.opened is None else session.opened
    with open_as_with_progress(path, opened) as recording, progress_callback("replaying") as progress:
        model = load_model(config.model or session.model, config.device)
        verdict = check_session(session, recording, model, progress)
    for difference in verdict.contract_differences:
        console.print(f"contract differs: {difference}", markup=False)
    if verdict.holds:
        print(f"all {verdict.num_frames} frames came out again, bit for bit")
        return 0
    print(f"{len(verdict.differing)} of {verdict.num_frames} frames differ, the first at window {verdict.differing[0]}")
    if not verdict.contract_differences:
        print("the contracts are equal: the code that made the session was another one")
    return 1

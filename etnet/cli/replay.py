"""`etnet replay SESSION --check`: render a session file's frames again and hold every one against its hash."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated

import tyro

from etnet.bundled import samples
from etnet.cli.progress import console, progress_callback
from etnet.cli.recording import Opening, open_with_progress
from etnet.errors import RecordingError


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


def run(config: Replay) -> int:
    """Do it; returns the exit code."""
    from etnet.export.session_file import check_session, read_session
    from etnet.nets.weights import load_model

    session = read_session(config.session)
    last = session.start + len(session.frames) - 1
    print(f"{session.recording}, model {session.model}, {session.policy}, windows {session.start} … {last}")
    if not config.check:
        return 0
    path = config.recording or _found(session.recording, config.session.parent)
    with open_with_progress(path, config.opening) as recording, progress_callback("replaying") as progress:
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


def _found(name: str, folder: Path) -> Path:
    """Only the name's last part counts: a session file may not point anywhere else."""
    name = Path(name).name
    bundled = [path for path in samples() if path.name == name]
    for path in (folder / name, Path(name), *bundled):
        if path.exists():
            return path
    raise RecordingError(
        f"{name}: the session's recording is not beside it, here, or bundled; name it with --recording"
    )

"""A folder of PNG files with a table of their stamps."""

from __future__ import annotations

from pathlib import Path

from etnet.export.frame_files import FRAME, STAMPS, frame_name
from etnet.export.images import write_png
from etnet.export.pictures import Look, draw
from etnet.export.take import IsCancelled, Progress, Take
from etnet.files import write_atomically


def write_frames(
    take: Take,
    folder: Path,
    look: Look,
    progress: Progress | None = None,
    is_cancelled: IsCancelled | None = None,
) -> int:
    """`frame_000000.png` … numbered by window, and `stamps.csv`; each file whole or not at all.

    Those of a former take go once the first new picture is drawn. The table is written last: a folder without it was
    stopped.
    """
    folder.mkdir(parents=True, exist_ok=True)
    stamps = ["frame,t_stop_us,t_start_us,num_events"]
    for moment in take.moments(progress=progress, is_cancelled=is_cancelled):
        picture = draw(moment, look, len(take.playback))
        window = moment.window
        if len(stamps) == 1:
            _make_room(folder)
        write_png(folder / frame_name(window.index), picture)
        stamps.append(f"{window.index},{window.t_stop},{window.t_start},{window.num_events}")
    write_atomically(folder / STAMPS, ("\n".join(stamps) + "\n").encode())
    return len(take)


def _make_room(folder: Path) -> None:
    """Take a former take away, its table first: what is stopped from here on never passes for finished."""
    former = [folder / STAMPS, *(path for path in folder.iterdir() if FRAME.fullmatch(path.name))]
    for path in former:
        if path.is_file() or path.is_symlink():
            path.unlink()

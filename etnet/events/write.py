"""Write a recording, or a part of it, in another format. It appears whole or not at all."""

from __future__ import annotations

from pathlib import Path
from typing import Literal, get_args

from etnet.errors import RecordingError
from etnet.events.assumptions import Progress
from etnet.events.formats.base import contained
from etnet.events.recording import Recording, Remark
from etnet.events.writers.aedat4 import write_aedat4
from etnet.events.writers.columns import FOLDER_HOLDS, write_csv, write_npz, write_rpg_folder, write_text
from etnet.events.writers.hdf5 import write_dsec, write_event_utils, write_mvsec
from etnet.events.writers.part import Part, Writer
from etnet.events.writers.streams import write_event_stream, write_evt3
from etnet.files import check_target, replace_folder, replacing, working_folder

Layout = Literal["event_utils", "dsec", "mvsec", "aedat4", "evt3", "es", "text", "rpg", "csv", "npz"]

_SUFFIXES: dict[str, Layout] = {
    ".h5": "event_utils",
    ".hdf5": "event_utils",
    ".aedat4": "aedat4",
    ".raw": "evt3",
    ".es": "es",
    ".txt": "text",
    ".csv": "csv",
    ".npz": "npz",
}
_WRITERS: dict[Layout, Writer] = {
    "event_utils": write_event_utils,
    "dsec": write_dsec,
    "mvsec": write_mvsec,
    "aedat4": write_aedat4,
    "evt3": write_evt3,
    "es": write_event_stream,
    "text": write_text,
    "rpg": write_rpg_folder,
    "csv": write_csv,
    "npz": write_npz,
}
WITHOUT_PROVENANCE: tuple[Layout, ...] = ("es", "text", "csv")
"""Layouts that have no place for how a recording was made."""


def layout_of(path: Path, layout: Layout | None = None) -> Layout:
    """The layout that a file is written in, judged by its suffix if none is given. Raises RecordingError."""
    chosen = layout or _SUFFIXES.get(path.suffix.lower())
    if chosen not in _WRITERS:
        raise RecordingError(
            f'{path.name}: no layout is known for "{path.suffix}"; name one of {", ".join(get_args(Layout))}'
        )
    return chosen


def names_layout(path: Path) -> bool:
    """Whether the suffix alone names a layout."""
    return path.suffix.lower() in _SUFFIXES


def suffix_of(layout: Layout) -> str:
    """The suffix of a file in this layout; empty for a folder."""
    others: dict[Layout, str] = {"dsec": ".h5", "mvsec": ".hdf5", "rpg": ""}
    return others.get(layout) or next((suffix for suffix, known in _SUFFIXES.items() if known == layout), "")


def check_place(path: Path, layout: Layout, overwrite: bool) -> None:
    """An error if nothing can be written there: it is there already, or is nothing that a file may replace.

    A folder may be replaced where it holds a recording in this layout and nothing else.
    """
    if layout == "rpg" and path.is_dir():
        foreign = sorted({entry.name for entry in path.iterdir()} - set(FOLDER_HOLDS))
        if foreign:
            raise RecordingError(f"{path.name}: is a folder that holds {foreign[0]}, too; choose another name")
    else:
        check_target(path)
    if path.exists() and not overwrite:
        raise RecordingError(f"{path.name}: is there already; choose another name or allow overwriting (--overwrite)")


def write_recording(
    recording: Recording,
    path: str | Path,
    layout: Layout | None = None,
    *,
    start: int = 0,
    stop: int | None = None,
    span: tuple[int, int] | None = None,
    overwrite: bool = False,
    progress: Progress | None = None,
) -> tuple[Remark, ...]:
    """Write events start … stop − 1 (all by default) with the frames among them, where the layout has frames.

    `span` (µs, both ends included) is the stretch that the events stand for, where it is longer than from the first of
    them to the last: the frames at its ends are written too. `layout` is judged by the suffix if not given. What the
    layout cannot hold is told in the remarks. Raises RecordingError if the file is there already, if the layout cannot
    hold the events, or if the disk fails; EtnetError if what is there is no regular file.
    """
    path = Path(path)
    chosen = layout_of(path, layout)
    stop = recording.num_events if stop is None else stop
    if not 0 <= start < stop <= recording.num_events:
        raise RecordingError(
            f"{recording.name}: cannot write events {start} … {stop} of {recording.num_events}; choose at least one"
        )
    check_place(path, chosen, overwrite)
    part = Part(recording, start, stop, progress or (lambda _: None), span)
    with contained(path.name, f"events into {chosen}", "write", "check the disk and the folder"):
        if chosen == "rpg":
            with working_folder(path) as made:
                remarks = _WRITERS[chosen](part, made)
                replace_folder(made, path, flushes=True)
        else:
            # The suffix stays last, for some writers go by it.
            with replacing(path, suffix=path.suffix) as unfinished:
                remarks = _WRITERS[chosen](part, unfinished)
    return remarks + _without_motion(recording)


def _without_motion(recording: Recording) -> tuple[Remark, ...]:
    if recording.inertial is None:
        return ()
    num_samples = len(recording.inertial)
    return (Remark("detected", f"{num_samples} samples of the camera's motion were not written: no layout has them"),)

"""Commands that write one file for one recording, and a folder of them for many."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

from etnet.cli.many import jobs_of, run_many, this_share
from etnet.cli.many_sources import check_apart, recordings_in
from etnet.errors import EtnetError
from etnet.events.write import Layout, names_layout, suffix_of

One = Callable[[Path, Path, Callable[[float], None]], int]
"""(recording, the file to write, told the fraction done) → how many things were written."""


def sources_and_target(paths: Sequence[Path], program: str) -> tuple[tuple[Path, ...], Path]:
    """IN … OUT, as one writes it: the last is where it goes."""
    if len(paths) < 2:
        raise EtnetError(f"{program} takes what to read and, at last, what to write; got {len(paths)} of them")
    return tuple(paths[:-1]), paths[-1]


def several_in(sources: Sequence[Path], target: Path) -> tuple[Path, ...] | None:
    """The recordings, where the target is a folder that gets a file for each of them; None: one recording, one file.

    One folder whose target names a file is left to whoever opens it: it may be one recording in several files.
    """
    if len(sources) == 1 and (not sources[0].is_dir() or (names_layout(target) and not target.is_dir())):
        return None
    check_apart(sources, target)
    found = recordings_in(sources, target)
    if len(sources) == 1 and found == tuple(sources):
        return None
    check_folder(target, len(found))
    return found


def check_folder(target: Path, num_files: int) -> None:
    """An error if the target of several files is, or names, a file."""
    if target.is_file() or (names_layout(target) and not target.is_dir()):
        raise EtnetError(f"{target}: names one file, and there are {num_files} to write; name a folder")


def write_many(
    found: Sequence[Path], target: Path, layout: Layout, settings: str, one: One, anew: bool, counts: str
) -> int:
    """A file for each, NAME/NAME.h5 in the folder `target`, shared out among the processes; 1 when any failed.

    `counts` is what the number that `one` returns is called.
    """

    def work(path: Path, folder: Path, told: Callable[[float], None]) -> int:
        return one(path, folder / f"{folder.name}{suffix_of(layout)}", told)

    return run_many(jobs_of(found, target), this_share(), settings, work, anew, counts)

"""Which recordings are named: files, folders that are one recording, and folders of recordings, looked through."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path

from etnet.cli.frames_folder import FRAMES, KALIBR, MARKER
from etnet.cli.many import CLAIM, FAILED
from etnet.errors import EtnetError

_FOLDER_SIGNS = ("events.txt", "events_ts.npy", "metadata.yaml")
_DEEPEST = 3
"""Folders down from one that is opened as a whole in which its events are found."""


def recordings_in(paths: Sequence[Path], out: Path) -> tuple[Path, ...]:
    """Every recording among files and folders, each once. A folder that is a recording, or has one beside pictures,
    counts as one; what lies in `out` was written by this command and is left out."""
    found: dict[Path, Path] = {}
    for path in paths:
        if not path.exists():
            raise EtnetError(f"{path}: there is no such file or folder")
        for each in _recordings_below(path, out.resolve()):
            found.setdefault(each.resolve(), each)
    if not found:
        raise EtnetError(
            f"{', '.join(map(str, paths))}: no recording lies there; name files, or a folder that has some"
        )
    return tuple(found.values())


def check_apart(paths: Sequence[Path], out: Path) -> None:
    """An error if a folder that is read from is the one that is written to: what was written would be read."""
    for path in paths:
        if path.is_dir() and path.resolve() == out.resolve():
            raise EtnetError(f"{path}: is read from, and what is written there would be read too; name another folder")


def _recordings_below(path: Path, out: Path) -> list[Path]:
    from etnet.events.formats.picture_lists import is_beside_events
    from etnet.events.formats.registry import FORMATS
    from etnet.events.open import is_one_recording

    if not path.is_dir() or any((path / sign).is_file() for sign in _FOLDER_SIGNS) or is_one_recording(path):
        return [path]
    suffixes = {suffix for entry in FORMATS for suffix in entry.suffixes if suffix}
    own = (FAILED,) if (path / CLAIM).is_file() else ()
    found: list[Path] = []
    for each in sorted(path.iterdir()):
        if each.name.startswith(".") or each.resolve() == out:
            continue
        if each.is_dir():
            found += _recordings_below(each, out)
        elif each.suffix.lower() in suffixes and each.name not in own and not is_beside_events(each.name):
            found.append(each)
    return [path] if len(found) == 1 and _belong_together(path, found[0], out) else found


def _belong_together(path: Path, found: Path, out: Path) -> bool:
    """Whether the one recording below a folder has its pictures there, too, and not in a folder of its own."""
    from etnet.events.formats.compressed import RECORDING_SUFFIXES

    if len(found.relative_to(path).parts) > _DEEPEST:
        return False
    is_bare = not _holds_pictures(found, out) if found.is_dir() else found.name.lower().endswith(RECORDING_SUFFIXES)
    return is_bare and _holds_pictures(path, out)


def _holds_pictures(folder: Path, out: Path) -> bool:
    """Whether there are pictures below that no command here wrote."""
    from etnet.events.formats.picture_lists import PICTURES

    for place, folders, files in os.walk(folder):
        own = (FRAMES, KALIBR) if MARKER in files else ()
        folders[:] = [
            name
            for name in folders
            if not name.startswith(".") and name not in own and (Path(place) / name).resolve() != out
        ]
        if any(name.lower().endswith(PICTURES) and not name.startswith(".") for name in files):
            return True
    return False

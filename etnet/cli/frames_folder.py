"""A folder of frames as `etnet reconstruct` writes it: nothing that somebody else put there is taken away unasked."""

from __future__ import annotations

import re
from pathlib import Path

from etnet.cli.many import DONE, note_of
from etnet.errors import EtnetError
from etnet.events.formats.picture_lists import OWN_FRAMES
from etnet.export.frame_files import FRAME, STAMPS

VIDEO, MARKER = "video.mp4", OWN_FRAMES
"""Beside the folder of the frames, in OUT. Where the marker lies, frames, stamps and video are this command's."""
SETTINGS = "Reconstruct("
"""What the settings begin with that this command notes of a finished recording; others' are not its own."""
FRAMES, KALIBR = "frames", "cam0"
_NAMES = {FRAMES: FRAME, KALIBR: re.compile(r"\d{19}\.png")}


def kalibr_name(nanoseconds: int) -> str:
    """A frame's file in `cam0`."""
    return f"{nanoseconds:019d}.png"


def check_frames(folder: Path, overwrite: bool, is_shared: bool = False) -> None:
    """An error if frames in `folder`, OUT/frames or OUT/cam0, would replace finished ones, or what others put there.

    Where many recordings are shared out, whether one is finished was decided already (`is_shared`).
    """
    out = folder.parent
    if not (overwrite or is_shared) and (out / STAMPS).exists():
        raise EtnetError(f"{out}: holds frames already; give another --out, or --overwrite")
    is_ours = (out / MARKER).is_file() or _has_own_note(out)
    foreign = [] if overwrite or is_ours else _former(folder)
    if foreign:
        more = f" and {len(foreign) - 1} more" if len(foreign) > 1 else ""
        raise EtnetError(
            f"{foreign[0]}{more}: not known to be of this command; give another --out, or --overwrite to replace it"
        )


def make_room(folder: Path, overwrite: bool) -> None:
    """Take away what an earlier call wrote there, so that no frame of it stands among the new ones."""
    check_frames(folder, overwrite, is_shared=True)
    out = folder.parent
    folder.mkdir(parents=True, exist_ok=True)
    # First, so that what is stopped from here on is begun again, and never passes for what was finished.
    (out / MARKER).touch()  # an empty file, for which a full disk has room, too
    if _has_own_note(out):
        (out / DONE).unlink()
    for path in _former(folder):
        path.unlink()


def _has_own_note(out: Path) -> bool:
    return str(note_of(out).get("settings")).startswith(SETTINGS)


def _former(folder: Path) -> list[Path]:
    """What would have to go."""
    beside = [folder.parent / name for name in (STAMPS, VIDEO)]
    inside = sorted(folder.iterdir()) if folder.is_dir() else []
    found = [*beside, *(path for path in inside if _NAMES[folder.name].fullmatch(path.name))]
    return [path for path in found if path.is_file() or path.is_symlink()]

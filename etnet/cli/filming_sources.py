"""Which sources `--video` names: files, patterns, folders of pictures, and folders of videos, looked through."""

from __future__ import annotations

from pathlib import Path

from etnet.cli.filming import Filming
from etnet.errors import EtnetError
from etnet.simulation.picture_file import SUFFIXES

VIDEO_SUFFIXES = (".mp4", ".mov", ".avi", ".mkv", ".webm", ".m4v", ".mpg", ".mpeg", ".ts", ".wmv", ".gif")


def sources_in(filming: Filming, out: Path) -> tuple[Path, ...]:
    """Each source once. A folder of pictures is one; of any other the videos in it and below, or with --motion the
    photos. One without either is left as it is, for whoever reads it says what it lacks. What lies in `out` was
    written by this command and is left out."""
    found: dict[Path, Path] = {}
    for path in filming.video:
        below = _below(path, out.resolve(), filming.motion is not None) if path.is_dir() else [path]
        for each in below or [path]:
            found.setdefault(each.resolve(), each)
    return tuple(found.values())


def _below(folder: Path, out: Path, are_photos: bool) -> list[Path]:
    inside = [each for each in sorted(folder.iterdir()) if not each.name.startswith(".") and each.resolve() != out]
    files = [each for each in inside if each.is_file()]
    pictures = [each for each in files if each.suffix.lower() in SUFFIXES]
    videos = [each for each in files if each.suffix.lower() in VIDEO_SUFFIXES]
    if not are_photos and len(pictures) > 1 and videos:
        raise EtnetError(
            f"{folder}: holds {len(pictures)} pictures and {len(videos)} videos; name the videos, or a pattern of the "
            f"pictures such as {folder.name}/*{pictures[0].suffix}"
        )
    if not are_photos and (len(pictures) > 1 or (not videos and _holds_pictures(folder / "images"))):
        return [folder]
    found = list(pictures if are_photos else videos)
    for each in inside:
        if each.is_dir():
            found += _below(each, out, are_photos)
    return found


def _holds_pictures(folder: Path) -> bool:
    return folder.is_dir() and any(each.suffix.lower() in SUFFIXES for each in folder.iterdir())

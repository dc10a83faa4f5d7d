"""A folder with one recording among other files (labels, calibrations, poses, pictures) opens as that recording."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import ExitStack, suppress
from dataclasses import replace

from etnet.errors import RecordingError
from etnet.events.formats.archive import FolderStore, ZipStore
from etnet.events.formats.base import HEAD_BYTES, Format, Opened, Remarks, Request, contained
from etnet.events.formats.column_finder import rank_of
from etnet.events.formats.compressed import RECORDING_SUFFIXES, SURE_SUFFIXES
from etnet.events.formats.foreign import listed
from etnet.events.formats.frames import attached, found_frames
from etnet.events.formats.picture_lists import pictures_beside
from etnet.events.recording import Remark

MOST_LOOKED_INTO = 200
"""Files of a folder that are looked into for events."""


def folder_formats(formats: tuple[Format, ...], is_text_folder: Callable[[Request], bool]) -> tuple[Format, Format]:
    """A folder of texts with further recordings, which is asked before that of texts alone, and any other folder.

    `formats` are those of single files; the first that knows a file and finds events in it opens it.
    """

    def fitting(request: Request) -> Format | None:
        with contained(request.name, "its beginning"):
            known = [entry for entry in formats if entry.recognises(request)]
            known = [entry for entry in known if entry.is_known_by_content] or known
            chosen = next((entry for entry in known if request.suffix in entry.suffixes), known[0] if known else None)
            return chosen if chosen is not None and chosen.holds_events(request) else None

    def recordings_in(request: Request) -> list[str]:
        members = [name for name in request.members if name.lower().endswith(RECORDING_SUFFIXES)]
        if len(members) > MOST_LOOKED_INTO:
            raise RecordingError(
                f"{request.name}: a folder with {len(members):,} files that may be recordings, such as "
                f"{listed(members[:3])}; name one of them"
            )
        found = []
        for member in members:
            with ExitStack() as briefly, suppress(RecordingError):
                if fitting(_inner(request, member, briefly)) is not None:
                    found.append(member)
        return found

    def open_folder(request: Request) -> Opened:
        found = recordings_in(request)
        if not found:
            there = f"a folder with {listed(request.members)}" if request.members else "an empty folder"
            raise RecordingError(f"{request.name}: {there}; no recording is among that")
        left = [member for member in found if not rank_of(member)[2]]
        if len(found) > 1 and len(left) != 1:
            raise RecordingError(f"{request.name}: a folder that holds {listed(found)}; name one of them")
        chosen = left[0] if left else found[0]
        said = [Remark("detected", f"the recording is {chosen}, in this folder")]
        if len(found) > 1:
            others = [member for member in found if member != chosen]
            said.append(Remark("detected", f"of another camera, and not shown: {listed(others)}"))
        inner = _inner(request, chosen, request.resources)
        entry = fitting(inner)
        assert entry is not None
        opened = entry.open(inner)
        return _with_pictures(replace(opened, remarks=(*said, *opened.remarks)), request)

    def is_mixed(request: Request) -> bool:
        if not request.path.is_dir() or not any(name.lower().endswith(SURE_SUFFIXES) for name in request.members):
            return False
        return is_text_folder(request) and len(recordings_in(request)) > 1

    return (
        Format("folder with several recordings", ("",), is_mixed, open_folder),
        Format("folder with one recording", ("",), lambda request: request.path.is_dir(), open_folder),
    )


def _inner(request: Request, member: str, resources: ExitStack) -> Request:
    path = FolderStore(request.path).local_path(member)
    with path.open("rb") as file:
        head = file.read(HEAD_BYTES)
    members: tuple[str, ...] = ()
    if head[:4] == b"PK\x03\x04":
        with ExitStack() as briefly:
            members = ZipStore(path, briefly).names()
    return replace(request, path=path, name=f"{request.name}/{member}", head=head, members=members, resources=resources)


def _with_pictures(opened: Opened, request: Request) -> Opened:
    """The pictures in the folder, where the recording has none of its own."""
    if opened.ground_truth is not None:
        return opened
    remarks, name, most = Remarks(list(opened.remarks)), request.name, request.assume.max_pixels
    store = FolderStore(request.path)
    frames = found_frames(lambda: pictures_beside(store, "", name, remarks, most), name, remarks)
    truth = attached(frames, opened.span, request.assume.time_unit, name, remarks)
    return replace(opened, ground_truth=truth, remarks=tuple(remarks.kept))

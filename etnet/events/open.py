"""Open any recording: find out what the file is by its content, then let that format's reader read it."""

from __future__ import annotations

import stat
from contextlib import ExitStack
from dataclasses import dataclass, replace
from pathlib import Path

from etnet.errors import RecordingError
from etnet.events.assumptions import NOTHING_ASSUMED, Assumptions, Progress, said_unit
from etnet.events.cache import Scratch
from etnet.events.events import Events
from etnet.events.formats.archive import FolderStore, ZipStore, is_litter
from etnet.events.formats.arrays.npy import folder_prefixes
from etnet.events.formats.base import HEAD_BYTES, Opened, Request, contained
from etnet.events.formats.chunks import are_pieces
from etnet.events.formats.registry import FORMATS, choose
from etnet.events.opened_as import WHOLE_VIEW, OpenedAs, View
from etnet.events.recording import Bracketing, EventSource, Recording, Remark
from etnet.events.sense import advice_on
from etnet.events.view import seen_through

__all__ = ["Assumptions", "View", "check_recording", "is_one_recording", "open_recording"]

_ZIP = b"PK\x03\x04"


@dataclass(frozen=True)
class _OwningSource:
    """A source that closes the files and removes the scratch folder it was read from."""

    inner: EventSource
    resources: ExitStack

    @property
    def num_events(self) -> int:
        return self.inner.num_events

    def read(self, start: int, stop: int) -> Events:
        return self.inner.read(start, stop)

    def bracket(self, t: int) -> tuple[int, int] | None:
        return self.inner.bracket(t) if isinstance(self.inner, Bracketing) else None

    def close(self) -> None:
        self.inner.close()
        self.resources.close()


class _Told:
    """Passes on how far the opening is, until it has ended: a source may keep what it was opened with, and would keep
    its visitor with it."""

    def __init__(self, progress: Progress | None) -> None:
        self._progress = progress

    def __call__(self, share: float) -> None:
        if self._progress is not None:
            self._progress(share)

    def end(self) -> None:
        """Nobody is told any more."""
        self._progress = None


def open_recording(
    path: str | Path,
    *,
    assume: Assumptions = NOTHING_ASSUMED,
    view: View = WHOLE_VIEW,
    progress: Progress | None = None,
    patience: float | None = None,
) -> Recording:
    """Open a file, folder or zip of any format in the table.

    What was detected, repaired or assumed stands in `recording.remarks`. `progress` is told the fraction done while a
    format with no index is decoded. A large RAW file is gone through once to make its time index, which is kept: with
    `patience` (seconds) the part that was reached by then is given, a remark says so, and the rest is indexed in the
    background for the next opening. Raises RecordingError, which names the file, the place and the remedy.
    """
    path = Path(path)
    told = _Told(progress)
    with ExitStack() as resources:
        scratch = Scratch(path.name)
        resources.callback(scratch.close)
        request = replace(_request(path, assume, told, resources, scratch), patience=patience)
        chosen = choose(request, FORMATS)
        with contained(request.name, chosen.name):
            found = chosen.open(request)
            advice = _advice(found)
            opened = seen_through(view, found, request)
        told(1.0)  # who stops it now still has everything closed
        kept = resources.pop_all()
    told.end()
    return Recording(
        name=path.stem or path.name,
        format=opened.format,
        source=_OwningSource(opened.source, kept),
        sensor=opened.sensor,
        span=opened.span,
        remarks=_made(opened) + opened.remarks + _stated_polarity(assume) + _unused_unit(assume, opened) + advice,
        ground_truth=opened.ground_truth,
        path=path,
        inertial=opened.inertial,
        triggers=opened.triggers,
        provenance=opened.provenance,
        opened_as=OpenedAs(assume, view),
        growth=opened.growth,
    )


def check_recording(path: Path) -> None:
    """Raise RecordingError where no reader takes what lies at `path`; its first bytes are looked at, no event."""
    with ExitStack() as resources:
        scratch = Scratch(path.name)
        resources.callback(scratch.close)
        choose(_request(path, NOTHING_ASSUMED, lambda _: None, resources, scratch), FORMATS)


def is_one_recording(folder: Path) -> bool:
    """Whether the files that lie in a folder itself, not those below, are one recording: its columns as npy files, or
    numbered pieces of which the second goes on where the first one ends."""
    members = tuple(sorted(each.name for each in folder.iterdir() if each.is_file() and not is_litter(each.name)))
    if "" in folder_prefixes(members):
        return True
    with ExitStack() as resources:
        scratch = Scratch(folder.name)
        resources.callback(scratch.close)
        return are_pieces(
            Request(folder, folder.name, b"", members, NOTHING_ASSUMED, lambda _: None, resources, scratch)
        )


def _advice(found: Opened) -> tuple[Remark, ...]:
    """What makes no sense; where a reader told of the unit already, that is not said twice."""
    told = any(remark.kind == "advice" and "--time-unit" in remark.text for remark in found.remarks)
    advice = advice_on(found.source, found.sensor, found.span, found.ground_truth)
    return tuple(remark for remark in advice if not (told and "--time-unit" in remark.text))


def _made(opened: Opened) -> tuple[Remark, ...]:
    sentences = () if opened.provenance is None else opened.provenance.sentences
    return tuple(Remark("detected", sentence) for sentence in sentences)


def _stated_polarity(assume: Assumptions) -> tuple[Remark, ...]:
    said = {"inverted": "ON and OFF are swapped, as stated", "positive": "every polarity above 0 is ON, as stated"}
    return (Remark("assumed", said[assume.polarity]),) if assume.polarity in said else ()


def _unused_unit(assume: Assumptions, opened: Opened) -> tuple[Remark, ...]:
    unit = assume.time_unit
    if unit is None or any(remark.text == said_unit(unit) for remark in opened.remarks):
        return ()
    text = f"the stated unit, {unit}, is not used: the time unit is settled by the format, {opened.format}"
    return (Remark("detected", text),)


def _request(path: Path, assume: Assumptions, progress: Progress, resources: ExitStack, scratch: Scratch) -> Request:
    name = path.name or str(path)
    try:
        mode = path.stat().st_mode
        if stat.S_ISDIR(mode):
            return Request(path, name, b"", FolderStore(path).names(), assume, progress, resources, scratch)
        if not stat.S_ISREG(mode):
            raise RecordingError(f"{name}: neither a file nor a folder; give the path of a recording")
        with path.open("rb") as file:
            head = file.read(HEAD_BYTES)
    except FileNotFoundError as slip:
        raise RecordingError(f"{path}: there is no such file or folder") from slip
    except (OSError, ValueError) as slip:
        raise RecordingError(f"{name}: cannot be opened ({slip})") from slip
    if not head:
        raise RecordingError(f"{name}: an empty file; there is nothing to open")
    members: tuple[str, ...] = ()
    if head[:4] == _ZIP:
        with ExitStack() as briefly:
            members = ZipStore(path, briefly).names()
    return Request(path, name, head, members, assume, progress, resources, scratch)

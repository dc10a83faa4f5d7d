"""One recording of the list: its name, its id, and what may be said of it on a page."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Literal, Protocol

from app.catalogue.folder import size_of
from app.catalogue.models import digest
from app.config import ViewerConfig
from etnet.bundled import samples
from etnet.errors import EtnetError, RecordingError
from etnet.events.assumptions import NOTHING_ASSUMED
from etnet.events.opened_as import WHOLE_VIEW
from etnet.events.recording import Recording
from etnet.events.samples import SAMPLES, RemoteSample, cache_folder, cached
from etnet.files import in_megabytes, printable
from etnet.without_paths import without_paths

Kind = Literal["bundled", "data", "file", "on demand", "upload", "live", "recorded", "mirror"]


class Unpacking(Protocol):
    """The account of what is made of one visitor's files: unpacked, indexed, simulated."""

    @property
    def left_unpacked(self) -> int:
        """Bytes that it may still have; below 0 where it has more."""
        ...

    def check_unpacked(self, name: str, size: int = 0) -> None:
        """An error about the file `name` where `size` bytes more have no room."""
        ...


@dataclass(frozen=True, slots=True)
class Entry:
    """One recording that can be opened."""

    id: str
    title: str
    kind: Kind
    subtitle: str
    path: Path = field(repr=False)
    terms: str = ""
    """What a visitor has to know before opening it; empty where there is nothing."""
    remote: RemoteSample | None = field(default=None, repr=False)
    """What has to be fetched first, for "on demand"."""
    unpacking: Unpacking | None = field(default=None, repr=False, compare=False)
    """Where it counts what is made of it, for a visitor's file."""


def under_its_name(error: EtnetError, entry: Entry) -> EtnetError:
    """The same error without a folder of this machine; of a visitor's file, by the name they gave it."""
    plain = without_paths(str(error))
    plain = printable(_named(plain, entry) if entry.kind == "upload" else plain)
    return error if plain == str(error) else RecordingError(plain)


def called_by_its_name(recording: Recording, entry: Entry) -> Recording:
    """The same recording; a visitor's file has the name they gave it, in what was noticed, too."""
    if entry.kind != "upload":
        name = printable(recording.name)
        remarks = tuple(replace(remark, text=printable(remark.text)) for remark in recording.remarks)
        is_plain = name == recording.name and remarks == recording.remarks
        return recording if is_plain else replace(recording, name=name, remarks=remarks)
    remarks = tuple(replace(remark, text=_named(remark.text, entry)) for remark in recording.remarks)
    path = entry.path.parent / entry.title  # by which a session file names it; it is open already
    return replace(recording, name=Path(entry.title).stem, remarks=remarks, path=path)


def _named(text: str, entry: Entry) -> str:
    for ours in (str(entry.path), entry.path.name, entry.path.stem):
        text = text.replace(ours, entry.title)
    return text


def listed(config: ViewerConfig, offered: Mapping[Path, int]) -> Iterator[Entry]:
    """All that a viewer offers before anybody hands anything over; `offered`: see `Watch`."""
    mark, named = opening_mark(config, is_named=False), opening_mark(config, is_named=True)
    if config.file is not None:
        yield _entry(config.file, "file", size_of(config.file), named)
    for path in samples():
        yield _entry(path, "bundled", "simulated, with the frames of an ideal camera", mark)
    if config.data is not None:
        for path, turn in offered.items():
            folder = path.parent.relative_to(config.data)
            where = "" if folder == Path() else f"{printable(folder)} · "
            yield _entry(path, "data", f"{where}{size_of(path)}", named, turn)
    if not config.demo:
        for sample in SAMPLES.values():
            yield _on_demand(sample, mark)


def opening_mark(config: ViewerConfig, is_named: bool) -> str:
    """Part of every id where the command line says how files are opened: two viewers of one process share what is
    drawn of a recording, and a link names pixels of what its viewer showed."""
    view = config.view(config.downsample or 1)
    stated = config.stated.assumptions() if is_named else NOTHING_ASSUMED
    if (view, stated, config.downsample) == (WHOLE_VIEW, NOTHING_ASSUMED, None):
        return ""
    return f"-{hashlib.sha256(repr((view, stated, config.downsample)).encode()).hexdigest()[:6]}"


def _entry(path: Path, kind: Kind, subtitle: str, mark: str, turn: int = 0) -> Entry:
    name = printable(path.stem if kind == "bundled" else path.name or str(path))
    # A bundled recording has the same name everywhere, so that a link to a moment of it works everywhere.
    entry_id = f"bundled-{name}{mark}" if kind == "bundled" else f"{kind}-{digest(path)}{mark}"
    if turn:
        entry_id = f"{entry_id}-{turn}"  # another file by the name of a former one
    return Entry(entry_id, name, kind, subtitle, path)


def _on_demand(sample: RemoteSample, mark: str) -> Entry:
    is_here = cached(sample) is not None
    subtitle = "real, fetched before" if is_here else f"real, fetched once: {in_megabytes(sample.num_bytes)}"
    path = cache_folder() / sample.name
    return Entry(f"sample-{sample.name}{mark}", sample.name, "on demand", subtitle, path, sample.terms, sample)

"""Recordings in a wrapping: gz, bz2 or xz, and a zip archive that holds one recording. Unpacked once into scratch."""

from __future__ import annotations

import bz2
import gzip
import lzma
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from io import BufferedIOBase
from pathlib import Path

from etnet.errors import RecordingError
from etnet.events.formats.archive import ZipStore
from etnet.events.formats.base import HEAD_BYTES, Format, Opened, Request, contained
from etnet.events.formats.bounds import Unpacked
from etnet.events.formats.foreign import called, listed
from etnet.events.recording import Remark

SURE_SUFFIXES = (
    ".raw",
    ".dat",
    ".aedat4",
    ".aedat",
    ".es",
    ".h5",
    ".hdf5",
    ".hdf",
    ".bag",
    ".mcap",
    ".db3",
    ".bin",
    ".mat",
)
RECORDING_SUFFIXES = (*SURE_SUFFIXES, ".npz", ".npy", ".txt", ".csv")
"""Of files that may be recordings; those at the end may be many other things as well."""

_STEP = 1 << 20
_MARKS = ((b"\x1f\x8b", "gzip"), (b"\xfd7zXZ\x00", "xz"), (b"BZh", "bzip2"))
_PACKED = (".zip", ".tar", ".gz", ".tgz", ".7z", ".rar", ".bz2", ".xz")

OpenInner = Callable[[Request], Opened]


def _compression(head: bytes) -> str | None:
    return next((what for mark, what in _MARKS if head.startswith(mark)), None)


@contextmanager
def _opened(path: Path, what: str) -> Iterator[BufferedIOBase]:
    stream = {"gzip": gzip.GzipFile, "xz": lzma.LZMAFile, "bzip2": bz2.BZ2File}[what](path, "rb")
    with stream:
        yield stream


def _unpack(request: Request, stream: BufferedIOBase, packed_bytes: int, name: str, what: str) -> Request:
    """Copy a stream to scratch; one that grows like a bomb is given up."""
    path = request.scratch.path(name)
    unpacked = Unpacked(packed_bytes, f"{request.name}, {what}")
    with path.open("wb") as file:
        while True:
            with contained(request.name, f"the {what} stream after {unpacked.num_bytes} bytes"):
                block = stream.read(_STEP)
            if not block:
                break
            unpacked.take(len(block))
            request.scratch.path(name, len(block))
            file.write(block)
            request.progress(min(0.5, 0.5 * unpacked.num_bytes / (4 * max(1, packed_bytes))))
    if unpacked.num_bytes == 0:
        raise RecordingError(f"{request.name}: unpacked it is empty; there is nothing to open")
    with path.open("rb") as file:
        head = file.read(HEAD_BYTES)
    inside = called(head)
    members: tuple[str, ...] = ()
    if head[:4] == b"PK\x03\x04":
        members = ZipStore(path, request.resources).names()
        is_npz = all(member.endswith(".npy") for member in members)
        inside = inside if is_npz else "zip"
    inside = inside or _compression(head)
    if inside is not None:
        raise RecordingError(
            f"{request.name}: an archive within an archive ({inside} in {what}); unpack it and open what is in it"
        )
    return replace(request, path=path, head=head, members=members)


def _said(opened: Opened, what: str) -> Opened:
    remark = Remark("detected", f"unpacked from {what}")
    return replace(opened, format=f"{opened.format} in {what}", remarks=(remark, *opened.remarks))


def packed_formats(open_inner: OpenInner) -> tuple[Format, ...]:
    """The wrappings; `open_inner` opens what is inside."""

    def open_compressed(request: Request) -> Opened:
        what = _compression(request.head) or ""
        with _opened(request.path, what) as stream:
            size = request.path.stat().st_size
            inner = _unpack(request, stream, size, request.path.stem or "unpacked", what)
        return _said(open_inner(inner), what)

    def open_zip(request: Request) -> Opened:
        store = ZipStore(request.path, request.resources)
        member = _single(request.members, request.name)
        with contained(request.name, f"{member} in the zip"), store.open(member) as stream:
            inner = _unpack(request, stream, request.path.stat().st_size, member.rsplit("/", 1)[-1], "zip")
        return _said(open_inner(inner), "zip")

    return (
        Format(
            "gz, bz2, xz",
            (".gz", ".bz2", ".xz"),
            lambda r: _compression(r.head) is not None,
            open_compressed,
        ),
        Format("zip", (".zip",), lambda r: r.head[:4] in (b"PK\x03\x04", b"PK\x05\x06"), open_zip),
    )


def _single(members: tuple[str, ...], name: str) -> str:
    """The one recording in an archive; an error that says what is in it if there are more or none."""
    for suffixes in (SURE_SUFFIXES, RECORDING_SUFFIXES):
        fitting = [member for member in members if member.lower().endswith(suffixes)]
        if len(fitting) == 1:
            return fitting[0]
        if fitting:
            raise RecordingError(f"{name}: holds {listed(fitting)}; unpack it and open one of them")
    if "[Content_Types].xml" in members:
        raise RecordingError(f"{name}: a document of Excel or Word; save its table as CSV in UTF-8")
    packed = [member for member in members if member.lower().endswith(_PACKED)]
    if packed:
        raise RecordingError(
            f"{name}: an archive within an archive ({listed(packed)}); unpack it and open what is in it"
        )
    raise RecordingError(f"{name}: a zip with {listed(members) or 'nothing in it'}; no recording is among that")

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
from etnet.events.formats.archive import FREE_SIZE, MAX_RATIO, ZipStore
from etnet.events.formats.base import HEAD_BYTES, Format, Opened, Request, contained
from etnet.events.recording import Remark

_STEP = 1 << 20
_MARKS = ((b"\x1f\x8b", "gzip"), (b"\xfd7zXZ\x00", "xz"), (b"BZh", "bzip2"))
_INNER_SUFFIXES = (".raw", ".dat", ".aedat4", ".aedat", ".es", ".h5", ".hdf5", ".bag", ".mcap", ".db3", ".bin", ".mat")

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
    limit = max(FREE_SIZE, MAX_RATIO * packed_bytes)
    path = request.scratch.path(name)
    written = 0
    with path.open("wb") as file:
        while True:
            with contained(request.name, f"the {what} stream after {written} bytes"):
                block = stream.read(_STEP)
            if not block:
                break
            written += len(block)
            if written > limit:
                raise RecordingError(
                    f"{request.name}: {packed_bytes} bytes of {what} grow beyond {limit}, like a bomb; "
                    "unpack it by hand if you trust it"
                )
            request.scratch.path(name, len(block))
            file.write(block)
            request.progress(min(0.5, 0.5 * written / (4 * max(1, packed_bytes))))
    if written == 0:
        raise RecordingError(f"{request.name}: unpacked it is empty; there is nothing to open")
    with path.open("rb") as file:
        head = file.read(HEAD_BYTES)
    if _compression(head) is not None or head[:4] == b"PK\x03\x04":
        raise RecordingError(f"{request.name}: an archive within an archive; unpack it once by hand")
    return replace(request, path=path, head=head, members=())


def _said(opened: Opened, request: Request, what: str) -> Opened:
    remark = Remark("detected", f"unpacked from {what}")
    return replace(opened, format=f"{opened.format} in {what}", remarks=(remark, *opened.remarks))


def packed_formats(open_inner: OpenInner) -> tuple[Format, ...]:
    """The wrappings; `open_inner` opens what is inside."""

    def open_compressed(request: Request) -> Opened:
        what = _compression(request.head) or ""
        with _opened(request.path, what) as stream:
            size = request.path.stat().st_size
            inner = _unpack(request, stream, size, request.path.stem or "unpacked", what)
        return _said(open_inner(inner), request, what)

    def open_zip(request: Request) -> Opened:
        store = ZipStore(request.path, request.resources)
        member = _single(request.members)
        with contained(request.name, f"{member} in the zip"), store.open(member) as stream:
            inner = _unpack(request, stream, request.path.stat().st_size, member.rsplit("/", 1)[-1], "zip")
        return _said(open_inner(inner), request, "zip")

    return (
        Format(
            "gz, bz2, xz",
            (".gz", ".bz2", ".xz"),
            lambda r: _compression(r.head) is not None,
            open_compressed,
        ),
        Format("zip", (".zip",), lambda r: r.head[:4] == b"PK\x03\x04" and bool(_single(r.members)), open_zip),
    )


def _single(members: tuple[str, ...]) -> str:
    """The one recording in an archive, or nothing."""
    fitting = [name for name in members if name.lower().endswith(_INNER_SUFFIXES)]
    return fitting[0] if len(fitting) == 1 else ""

"""What a file is that is no recording, by its first bytes, so that the refusal can say what to do with it."""

from __future__ import annotations

from collections.abc import Sequence

_ARCHIVES = (
    (b"7z\xbc\xaf\x27\x1c", "7z"),
    (b"Rar!\x1a\x07", "rar"),
    (b"\x28\xb5\x2f\xfd", "zstd"),
    (b"\x04\x22\x4d\x18", "lz4"),
)
_OTHERS = (
    (b"\xff\xfe", "text in UTF-16, as Excel saves it; save it as CSV in UTF-8"),
    (b"\xfe\xff", "text in UTF-16, as Excel saves it; save it as CSV in UTF-8"),
    (b"version https://git-lfs", "a pointer of Git LFS, not the file itself; fetch it with git lfs pull"),
    (b"<!DOCTYPE", "a web page, not a recording; the download may have asked for a login"),
    (b"<html", "a web page, not a recording; the download may have asked for a login"),
    (b"\x89PNG", "a picture; open the folder or the file that has the events"),
    (b"\xff\xd8\xff", "a picture; open the folder or the file that has the events"),
    (b"RIFF", "a video or picture; etnet simulate makes events of a video"),
    (b"\x1a\x45\xdf\xa3", "a video; etnet simulate makes events of it"),
    (b"%PDF", "a PDF document, not a recording"),
)
_TAR_MARK = slice(257, 262)
_MOST_LISTED = 8


def called(head: bytes) -> str | None:
    """The name of the archive that a file is, of those that are not opened; None if it is none of them."""
    if head[_TAR_MARK] == b"ustar":
        return "tar"
    return next((name for mark, name in _ARCHIVES if head.startswith(mark)), None)


def what_else(head: bytes) -> str | None:
    """What a file is and what to do with it; None if nobody knows."""
    archive = called(head)
    if archive is not None:
        return f"{'an' if archive.startswith('l') else 'a'} {archive} archive, which is not opened; unpack it first"
    if head[4:8] == b"ftyp":
        return "a video; etnet simulate makes events of it"
    if not head.strip(b"\0"):
        return "nothing but zeros; the copy or download broke off"
    return next((said for mark, said in _OTHERS if head.startswith(mark)), None)


def listed(names: Sequence[str]) -> str:
    """Some names of a list, and how many more there are."""
    more = len(names) - _MOST_LISTED
    return ", ".join(names[:_MOST_LISTED]) + (f" and {more} more" if more > 0 else "")

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
    (b"<?xml", "a document in XML, not a recording"),
    (b"\x89PNG", "a picture; open the folder or the file that has the events"),
    (b"\xff\xd8\xff", "a picture; open the folder or the file that has the events"),
    (b"RIFF", "a video or picture; etnet simulate makes events of a video"),
    (b"\x1a\x45\xdf\xa3", "a video; etnet simulate makes events of it"),
    (b"%PDF", "a PDF document, not a recording"),
    (b"PAR1", "a table in Parquet, which is not read; save it as CSV or npz"),
    (b"ARROW1", "a table in Arrow or Feather, which is not read; save it as CSV or npz"),
    (b"FEA1", "a table in Feather, which is not read; save it as CSV or npz"),
    (b"\x1f\x9d", "a file packed with compress, which is not opened; unpack it first"),
)
_TAR_MARK = slice(257, 262)
_MOST_LISTED = 8


def called(head: bytes) -> str | None:
    """The name of the archive that a file is, of those that are not opened; None if it is none of them."""
    if head[_TAR_MARK] == b"ustar" or _is_old_tar(head):
        return "tar"
    return next((name for mark, name in _ARCHIVES if head.startswith(mark)), None)


def _is_old_tar(head: bytes) -> bool:
    """Before "ustar" a tar archive is known by the sum of its first block alone."""
    stated = head[148:156].strip(b" \0")
    if len(head) < 512 or not stated or stated.strip(b"01234567"):
        return False
    return int(stated, 8) == sum(head[:148]) + 8 * ord(" ") + sum(head[156:512])


def what_else(head: bytes) -> str | None:
    """What a file is and what to do with it; None if nobody knows."""
    archive = called(head)
    if archive is not None:
        return f"{'an' if archive.startswith('l') else 'a'} {archive} archive, which is not opened; unpack it first"
    if head.lstrip().lower().startswith((b"<!doctype", b"<html")):
        return "a web page, not a recording; the download may have asked for a login"
    if head[:1] == b"\x80" and head[1:2] in (b"\x02", b"\x03", b"\x04", b"\x05"):
        return (
            "a pickle, which is not loaded, for it could run any code; save the columns as plain arrays: "
            "np.savez(file, x=…, y=…, t=…, p=…)"
        )
    if head[4:8] == b"ftyp":
        return "a video; etnet simulate makes events of it"
    if not head.strip(b"\0"):
        return "nothing but zeros; the copy or download broke off"
    return next((said for mark, said in _OTHERS if head.startswith(mark)), None) or _text(head)


def _text(head: bytes) -> str | None:
    """What is wrong with a text that has no rows of events; None of anything else."""
    some = head[:512]
    if len(some) >= 32 and any(not any(some[start::2]) and all(some[1 - start :: 2]) for start in (0, 1)):
        return "text in UTF-16, as Excel saves it; save it as CSV in UTF-8"
    if any(byte < 32 and byte not in b"\t\n\r\f" for byte in some):
        return None
    lines = [line.strip() for line in some.decode("utf-8", "replace").splitlines() if line.strip()]
    if not lines or "\ufffd" in lines[0]:
        return None
    if lines[0].startswith(("{", "[")):
        return "text in JSON, which is not read; save the events as CSV or npz"
    return (
        f'text that begins with "{lines[0][:60]}"; wanted rows of numbers "t x y p", or before them a line that names '
        "the columns, divided by blanks, commas, semicolons or tabs"
    )


def listed(names: Sequence[str]) -> str:
    """Some names of a list, and how many more there are."""
    more = len(names) - _MOST_LISTED
    return ", ".join(names[:_MOST_LISTED]) + (f" and {more} more" if more > 0 else "")

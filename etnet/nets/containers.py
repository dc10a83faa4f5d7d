"""What kind of file a checkpoint is, told by its content: what torch can write, and what is mistaken for it."""

from __future__ import annotations

import tarfile
import zipfile
from enum import Enum, auto
from pathlib import Path

_MAGIC = (0x1950A86A20F9469CFC6C).to_bytes(10, "little")
_LEGACY_START = 32
"""Bytes within which the magic number of a checkpoint stands, in any pickle protocol that holds it as a long."""


class Container(Enum):
    """How a checkpoint is packed."""

    ZIP = auto()
    """torch ≥ 1.6: a zip with `data.pkl` and the storages."""
    PICKLES = auto()
    """torch < 1.6: pickles one after the other, then the storages."""
    OTHER = auto()


def container_of(path: Path) -> tuple[Container, str]:
    """The container, and for `OTHER` what the file is and what to do, in one line without its name."""
    if not path.is_file():
        return Container.OTHER, "is no regular file; name a checkpoint (.pth, .pth.tar)"
    with open(path, "rb") as file:
        start = file.read(512)
    if start.startswith(b"PK\x03\x04"):
        return _of_zip(path)
    if start[:1] == b"\x80" and _MAGIC in start[:_LEGACY_START]:
        return Container.PICKLES, ""
    return Container.OTHER, _of_other(path, start)


def _of_zip(path: Path) -> tuple[Container, str]:
    try:
        with zipfile.ZipFile(path) as archive:
            names = archive.namelist()
    except (zipfile.BadZipFile, OSError, ValueError, NotImplementedError) as error:
        return Container.OTHER, f"is a damaged zip ({str(error)[:100]}); get it again"
    inner = {name.partition("/")[2] for name in names}
    if "constants.pkl" in inner or any(name.startswith("code/") for name in inner):
        return Container.OTHER, (
            "is a TorchScript archive, which is a program; save its state_dict() with torch.save and convert that"
        )
    if ".data/extern_modules" in inner:
        return Container.OTHER, "is a torch.package archive, which is a program; save its state_dict() and convert that"
    if "data.pkl" in inner:
        return Container.ZIP, ""
    if any(
        name.endswith(("archive_format", "serialized_exported_program.json")) or "models/" in name for name in inner
    ):
        return Container.OTHER, "is an exported program (.pt2); save its state_dict() with torch.save and convert that"
    return Container.OTHER, "is a zip without data.pkl, so not one of torch; name a checkpoint (.pth, .pth.tar)"


def _of_other(path: Path, start: bytes) -> str:
    if not start:
        return "is empty; get it again"
    if start[257:262] == b"ustar" or (start[0] and _is_tar(path)):
        return (
            "is a tar file: an archive to unpack, or a checkpoint of torch before 0.1.10, which is not read; "
            "save it again with a newer torch"
        )
    if len(start) > 8 and start[8:9] == b"{":
        return "is a safetensors file, which needs no conversion; name it with --model"
    if start[:1] == b"\x80":
        return "is a pickle that torch.save did not write; save the state_dict() with torch.save"
    if start.startswith(b"\x89HDF"):
        return "is an HDF5 file, not a torch checkpoint; name a .pth file"
    if start.startswith(b"version https://git-lfs"):
        return "is a Git LFS pointer, not the checkpoint itself; fetch it with git lfs pull"
    if start.lstrip()[:1] == b"<":
        return "is a web page, not a checkpoint; the download went wrong"
    return "is neither a zip nor a pickle of torch; name a checkpoint (.pth, .pth.tar)"


def _is_tar(path: Path) -> bool:
    try:
        return tarfile.is_tarfile(path)
    except (OSError, ValueError):
        return False

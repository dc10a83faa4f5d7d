"""What may be replaced by a file that is written."""

from __future__ import annotations

from pathlib import Path

from etnet.errors import EtnetError


def check_target(path: Path) -> None:
    """An error if something other than a regular file lies at `path`: to move a file there would destroy it.

    A folder, a pipe or a device, and a link to one; where there is nothing, a file can be written.
    """
    if path.exists() and not path.is_file():
        raise EtnetError(f"{path}: is there already and is no regular file; choose another name")

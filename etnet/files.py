"""What may be replaced by a file that is written, and where the cache lies."""

from __future__ import annotations

import os
import tempfile
from pathlib import Path

from etnet.errors import EtnetError


def check_target(path: Path) -> None:
    """An error if something other than a regular file lies at `path`: to move a file there would destroy it.

    A folder, a pipe or a device, and a link to one; where there is nothing, a file can be written.
    """
    if path.exists() and not path.is_file():
        raise EtnetError(f"{path}: is there already and is no regular file; choose another name")


def cache_folder() -> Path:
    """Where everything lies that can be made again: ETNET_CACHE, or `etnet` in the user's cache folder."""
    if "ETNET_CACHE" in os.environ:
        return Path(os.environ["ETNET_CACHE"])
    base = os.environ.get("XDG_CACHE_HOME")
    try:
        return (Path(base) if base else Path.home() / ".cache") / "etnet"
    except RuntimeError:
        # A user without a home, as in some containers.
        return Path(tempfile.gettempdir()) / "etnet"

"""A user's own network from a Python file that they name: its code is run, as any script of theirs would be."""

from __future__ import annotations

import runpy
from pathlib import Path

from etnet.errors import ModelError
from etnet.nets.base import Reconstructor

NAME = "network"


def load_own(path: Path) -> Reconstructor:
    """What the file calls `network`. Whatever goes wrong in it is one line that names the file."""
    try:
        made = runpy.run_path(str(path)).get(NAME)
    except Exception as error:
        raise ModelError(f"{path.name}: cannot be run ({type(error).__name__}: {error})") from error
    if made is None:
        raise ModelError(f"{path.name}: defines no {NAME!r}; set it to an Adapter or another Reconstructor")
    if not isinstance(made, Reconstructor):
        raise ModelError(f"{path.name}: its {NAME!r} is a {type(made).__name__}, wanted an Adapter or a Reconstructor")
    return made

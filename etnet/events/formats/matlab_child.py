"""Reads a v5 MATLAB file in a process of its own: scipy's reader crashes the interpreter on some damaged files.

Run as `python -m etnet.events.formats.matlab_child FILE.mat OUT.npz`; OUT gets every numeric array as "/name",
those of a struct as "struct/name". Exit code 1, with one line on standard error, for what cannot be read.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from typing import Any

import numpy as np


def numeric_arrays(tree: dict[str, Any]) -> Iterator[tuple[str, np.ndarray]]:
    """Arrays of numbers at the top and one level down."""
    for key, value in tree.items():
        if key.startswith("__"):
            continue
        parts = (
            {f"{key}/{name}": part for name, part in value.items()} if isinstance(value, dict) else {f"/{key}": value}
        )
        for name, part in parts.items():
            if isinstance(part, np.ndarray) and part.dtype.kind in "iufb":
                yield name, part


def main(source: str, target: str) -> int:
    """Copy the numbers of `source` to `target`."""
    import scipy.io

    try:
        arrays: dict[str, Any] = dict(numeric_arrays(scipy.io.loadmat(source, simplify_cells=True)))
        np.savez(target, **arrays)
    except Exception as error:
        print(str(error).splitlines()[0] if str(error) else type(error).__name__, file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:3]))

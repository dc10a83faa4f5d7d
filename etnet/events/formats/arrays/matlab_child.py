"""Reads a v5 MATLAB file in a process of its own: scipy's reader crashes the interpreter on some damaged files.

Run as `python -P -m etnet.events.formats.arrays.matlab_child FILE.mat FOLDER BYTES`; FOLDER gets x.npy, y.npy, t.npy
and p.npy, and standard output a line of JSON: the struct that holds them ("" at the top, null if none does) and all
variables.
The file may unpack to BYTES. Exit code 1, with one line on standard error, for what cannot be read.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np

from etnet.events.formats.column_names import column_keys

_NO_NUMBERS = {"char", "cell", "function", "object", "opaque", "sparse", "unknown"}


def numeric(parts: dict[str, Any]) -> dict[str, np.ndarray]:
    """Those that are arrays of numbers."""
    return {key: part for key, part in parts.items() if isinstance(part, np.ndarray) and part.dtype.kind in "iufb"}


def candidates(source: str, kinds: dict[str, str]) -> Iterator[tuple[str, dict[str, np.ndarray]]]:
    """What may hold the columns: the variables at the top that have their names, then each struct. No other is read."""
    import scipy.io

    keys = column_keys(name for name, kind in kinds.items() if kind not in _NO_NUMBERS | {"struct"})
    if keys is not None:
        yield "", numeric(scipy.io.loadmat(source, simplify_cells=True, variable_names=list(keys.values())))
    for name in (name for name, kind in kinds.items() if kind == "struct"):
        struct = scipy.io.loadmat(source, simplify_cells=True, variable_names=[name]).get(name)
        if isinstance(struct, dict):
            yield name, numeric(struct)


def copy_columns(source: str, folder: Path) -> dict[str, Any]:
    """Write the four columns; what is to be told of it."""
    import scipy.io

    kinds = {name: kind for name, _, kind in scipy.io.whosmat(source)}
    for where, parts in candidates(source, kinds):
        keys = column_keys(parts)
        if keys is not None:
            for axis, key in keys.items():
                np.save(folder / f"{axis}.npy", parts[key].reshape(-1))
            return {"where": where, "variables": list(kinds)}
    return {"where": None, "variables": list(kinds)}


def limit_memory(unpacked: int) -> None:
    """What this process has by now and the columns twice, as read and as a struct; where the system can limit it."""
    with suppress(ImportError, OSError, ValueError):
        import resource

        own = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
        resource.setrlimit(resource.RLIMIT_AS, (own + 2 * unpacked, resource.RLIM_INFINITY))


def main(source: str, folder: str, unpacked: str) -> int:
    """Copy the columns of `source` into `folder`."""
    import scipy.io  # noqa: F401  (its own memory comes before the limit)

    try:
        limit_memory(int(unpacked))
        print(json.dumps(copy_columns(source, Path(folder))))
    except MemoryError:
        print(f"it asks for much more memory than the {unpacked} bytes that its size allows", file=sys.stderr)
        return 1
    except Exception as error:
        print(str(error).splitlines()[0] if str(error) else type(error).__name__, file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:4]))

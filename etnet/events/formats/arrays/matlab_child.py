"""Reads a v5 MATLAB file in a process of its own: scipy's reader crashes the interpreter on some damaged files.

Run as `python -P -m etnet.events.formats.arrays.matlab_child FILE.mat FOLDER BYTES`; FOLDER gets x.npy, y.npy, t.npy
and p.npy, and standard output a line of JSON: the struct or matrix that holds them ("" at the top, null if none does),
all variables, the order of a matrix's columns, the unit in the name of t, the structs that were left out, and what
else was said.
The file may unpack to BYTES. Exit code 1, with one line on standard error, for what cannot be read.
"""

from __future__ import annotations

import json
import sys
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np

from etnet.child_process import end_with_parent
from etnet.events.formats.base import Remarks
from etnet.events.formats.column_finder import Found, Leaf, find_events, rank_of

_TYPES = {"double": "f8", "single": "f4", "logical": "?"} | {
    f"{sign}int{bits}": f"{kind}{bits // 8}" for sign, kind in (("", "i"), ("u", "u")) for bits in (8, 16, 32, 64)
}
"""MATLAB's numbers; all else (text, cells, functions, sparse) is none."""


def top_tree(source: str, found: list[tuple[str, tuple[int, ...], str]]) -> dict[str, Leaf]:
    """The variables at the top that are numbers; each is read by itself, if it is used."""
    import scipy.io

    def open_one(name: str) -> np.ndarray:
        return scipy.io.loadmat(source, variable_names=[name])[name]

    return {
        name: Leaf(tuple(shape), np.dtype(_TYPES[kind]), lambda n=name: open_one(n))
        for name, shape, kind in found
        if kind in _TYPES
    }


def struct_tree(source: str, name: str) -> dict[str, Leaf]:
    """The arrays of a struct, and of structs in it."""
    import scipy.io

    tree: dict[str, Leaf] = {}

    def walk(value: Any, path: str) -> None:
        if isinstance(value, dict):
            for key, part in value.items():
                walk(part, f"{path}/{key}")
        elif isinstance(value, np.ndarray):
            tree[path] = Leaf(value.shape, value.dtype, lambda: value)

    walk(scipy.io.loadmat(source, simplify_cells=True, variable_names=[name]).get(name), name)
    return tree


def find_columns(source: str, remarks: Remarks) -> tuple[Found | None, list[str], list[str]]:
    """The events, what all variables are called, and which of the structs were left out unread."""
    import scipy.io

    variables = scipy.io.whosmat(source)
    names = [name for name, _, _ in variables]
    structs = sorted((name for name, _, kind in variables if kind == "struct"), key=rank_of)
    found = find_events(top_tree(source, variables), remarks)
    for i, name in enumerate(structs):
        if found is not None:
            return found, names, structs[i:]
        found = find_events(struct_tree(source, name), remarks)
        if found is not None:
            return found, names, structs[:i] + structs[i + 1 :]
    return found, names, []


def copy_columns(source: str, folder: Path) -> dict[str, Any]:
    """Write the four columns; what is to be told of it."""
    remarks = Remarks()
    found, names, others = find_columns(source, remarks)
    if found is None:
        return {"where": None, "variables": names}
    for axis, column in found.columns.items():
        np.save(folder / f"{axis}.npy", np.ascontiguousarray(column[: len(column)]))
    # Where the events are is told of itself.
    said = [remark.text for remark in remarks.kept if "events are in" not in remark.text]
    told = {"order": found.order, "unit": found.unit, "others": others, "said": said}
    return {"where": found.where, "variables": names, **told}


def limit_memory(unpacked: int) -> None:
    """What this process has by now and the columns twice, as read and as a struct; where the system can limit it."""
    with suppress(ImportError, OSError, ValueError):
        import resource

        own = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
        resource.setrlimit(resource.RLIMIT_AS, (own + 2 * unpacked, resource.RLIM_INFINITY))


def main(source: str, folder: str, unpacked: str) -> int:
    """Copy the columns of `source` into `folder`."""
    end_with_parent()
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

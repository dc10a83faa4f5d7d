"""Short names that tell files apart: `a/events` and `b/events`, where two are called `events.h5`."""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Iterable
from pathlib import Path

from etnet.files import printable


def labels_of(paths: Iterable[Path]) -> dict[Path, str]:
    """A label for each of these different files.

    The name without its ending where no other file has it, else the whole name, else one of them behind as many of the
    folders above it as tell it apart.
    """
    parts = {path: Path(os.path.abspath(path)).parts for path in paths}
    labels: dict[Path, str] = {}
    for depth in range(max(map(len, parts.values()), default=0)):
        tails = {path: Path(*each[-1 - depth :]) for path, each in parts.items()}
        names = {path: printable(tail.as_posix()) for path, tail in tails.items()}
        stems = {path: printable(tail.with_name(tail.stem or tail.name).as_posix()) for path, tail in tails.items()}
        num_names = Counter(names.values())
        num_both = Counter(label for path in parts for label in {stems[path], names[path]})
        for path in parts:
            if num_both[stems[path]] == 1:
                labels.setdefault(path, stems[path])
            elif num_names[names[path]] == 1:
                labels.setdefault(path, names[path])
    return {path: labels.get(path, printable(path)) for path in parts}

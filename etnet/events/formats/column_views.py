"""Columns of stored arrays, read by slice: a vector, one column of a table, one field of records."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np


class Vector:
    """A row of numbers, read by slice; its other sides are 1."""

    def __init__(self, stored: Any) -> None:
        self._stored = stored
        self._side = stored.shape.index(max(stored.shape))

    def __len__(self) -> int:
        return self._stored.shape[self._side]

    def __getitem__(self, part: slice) -> np.ndarray:
        start, stop, _ = part.indices(len(self))
        places: list[int | slice] = [0] * len(self._stored.shape)
        places[self._side] = slice(start, stop)
        return np.asarray(self._stored[tuple(places)])


class Rows:
    """Rows of a table of `width` columns, or records; the last ones are kept, for all columns are asked for in turn."""

    def __init__(self, stored: Any, width: int = 1) -> None:
        self._stored = stored
        shape = stored.shape
        self._side = int(shape[1] != width) if width > 1 else shape.index(max(shape))
        self._kept: tuple[slice, np.ndarray] | None = None

    def __len__(self) -> int:
        return self._stored.shape[self._side]

    def __getitem__(self, part: slice) -> np.ndarray:
        start, stop, _ = part.indices(len(self))
        whole = slice(start, stop)
        if self._kept is None or self._kept[0] != whole:
            places: list[int | slice] = [slice(None) if self._stored.ndim == 2 else 0] * self._stored.ndim
            places[self._side] = whole
            block = np.asarray(self._stored[tuple(places)])
            self._kept = whole, block.T if self._side == 1 else block
        return self._kept[1]


@dataclass(frozen=True)
class Field:
    """One column of rows: a number of a table's, or a name of records'."""

    rows: Rows
    key: int | str

    def __len__(self) -> int:
        return len(self.rows)

    def __getitem__(self, part: slice) -> np.ndarray:
        block = self.rows[part]
        return block[:, self.key] if isinstance(self.key, int) else block[self.key].reshape(-1)

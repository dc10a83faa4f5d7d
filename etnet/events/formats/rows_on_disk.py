"""Rows of a file that is not ours, read when they are asked for: a file that changes meanwhile is an error.

A memory map of it would be quicker by a little, and the end of the process where the file is cut short.
"""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
from jaxtyping import Shaped

from etnet.errors import RecordingError


class RowsOnDisk:
    """A two-dimensional array of fixed rows, sliced as an array is. Safe from two threads."""

    def __init__(self, path: Path, dtype: str, start: int, shape: tuple[int, int]) -> None:
        self.shape = shape
        self.dtype = np.dtype(dtype)
        self._name = path.name
        self._start = start
        self._row_bytes = shape[1] * self.dtype.itemsize
        self._file = path.open("rb", buffering=0)
        self._sign = self._signed()

    def __len__(self) -> int:
        return self.shape[0]

    def __getitem__(self, wanted: slice | tuple[slice, int]) -> Shaped[np.ndarray, ...]:
        """Some rows, or one column of them; every n-th row is read by itself."""
        rows, column = wanted if isinstance(wanted, tuple) else (wanted, None)
        start, stop, step = rows.indices(len(self))
        if step == 1:
            found = self._read(start, max(stop, start))
        else:
            parts = [self._read(row, row + 1) for row in range(start, stop, step)]
            found = np.concatenate(parts) if parts else self._read(0, 0)
        return found if column is None else found[:, column]

    def close(self) -> None:
        """The file is not needed any more."""
        self._file.close()

    def _read(self, start: int, stop: int) -> Shaped[np.ndarray, "n k"]:
        wanted = (stop - start) * self._row_bytes
        content = bytearray(wanted)
        done = 0
        try:
            while done < wanted:
                place = self._start + start * self._row_bytes + done
                count = os.preadv(self._file.fileno(), [memoryview(content)[done:]], place)
                if count == 0:
                    break
                done += count
            is_same = self._signed() == self._sign
        except (OSError, ValueError) as error:
            raise RecordingError(f"{self._name}: cannot be read any more ({error}); open it again") from None
        if done < wanted or not is_same:
            raise RecordingError(f"{self._name}: was changed while it was open; open it again")
        return np.frombuffer(content, self.dtype).reshape(stop - start, self.shape[1])

    def _signed(self) -> tuple[int, int]:
        status = os.fstat(self._file.fileno())
        return status.st_size, status.st_mtime_ns

"""The turns of EVT3's clock, every 16.78 s, written so that no reader misses one.

Over a pause `faery` writes every 1024th high time at most. Readers, its own among them, take a high time that is
smaller than the last for a new turn only where the clock stood near its end, as a camera's does: its high times never
pause.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from jaxtyping import Int64, UInt16

from etnet.files import replacing

_HIGH, _END = 0x8 << 12, 0xFFF
_BLOCK = 1 << 20


def mark_turns(path: Path) -> None:
    """Put the last and the first high time of the clock around each of its turns where they are missing."""
    start = header_end(path)
    words = np.memmap(path, "<u2", "r", offset=start)
    places, missing = _missing(words)
    if not len(places):
        return
    with replacing(path) as marked, path.open("rb") as source, marked.open("wb") as target:
        target.write(source.read(start))
        for first, last, word in zip([0, *places[:-1]], places, missing, strict=True):
            words[first:last].tofile(target)
            target.write(word.tobytes())
        words[places[-1] :].tofile(target)


def header_end(path: Path) -> int:
    """Bytes of the header, the lines that begin with "% "."""
    end = 0
    with path.open("rb") as file:
        while file.readline().startswith(b"% "):
            end = file.tell()
    return end


def _missing(words: UInt16[np.ndarray, " n"]) -> tuple[Int64[np.ndarray, " m"], UInt16[np.ndarray, " m"]]:
    """Words to put in, and before which place each."""
    blocks = range(0, len(words), _BLOCK)
    places = np.concatenate([np.flatnonzero(words[i : i + _BLOCK] >> 12 == _HIGH >> 12) + i for i in blocks])
    times = words[places] & np.uint16(_END)
    turns = np.flatnonzero(times[1:] < times[:-1]) + 1
    unended, unbegun = turns[times[turns - 1] != _END], turns[times[turns] != 0]
    put = np.concatenate([places[unended], places[unbegun]])
    new = np.concatenate([np.full(len(unended), _HIGH | _END, "<u2"), np.full(len(unbegun), _HIGH, "<u2")])
    # Where both are missing the end comes first, as it stands first here.
    order = np.argsort(put, kind="stable")
    return put[order], new[order]

"""The index of a large EVT 2.0 or 3.0 file: what each block depends on. Made once, kept, and shared as it grows."""

from __future__ import annotations

import time
from collections import OrderedDict
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from threading import Lock, Thread
from typing import BinaryIO

import numpy as np

from etnet.events.formats.base import Remarks, Request
from etnet.events.formats.prophesee.evt2_evt3 import Notes, State, Version
from etnet.events.index_store import Arrays, index_path, load_index, save_index
from etnet.events.recording import Growth

BLOCK_BYTES = 1 << 19
"""Of the file, between two states that the index keeps."""

_DECODING = 1
"""Raised when words are decoded in another way: what was kept before is then made again."""

_MOST_GROWING = 8
"""Indices that are held while they grow, and after it where the cache folder does not take them."""


@dataclass
class Growing:
    """The index as far as it goes: the state before each block, the events before it, the last stamp in it."""

    states: list[State] = field(default_factory=lambda: [State()])
    before: list[int] = field(default_factory=lambda: [0])
    until: list[int] = field(default_factory=list)
    notes: Notes = field(default_factory=Notes)
    growth: Growth = field(default_factory=Growth)

    def arrays(self) -> Arrays:
        """As they are kept; those of whole blocks, though another thread may go on."""
        count = len(self.states) - 1  # a block's state is the last thing that is added of it
        notes = [self.notes.num_untimed, self.notes.num_held, self.notes.farthest_back]
        states, before, until = self.states[: count + 1], self.before[: count + 1], self.until[:count]
        named = {"states": states, "before": before, "until": until, "notes": notes}
        arrays = {name: np.array(values, np.int64) for name, values in named.items()}
        return arrays | {"triggers": self.notes.triggers.rows}


_growing: OrderedDict[Path, Growing] = OrderedDict()
_lock = Lock()


@dataclass(frozen=True)
class Blocks:
    """The words of a file by block."""

    path: Path
    version: Version
    offset: int
    num_bytes: int

    @property
    def num_blocks(self) -> int:
        """The last one may be shorter."""
        return -(-self.num_bytes // BLOCK_BYTES)

    def words(self, file: BinaryIO, block: int) -> np.ndarray:
        """All whole words of a block."""
        file.seek(self.offset + block * BLOCK_BYTES)
        content = file.read(min(BLOCK_BYTES, self.num_bytes - block * BLOCK_BYTES))
        whole = len(content) // self.version.word.itemsize * self.version.word.itemsize
        return np.frombuffer(content[:whole], self.version.word)

    def index(self, growing: Growing) -> Iterator[float]:
        """Go on with the index; gives the fraction done after every block."""
        with self.path.open("rb") as file:
            for block in range(len(growing.until), self.num_blocks):
                num_events, state = self.version.skim(self.words(file, block), growing.states[-1], growing.notes)
                growing.before.append(growing.before[-1] + num_events)
                growing.until.append(state.last)
                growing.states.append(state)
                growing.growth.share = (block + 1) / self.num_blocks
                yield growing.growth.share


def index_of(request: Request, blocks: Blocks, version: str, remarks: Remarks) -> tuple[Arrays, Growth | None]:
    """From the cache folder, else made now; what patience does not reach goes on in the background.

    Of an index that is being made already a patient request takes what is there; its growth tells of the rest.
    """
    path = index_path(request.path, f"EVT {version} by {BLOCK_BYTES}, {_DECODING}")
    kept = load_index(path)
    if kept is not None and _fits(kept, blocks.num_blocks):
        return kept, None
    with _lock:
        growing = _growing.get(path)
    if growing is not None and growing.growth.share == 1:
        return growing.arrays(), None
    if request.patience is not None and growing is not None and not growing.growth.is_over:
        shown = growing.arrays()
        if shown["before"][-1] > 0:
            return _part(shown, blocks, remarks), growing.growth
    return _made(request, blocks, path, remarks)


def _made(request: Request, blocks: Blocks, path: Path, remarks: Remarks) -> tuple[Arrays, Growth | None]:
    growing, began = Growing(), time.monotonic()
    builder = blocks.index(growing)
    for fraction in builder:
        request.progress(min(fraction, 0.99))
        is_enough = request.patience is not None and time.monotonic() - began > request.patience
        if is_enough and fraction < 1 and growing.before[-1] > 0:
            shown = growing.arrays()
            growing = _go_on(builder, growing, path)
            return _part(shown, blocks, remarks), growing.growth
    save_index(path, growing.arrays())
    return growing.arrays(), None


def _part(shown: Arrays, blocks: Blocks, remarks: Remarks) -> Arrays:
    share = len(shown["until"]) / blocks.num_blocks
    remarks.detected(
        f"only the first {shown['before'][-1]:,} events ({share:.0%} of the file) are here: its time index is being "
        "made in the background, and opening the file gives all of it once that is done"
    )
    return shown


def _go_on(builder: Iterator[float], growing: Growing, path: Path) -> Growing:
    """Finish the index in a thread, unless one is at it already; the one that grows."""
    with _lock:
        other = _growing.get(path)
        if other is not None and not other.growth.is_over:
            return other
        _growing[path] = growing
        while len(_growing) > _MOST_GROWING:
            _growing.popitem(last=False)

    def finish() -> None:
        try:
            for _ in builder:
                time.sleep(0)
            save_index(path, growing.arrays())
        except OSError:
            # The file went away; opening it again says so.
            return
        finally:
            growing.growth.is_over = True
            if path.exists():
                with _lock:
                    _growing.pop(path, None)

    Thread(target=finish, name=f"index {path.name}", daemon=True).start()
    return growing


def _fits(kept: Arrays, num_blocks: int) -> bool:
    wanted = {
        "states": (num_blocks + 1, len(State._fields)),
        "before": (num_blocks + 1,),
        "until": (num_blocks,),
        "notes": (3,),
    }
    has_triggers = "triggers" in kept and kept["triggers"].shape[1:] == (3,)
    return has_triggers and all(name in kept and kept[name].shape == shape for name, shape in wanted.items())

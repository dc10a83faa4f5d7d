"""A folder of simulated recordings, each by its own seed, so that a broken run goes on where it stopped."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from dataclasses import asdict
from pathlib import Path

import h5py
import numpy as np

from etnet.errors import EtnetError, RecordingError
from etnet.files import claimed
from etnet.simulation.config import SequenceConfig
from etnet.simulation.pictures import PicturePool
from etnet.simulation.sequence import simulate_sequence
from etnet.simulation.write import take_of, write_take

MOST_NAMED = 10
"""Failures that the error at the end names."""


def write_dataset(
    folder: Path,
    pictures: PicturePool,
    config: SequenceConfig,
    num_sequences: int,
    seed: int,
    with_flow: bool = True,
    progress: Callable[[float], None] | None = None,
    share: tuple[int, int] = (0, 1),
) -> tuple[Path, ...]:
    """Write sequence_00000.h5 … and return the paths of those that are there.

    What is there already is kept, if its settings, and the pictures' split and names, are these. Sequence i depends on
    (pictures, config, seed, i) alone.
    `progress` hears the fraction done. Of several processes each writes those of its `share` (number, how many
    processes): they are all of one length. One that another process is at is left to it.

    Raises:
        RecordingError: some failed, and are named; all others are there.
    """
    folder.mkdir(parents=True, exist_ok=True)
    paths = tuple(folder / f"sequence_{i:05d}.h5" for i in range(num_sequences))
    former = {"seed": seed, "flow": with_flow, "config": asdict(config)}
    settings = _as_text({**former, "split": pictures.split, "pictures": pictures.names_digest})
    rank, num_processes = share
    mine = range(rank, num_sequences, num_processes)
    for path in paths:
        # A file of the former version tells nothing of its pictures.
        _refuse_other_settings(path, (settings, _as_text(former)))
    failures = []
    for number, i in enumerate(mine, start=1):
        try:
            _write_one(paths[i], pictures, config, (seed, i), with_flow, settings)
        except Exception as error:  # whatever it is, it is this sequence's and ends no other
            named = error if isinstance(error, EtnetError) else f"{paths[i]}: {type(error).__name__}: {error}"
            failures.append(str(named))
        if progress is not None:
            progress(number / len(mine))
    if failures:
        counted = f"{len(failures)} of {len(mine)} sequences failed: " if len(mine) > 1 else ""
        more = f"; and {len(failures) - MOST_NAMED} more" if len(failures) > MOST_NAMED else ""
        raise RecordingError(counted + "; ".join(failures[:MOST_NAMED]) + more)
    return tuple(paths[i] for i in mine if paths[i].exists())


def _as_text(settings: Mapping[str, object]) -> str:
    return json.dumps(settings, sort_keys=True)


def _write_one(
    path: Path,
    pictures: PicturePool,
    config: SequenceConfig,
    seed: tuple[int, int],
    with_flow: bool,
    settings: str,
) -> None:
    """One sequence, if it is not there; `seed` ends in its number."""
    lock = path.with_name(f".{path.stem}.claim")
    with claimed(lock) as is_ours:
        if not is_ours:
            return
        try:
            if path.exists():
                _check_readable(path)
                return
            sequence = simulate_sequence(pictures, config, np.random.default_rng(list(seed)))
            drawn = json.dumps(asdict(sequence.drawn), sort_keys=True)
            attributes = {"source": "etnet.simulation", "settings": settings, "index": seed[1], "drawn": drawn}
            write_take(path, take_of(sequence, with_flow), attributes)
        finally:
            # Whoever comes next finds the sequence, or writes the same one.
            lock.unlink(missing_ok=True)


def _check_readable(path: Path) -> None:
    try:
        h5py.File(path, "r").close()
    except OSError as slip:
        raise RecordingError(f"{path}: not a readable HDF5 file ({slip}); remove it to simulate it again") from slip


def _refuse_other_settings(path: Path, same: tuple[str, ...]) -> None:
    """Before anything is written, so that no folder ever holds sequences of two kinds."""
    if not path.exists():
        return
    try:
        with h5py.File(path, "r") as file:
            found = file.attrs.get("settings")
    except OSError:
        return  # said when its turn comes
    if not isinstance(found, str) or found not in same:
        raise RecordingError(
            f"{path}: was simulated with other settings, of other pictures or another split of them, or with another "
            "seed; name an empty folder, or the same of all"
        )

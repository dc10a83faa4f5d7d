"""A folder of simulated recordings, each by its own seed, so that a broken run goes on where it stopped."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path

import h5py
import numpy as np

from etnet.errors import RecordingError
from etnet.simulation.config import SequenceConfig
from etnet.simulation.pictures import PicturePool
from etnet.simulation.sequence import simulate_sequence
from etnet.simulation.write import take_of, write_take


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
    """Write sequence_00000.h5 … and return their paths; what is there already is kept, if its settings are these.

    Sequence i depends on (pictures, config, seed, i) alone. `progress` hears the fraction done. Of several processes
    each writes those of its `share` (number, how many processes): they are all of one length.
    """
    folder.mkdir(parents=True, exist_ok=True)
    paths = tuple(folder / f"sequence_{i:05d}.h5" for i in range(num_sequences))
    settings = json.dumps({"seed": seed, "flow": with_flow, "config": asdict(config)}, sort_keys=True)
    rank, num_processes = share
    mine = range(rank, num_sequences, num_processes)
    for number, i in enumerate(mine, start=1):
        path = paths[i]
        if path.exists():
            _check_settings(path, settings)
        else:
            sequence = simulate_sequence(pictures, config, np.random.default_rng([seed, i]))
            drawn = json.dumps(asdict(sequence.drawn), sort_keys=True)
            attributes = {"source": "etnet.simulation", "settings": settings, "index": i, "drawn": drawn}
            write_take(path, take_of(sequence, with_flow), attributes)
        if progress is not None:
            progress(number / len(mine))
    return tuple(paths[i] for i in mine)


def _check_settings(path: Path, settings: str) -> None:
    try:
        with h5py.File(path, "r") as file:
            found = file.attrs.get("settings")
    except OSError as slip:
        raise RecordingError(f"{path}: not a readable HDF5 file ({slip}); remove it to simulate it again") from slip
    if found != settings:
        raise RecordingError(
            f"{path}: was simulated with other settings or another seed; name an empty folder, or the same settings"
        )

"""Numbers as they are: frames, voxel grids, attention rows and states as NPZ or HDF5, never all in memory at once."""

from __future__ import annotations

import json
import zipfile
import zlib
from collections.abc import Generator, Mapping, Sequence
from contextlib import AbstractContextManager, ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Any, Literal, Protocol

import numpy as np
from torch import Tensor

from etnet.errors import Cancelled, EtnetError, ModelError
from etnet.export.take import IsCancelled, Moment, Progress, Take
from etnet.files import replacing, working_folder
from etnet.nets.attention import AttentionProbe
from etnet.nets.padding import TokenGrid
from etnet.reconstruction import window_voxel

ArrayName = Literal["frames", "voxels", "camera", "attention", "states"]
BLOCK = 1 << 20
"""Bytes that are packed between two questions whether the file is still wanted."""


@dataclass(frozen=True, slots=True)
class ArraysChoice:
    """Which arrays, and for attention the pixels (x, y) that look and the sites (all when none are named)."""

    names: tuple[ArrayName, ...] = ("frames", "voxels")
    queries: tuple[tuple[int, int], ...] = ()
    sites: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        if not self.names:
            raise EtnetError("no array was chosen; choose from frames, voxels, camera, attention, states")
        if "attention" in self.names and not self.queries:
            raise EtnetError("attention rows need at least one query pixel; name one, e.g. --queries 120,90")

    @property
    def probe(self) -> AttentionProbe | None:
        """What has to be kept of each step."""
        if "attention" not in self.names:
            return None
        return AttentionProbe(frozenset(self.sites) if self.sites else None)


class ArraySink(Protocol):
    """Takes the rows of named arrays, one moment after the other."""

    def __call__(self, name: str, row: np.ndarray) -> None:
        """Append one row; all rows of a name have the same shape and type."""
        ...


def write_arrays(
    take: Take,
    path: Path,
    choice: ArraysChoice,
    progress: Progress | None = None,
    is_cancelled: IsCancelled | None = None,
    changed: str = "",
) -> int:
    """One array a name, first axis the window; `window`, `t_start_us`, `t_stop_us` say which. .npz or .h5 by suffix.

    "attention/<site>" is "n queries heads tokens", rows that sum to 1; "state/<i>" the memory after the window.
    `changed`: what is done to the network or its events in the take's steps, in words, for the file's facts.
    """
    facts = {
        "recording": take.recording.name,
        "sensor": [take.recording.sensor.width, take.recording.sensor.height],
        "model": take.playback.model.name,
        "queries": [list(query) for query in choice.queries],
    }
    facts |= {"changed": changed} if changed else {}
    with _opened(path, len(take), facts, is_cancelled) as append:
        for moment in take.moments(choice.probe, progress, is_cancelled):
            append("window", np.array(moment.window.index, np.int64))
            append("t_start_us", np.array(moment.window.t_start, np.int64))
            append("t_stop_us", np.array(moment.window.t_stop, np.int64))
            for name, row in _rows(take, moment, choice):
                append(name, row)
    return len(take)


def _rows(take: Take, moment: Moment, choice: ArraysChoice) -> Generator[tuple[str, np.ndarray]]:
    if "frames" in choice.names:
        yield "frames", moment.frame
    if "voxels" in choice.names:
        yield "voxels", _numpy(window_voxel(take.playback.model, take.recording, moment.window))
    if "camera" in choice.names:
        if moment.camera is None:
            raise EtnetError(f"{take.recording.name}: has no camera frames to export; leave camera out")
        yield "camera", moment.camera
    if "states" in choice.names:
        for i, tensor in enumerate(moment.step.state):
            yield f"state/{i}", _numpy(tensor[0])
    if "attention" in choice.names:
        attention = moment.step.attention
        if attention is None or not (choice.sites or attention.sites):
            raise ModelError(f"{take.playback.model.name}: has no attention to export; leave attention out")
        tokens = query_tokens(attention.grid, choice.queries)
        for site in choice.sites or attention.sites:
            yield f"attention/{site}", _numpy(attention.rows(site, tokens).transpose(0, 1))


def query_tokens(grid: TokenGrid, queries: Sequence[tuple[int, int]]) -> list[int]:
    """The tokens over pixels (x, y); a pixel outside the sensor is an error that names it."""
    try:
        return [grid.token_at(x, y) for x, y in queries]
    except ValueError as slip:
        raise EtnetError(f"query {slip}") from None


def _numpy(tensor: Tensor) -> np.ndarray:
    return tensor.float().cpu().numpy()


def _opened(
    path: Path, length: int, facts: Mapping[str, Any], is_cancelled: IsCancelled | None = None
) -> AbstractContextManager[ArraySink]:
    if path.suffix == ".npz":
        return _npz(path, length, facts, is_cancelled)
    if path.suffix in (".h5", ".hdf5"):
        return _hdf5(path, length, facts, is_cancelled)
    raise EtnetError(f"{path.name}: arrays are written as .npz or .h5; give the file one of these endings")


@contextmanager
def _npz(path: Path, length: int, facts: Mapping[str, Any], is_cancelled: IsCancelled | None) -> Generator[ArraySink]:
    """Rows go to files of a folder beside the target, which are then packed: memory stays flat.

    Each row is written and not mapped: a disk that is full is then an error, and no signal that ends the process.
    """
    with replacing(path) as packed, working_folder(path) as folder:
        files: dict[str, IO[bytes]] = {}
        left: dict[str, int] = {}
        opened = ExitStack()

        def sink(name: str, row: np.ndarray) -> None:
            if name not in files:
                files[name] = opened.enter_context((folder / f"{len(files)}.npy").open("wb"))
                left[name] = length * row.nbytes
                descr = np.lib.format.dtype_to_descr(row.dtype)
                head = {"descr": descr, "fortran_order": False, "shape": (length, *row.shape)}
                np.lib.format.write_array_header_2_0(files[name], head)
            files[name].write(row.tobytes())
            left[name] -= row.nbytes

        with opened:
            yield sink
            for name, file in files.items():
                file.truncate(file.tell() + left[name])  # rows that never came are zeros
        with zipfile.ZipFile(packed, "w", zipfile.ZIP_DEFLATED, compresslevel=1) as archive:
            for i, name in enumerate(files):
                packing = archive.open(f"{name}.npy", "w", force_zip64=True)
                with (folder / f"{i}.npy").open("rb") as rows, packing as member:
                    while block := rows.read(BLOCK):
                        _check_wanted(path, is_cancelled)
                        member.write(block)
            with archive.open("facts.npy", "w") as file:
                np.lib.format.write_array(file, np.array(json.dumps(facts)))


@contextmanager
def _hdf5(path: Path, length: int, facts: Mapping[str, Any], is_cancelled: IsCancelled | None) -> Generator[ArraySink]:
    """Rows of an HDF5 file, which are read again before it takes its place: on a full disk HDF5 may say nothing."""
    from etnet.events.formats.hdf5.writing import hdf5_to_write

    sums: dict[str, list[int]] = {}
    with replacing(path) as beside:
        with hdf5_to_write(beside) as file:
            file.attrs["facts"] = json.dumps(facts)

            def sink(name: str, row: np.ndarray) -> None:
                if name not in sums:
                    shape = (length, *row.shape)
                    packing = {"chunks": (1, *row.shape), "compression": "gzip", "compression_opts": 1}
                    file.create_dataset(name, shape, row.dtype, **(packing if row.ndim else {}))
                    sums[name] = []
                file[name][len(sums[name])] = row  # pyright: ignore[reportIndexIssue]
                sums[name].append(zlib.crc32(np.ascontiguousarray(row).tobytes()))
                file.check()

            yield sink
        _verify(beside, path, sums, is_cancelled)


def _check_wanted(path: Path, is_cancelled: IsCancelled | None) -> None:
    if is_cancelled is not None and is_cancelled():
        raise Cancelled(f"{path.name}: export was stopped while its arrays were packed")


def _verify(written: Path, path: Path, sums: Mapping[str, Sequence[int]], is_cancelled: IsCancelled | None) -> None:
    """An error unless every row is there as it was handed over."""
    import h5py

    try:
        with h5py.File(written, "r") as file:
            for name, expected in sums.items():
                for i, checksum in enumerate(expected):
                    _check_wanted(path, is_cancelled)
                    row: Any = file[name][i]  # pyright: ignore[reportIndexIssue]
                    if zlib.crc32(np.ascontiguousarray(row).tobytes()) != checksum:
                        raise OSError(f"row {i} of {name} is not what was written")
    except (OSError, KeyError, ValueError, RuntimeError) as error:
        raise EtnetError(f"{path.name}: was not written whole ({error}); make room, or choose another place") from None

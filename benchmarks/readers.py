"""Whole files of made-up events into memory, by CPU seconds of all of this process's threads: ours beside the library.

Both sides hand over the same: x and y as u16, t as int64 µs, p as ±1 in int8, whole columns in memory. What the library
gives otherwise is turned into that here, with as few passes as numpy allows. What the comparison does not make even:
ours also checks order, sensor and polarity, and may be read again, anywhere; the library does neither. Beside it stands
"bare": the library with nothing turned into anything and packets just held. That is less than ours does (no columns,
often seconds or unsigned stamps), so no share of it is asked for.

`python benchmarks/readers.py evt3 dsec` times these formats alone and writes no result.
"""

from __future__ import annotations

import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import aedat
import faery
import h5py
import hdf5plugin  # noqa: F401  (Blosc)
import numpy as np
from measure import best_of_each, report

from etnet.events.assumptions import Assumptions
from etnet.events.events import Events, Sensor
from etnet.events.open import open_recording
from etnet.events.recording import recording_of_events
from etnet.events.write import Layout, write_recording

NUM_EVENTS, SENSOR = 5_000_000, Sensor(346, 260)
RUNS = 5
ALIKE = 100_000
"""Events of each end that both ways have to agree on before they are timed."""

Columns = tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]


def _events() -> Events:
    """Bursts of neighbouring pixels, as moving edges make them."""
    rng = np.random.default_rng(0)
    x = (np.repeat(rng.integers(0, SENSOR.width, NUM_EVENTS // 8), 8) + rng.integers(0, 9, NUM_EVENTS)) % SENSOR.width
    y = (np.repeat(rng.integers(0, SENSOR.height, NUM_EVENTS // 8), 8) + rng.integers(0, 3, NUM_EVENTS)) % SENSOR.height
    t = np.cumsum(rng.integers(0, 3, NUM_EVENTS))
    return Events(x.astype(np.uint16), y.astype(np.uint16), t, rng.choice([-1, 1], NUM_EVENTS).astype(np.int8), SENSOR)


def _rows() -> Events:
    """Rows of pixels that change together, as the readout of a large sensor sends them: EVT 3.0 packs them in masks."""
    rng = np.random.default_rng(1)
    num_rows = NUM_EVENTS // 20
    length = 20
    x = (rng.integers(0, SENSOR.width - length, num_rows)[:, None] + np.arange(length)).reshape(-1)
    y = np.repeat(rng.integers(0, SENSOR.height, num_rows), length)
    t = np.repeat(np.cumsum(rng.integers(0, 9, num_rows)), length)
    p = np.repeat(rng.choice([-1, 1], num_rows), length)
    return Events(x.astype(np.uint16), y.astype(np.uint16), t, p.astype(np.int8), SENSOR)


def ours(path: Path) -> Columns:
    """Open a recording and read all of it."""
    with open_recording(path, assume=Assumptions(width=SENSOR.width, height=SENSOR.height)) as recording:
        events = recording.read(0, recording.num_events)
    return events.x, events.y, events.t, events.p


def _signs(is_on: np.ndarray) -> np.ndarray:
    signs = is_on.view(np.int8) * np.int8(2)
    signs -= 1
    return signs


def _microseconds(seconds: np.ndarray) -> np.ndarray:
    seconds *= 1e6
    return np.rint(seconds, out=seconds).astype(np.int64)


def _joined(packets: list[np.ndarray]) -> Columns:
    x, y, t, on = (np.concatenate([packet[name] for packet in packets]) for name in ("x", "y", "t", "on"))
    return x, y, t.view(np.int64), _signs(on)


def bare_faery(path: Path) -> list[np.ndarray]:
    """All packets, held as faery gives them."""
    if path.suffix != ".txt":
        return list(faery.events_stream_from_file(path))
    kind = faery.CsvProperties(
        has_header=False,
        separator=b" ",
        t_index=0,
        x_index=1,
        y_index=2,
        on_index=3,
        t_scale=1e6,
        on_value=b"1",
        off_value=b"0",
        skip_errors=False,
    )
    size = (SENSOR.width, SENSOR.height)
    return list(faery.events_stream_from_file(path, file_type="csv", csv_properties=kind, dimensions_fallback=size))


def faery_columns(path: Path) -> Columns:
    """faery's packets as columns."""
    return _joined(bare_faery(path))


def bare_aedat(path: Path) -> list[np.ndarray]:
    """All packets of events, held as aedat gives them."""
    return [packet["events"] for packet in aedat.Decoder(path) if "events" in packet]


def aedat_columns(path: Path) -> Columns:
    """aedat's packets as columns."""
    return _joined(bare_aedat(path))


def bare_h5py(path: Path) -> list[np.ndarray]:
    """The four columns as they are stored."""
    with h5py.File(path) as file:
        return [file["events"][name][:] for name in file["events"]]


def h5py_event_utils(path: Path) -> Columns:
    """Pixels that are stored with a sign, seconds as float64, polarity as bool."""
    with h5py.File(path) as file:
        x, y, seconds, on = (file["events"][name][:] for name in ("xs", "ys", "ts", "ps"))
    return x.view(np.uint16), y.view(np.uint16), _microseconds(seconds), _signs(on)


def h5py_dsec(path: Path) -> Columns:
    """Stamps of 32 bits that count from `t_offset`, polarity as 0 and 1."""
    with h5py.File(path) as file:
        x, y, t, p = (file["events"][name][:] for name in "xytp")
        t = t.astype(np.int64)
        t += file["t_offset"][()]
    return x, y, t, _signs(p)


def numpy_columns(path: Path) -> Columns:
    """The four columns, stored as they are wanted."""
    with np.load(path) as archive:
        x, y, t, p = (archive[axis] for axis in "xytp")
    return x, y, t, p


def loadtxt(path: Path) -> Columns:
    """numpy's own text parser."""
    t, x, y, p = np.loadtxt(path, unpack=True)
    return x.astype(np.uint16), y.astype(np.uint16), _microseconds(t), _signs(p > 0)


@dataclass(frozen=True)
class Pair:
    """A file, the library to hold against, and the library with nothing turned into anything."""

    path: Path
    library: Callable[[Path], Columns]
    bare: Callable[[Path], object] | None


def _files(folder: Path, wanted: list[str]) -> dict[str, Pair]:
    """A file of each format that is wanted."""
    events = _events()
    recording = recording_of_events(events)
    files: dict[str, Pair] = {}
    layouts: tuple[tuple[Layout, str, Callable[[Path], Columns], Callable[[Path], object] | None], ...] = (
        ("event_utils", "event_utils.h5", h5py_event_utils, bare_h5py),
        ("dsec", "dsec.h5", h5py_dsec, bare_h5py),
        ("npz", "columns.npz", numpy_columns, None),
        ("aedat4", "events.aedat4", aedat_columns, bare_aedat),
        ("evt3", "evt3.raw", faery_columns, bare_faery),
    )
    for layout, name, library, bare in layouts:
        if layout in wanted:
            write_recording(recording, folder / name, layout)
            files[layout] = Pair(folder / name, library, bare)
    if "evt3 rows" in wanted:
        write_recording(recording_of_events(_rows()), folder / "rows.raw", "evt3")
        files["evt3 rows"] = Pair(folder / "rows.raw", faery_columns, bare_faery)
    packet = np.empty(len(events), faery.EVENTS_DTYPE)
    packet["t"], packet["x"], packet["y"], packet["on"] = events.t, events.x, events.y, events.p > 0
    for kind, name, version in (
        ("evt2", "evt2.raw", "evt2"),
        ("dat", "cd.dat", None),
        ("event stream", "dvs.es", None),
    ):
        if kind in wanted:
            size = (SENSOR.width, SENSOR.height)
            faery.events_stream_from_array(packet, size).to_file(folder / name, version=version)
            files[kind] = Pair(folder / name, faery_columns, bare_faery)
    if "RPG text" in wanted:
        rows = zip(events.t.tolist(), events.x.tolist(), events.y.tolist(), (events.p > 0).tolist(), strict=True)
        with (folder / "events.txt").open("w") as file:
            file.writelines(f"{t / 1e6:.9f} {x} {y} {p:d}\n" for t, x, y, p in rows)
        files["RPG text"] = Pair(folder / "events.txt", faery_columns, bare_faery)
    return files


def _agree(pair: Pair) -> None:
    """Both ways give the same columns; t up to a clock that begins elsewhere."""
    for mine, theirs in zip(ours(pair.path), pair.library(pair.path), strict=True):
        assert mine.dtype == theirs.dtype
        assert len(mine) == len(theirs) == NUM_EVENTS
        shift = mine[0] - theirs[0] if mine.dtype == np.int64 else 0
        for part in (slice(0, ALIKE), slice(-ALIKE, None)):
            assert np.array_equal(mine[part], theirs[part] + shift)


def _timed(kind: str, pair: Pair) -> list[dict[str, object]]:
    _agree(pair)
    ways: dict[str, Callable[[], object]] = {
        "ours": partial(ours, pair.path),
        pair.library.__name__: partial(pair.library, pair.path),
    }
    if pair.bare is not None:
        ways[pair.bare.__name__] = partial(pair.bare, pair.path)
    seconds = best_of_each(ways, RUNS, clock=time.process_time)
    if kind == "RPG text":
        seconds["loadtxt"] = best_of_each({"loadtxt": partial(loadtxt, pair.path)}, 1, clock=time.process_time)[
            "loadtxt"
        ]
    return [
        {
            "format": kind,
            "way": name,
            "million_events_per_cpu_s": NUM_EVENTS / took / 1e6,
            "times_the_library": seconds[pair.library.__name__] / took,
        }
        for name, took in seconds.items()
    ]


ALL = ("event_utils", "dsec", "npz", "aedat4", "evt3", "evt3 rows", "evt2", "dat", "event stream", "RPG text")


def main() -> None:
    """Time each pair in turn."""
    wanted = sys.argv[1:] or list(ALL)
    with tempfile.TemporaryDirectory() as folder:
        rows = [row for kind, pair in _files(Path(folder), wanted).items() for row in _timed(kind, pair)]
    if len(wanted) == len(ALL):
        report("readers", rows)
    else:
        for row in rows:
            print(row)


if __name__ == "__main__":
    main()

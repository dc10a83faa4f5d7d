"""Whole files of made-up events into memory, by CPU time: ours beside the library it wraps."""

from __future__ import annotations

import tempfile
import time
from collections.abc import Callable, Iterable
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
from etnet.events.write import write_recording

NUM_EVENTS, SENSOR = 2_000_000, Sensor(346, 260)


def _events() -> Events:
    """Bursts of neighbouring pixels, as moving edges make them."""
    rng = np.random.default_rng(0)
    x = (np.repeat(rng.integers(0, SENSOR.width, NUM_EVENTS // 8), 8) + rng.integers(0, 9, NUM_EVENTS)) % SENSOR.width
    y = (np.repeat(rng.integers(0, SENSOR.height, NUM_EVENTS // 8), 8) + rng.integers(0, 3, NUM_EVENTS)) % SENSOR.height
    t = np.cumsum(rng.integers(0, 3, NUM_EVENTS))
    return Events(x.astype(np.uint16), y.astype(np.uint16), t, rng.choice([-1, 1], NUM_EVENTS).astype(np.int8), SENSOR)


def ours(path: Path) -> int:
    """Open a recording and read all of it."""
    with open_recording(path, assume=Assumptions(width=SENSOR.width, height=SENSOR.height)) as recording:
        return len(recording.read(0, recording.num_events))


def _held(packets: Iterable[np.ndarray]) -> int:
    """A recording can be read again and anywhere, so the library's events have to be kept as well."""
    return sum(map(len, list(packets)))


def through_faery(path: Path) -> int:
    """All packets, decoded and held as the library gives them; text as t in s, x, y, p."""
    if path.suffix != ".txt":
        return _held(faery.events_stream_from_file(path))
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
    stream = faery.events_stream_from_file(path, file_type="csv", csv_properties=kind, dimensions_fallback=(346, 260))
    return _held(stream)


def through_aedat(path: Path) -> int:
    """All packets, decoded and held as the library gives them."""
    return _held(packet["events"] for packet in aedat.Decoder(path) if "events" in packet)


def through_h5py(path: Path) -> int:
    """The four columns as they are stored."""
    with h5py.File(path) as file:
        columns = [file["events"][name][:] for name in file["events"]]
    return len(columns[0])


def through_numpy(path: Path) -> int:
    """The four columns as they are stored."""
    with np.load(path) as archive:
        columns = [archive[axis] for axis in "xytp"]
    return len(columns[0])


def through_loadtxt(path: Path) -> int:
    """numpy's own text parser."""
    return len(np.loadtxt(path))


def _files(folder: Path) -> dict[str, tuple[Path, Callable[[Path], int]]]:
    """A file of each format and the library to hold against."""
    events = _events()
    recording = recording_of_events(events)
    files: dict[str, tuple[Path, Callable[[Path], int]]] = {}
    for layout, name, library in (
        ("event_utils", "event_utils.h5", through_h5py),
        ("dsec", "dsec.h5", through_h5py),
        ("npz", "columns.npz", through_numpy),
        ("aedat4", "events.aedat4", through_aedat),
        ("evt3", "evt3.raw", through_faery),
    ):
        write_recording(recording, folder / name, layout)
        files[layout] = (folder / name, library)
    packet = np.empty(len(events), faery.EVENTS_DTYPE)
    packet["t"], packet["x"], packet["y"], packet["on"] = events.t, events.x, events.y, events.p > 0
    for kind, name, version in (
        ("evt2", "evt2.raw", "evt2"),
        ("dat", "cd.dat", None),
        ("event stream", "dvs.es", None),
    ):
        faery.events_stream_from_array(packet, (346, 260)).to_file(folder / name, version=version)
        files[kind] = (folder / name, through_faery)
    rows = zip(events.t.tolist(), events.x.tolist(), events.y.tolist(), (events.p > 0).tolist(), strict=True)
    with (folder / "events.txt").open("w") as file:
        file.writelines(f"{t / 1e6:.9f} {x} {y} {p:d}\n" for t, x, y, p in rows)
    files["RPG text"] = (folder / "events.txt", through_faery)
    return files


def main() -> None:
    """Time each pair in turn."""
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        files = _files(Path(folder))
        for kind, (path, library) in files.items():
            assert ours(path) == library(path) == NUM_EVENTS
            rivals = {"ours": partial(ours, path), library.__name__: partial(library, path)}
            if kind == "RPG text":
                rivals["through_loadtxt"] = partial(through_loadtxt, path)
            seconds = best_of_each(rivals, clock=time.process_time)
            for name, took in seconds.items():
                rows.append(
                    {
                        "format": kind,
                        "way": name,
                        "million_events_per_cpu_s": NUM_EVENTS / took / 1e6,
                        "times_the_library": seconds[library.__name__] / took,
                    }
                )
    report("readers", rows)


if __name__ == "__main__":
    main()

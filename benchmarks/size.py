"""Files of many gigabytes: how long until they are open, until any moment is shown, and how much memory that takes.

`python size.py --gigabytes 10 --folder /where/there/is/room`. The files are made here and removed again. Each is opened
first with no index (a second of patience), then, when the index is there, by a new process with torch and a network.
"""

from __future__ import annotations

import argparse
import json
import os
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import h5py
import numpy as np
from measure import report

from etnet.events.events import Events, Sensor
from etnet.events.index_store import index_folder
from etnet.events.open import open_recording
from etnet.events.recording import recording_of_events
from etnet.events.write import write_recording

SENSOR, NUM_IN_PATTERN, TURN = Sensor(1280, 720), 8_000_000, 1 << 24
NUM_SCRUBS, WINDOW = 200, 30_000


def _pattern() -> Events:
    """Events of 16.8 s, the time after which EVT3's clock begins anew."""
    rng = np.random.default_rng(0)
    x = (
        np.repeat(rng.integers(0, SENSOR.width, NUM_IN_PATTERN // 8), 8) + np.tile(np.arange(8), NUM_IN_PATTERN // 8)
    ) % SENSOR.width
    y = np.repeat(rng.integers(0, SENSOR.height, NUM_IN_PATTERN // 8), 8)
    t = np.sort(rng.integers(0, TURN, NUM_IN_PATTERN))
    t[0], t[-1] = 0, TURN - 1
    return Events(x.astype(np.uint16), y.astype(np.uint16), t, rng.choice(np.array([-1, 1], np.int8), len(t)), SENSOR)


def make_evt3(path: Path, num_bytes: int) -> None:
    """One turn of the clock again and again, which is a stream without end."""
    write_recording(recording_of_events(_pattern()), path)
    content = path.read_bytes()
    start = content.index(b"\n", content.index(b"% t0")) + 1
    with path.open("ab") as file:
        while file.tell() < num_bytes:
            file.write(content[start:])


def make_event_utils(path: Path, num_bytes: int) -> None:
    """Plain columns of 13 bytes an event, in chunks as HQF has them."""
    events, place = _pattern(), 0
    with h5py.File(path, "w") as file:
        kinds = {"xs": "i2", "ys": "i2", "ts": "f8", "ps": "?"}
        table = {
            name: file.create_dataset(f"events/{name}", (0,), kind, maxshape=(None,), chunks=(1 << 15,))
            for name, kind in kinds.items()
        }
        file.attrs["sensor_resolution"] = (SENSOR.height, SENSOR.width)
        while place * 13 < num_bytes:
            stop = place + len(events)
            stamps = (events.t + place // NUM_IN_PATTERN * TURN) / 1e6
            for name, values in zip(kinds, (events.x, events.y, stamps, events.p > 0), strict=True):
                table[name].resize((stop,))
                table[name][place:stop] = values
            place = stop


def measure(path: Path) -> dict[str, float]:
    """In a process of its own: torch and a network first, then the file; seconds, milliseconds and megabytes."""
    import torch  # noqa: F401

    from etnet.nets.weights import load_model

    model = load_model("etnet-half")
    had_index = any(index_folder().glob("*.index"))
    started = began = time.perf_counter()
    recording = open_recording(path, patience=1.0)
    opened = time.perf_counter() - began
    first = recording.num_events
    rng, took = np.random.default_rng(1), []
    for moment in rng.integers(recording.span.start, recording.span.stop, NUM_SCRUBS):
        began = time.perf_counter()
        start = min(recording.index_at(int(moment)), first - WINDOW)
        assert len(recording.read(start, start + WINDOW)) == WINDOW
        took.append(1000 * (time.perf_counter() - began))
    while not any(index_folder().glob("*.index")):
        time.sleep(0.1)
    waited = time.perf_counter() - started
    del model
    return {
        "open_s": opened,
        "events_shown": first,
        "scrub_ms_median": float(np.median(took)),
        "scrub_ms_95": float(np.percentile(took, 95)),
        "scrub_ms_worst": max(took),
        "index_ready_after_s": 0.0 if had_index else waited,
        "resident_mb": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024,
    }


def main() -> None:
    """Make, measure twice, remove."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--gigabytes", type=float, default=10)
    parser.add_argument("--folder", type=Path, default=None)
    parser.add_argument("--measure", type=Path, default=None)
    options = parser.parse_args()
    if options.measure is not None:
        print(json.dumps(measure(options.measure)))
        return
    rows: list[dict[str, object]] = []
    for name, make in (("evt3.raw", make_evt3), ("event_utils.h5", make_event_utils)):
        with tempfile.TemporaryDirectory(dir=options.folder) as folder:
            path = Path(folder) / name
            make(path, int(options.gigabytes * 1e9))
            for index in ("none", "kept"):
                command = [sys.executable, __file__, "--measure", str(path)]
                environment = {**os.environ, "ETNET_CACHE": f"{folder}/cache"}
                said = subprocess.run(command, env=environment, check=True, capture_output=True, text=True).stdout
                size = path.stat().st_size / 1e9
                rows.append({"file": name, "gigabytes": size, "index": index, **json.loads(said)})
                print(rows[-1], flush=True)
    report("size", rows)


if __name__ == "__main__":
    main()

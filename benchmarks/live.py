"""Live sources: whether 10 Mev/s at 1280×720 are taken in without falling behind or growing; faery as the rival.

`python live.py --seconds 60`. Times are CPU seconds of this process; ratios are to what faery takes in the same run.
"""

from __future__ import annotations

import argparse
import tempfile
import time
from array import array
from collections.abc import Callable
from pathlib import Path

import faery
import numpy as np
from faery.file_encoder import events_to_file
from measure import best_of_each, report

from etnet.events.events import Events, Sensor
from etnet.events.recording import Recording, recording_of_events
from etnet.live.buffer import Keep, LiveBuffer
from etnet.live.layouts import EVENT_STREAM_HEAD, decoder_of
from etnet.live.record import Recorder
from etnet.live.recording import LiveRecording
from etnet.live.replay import Replay
from etnet.live.source import no_triggers
from etnet.live.windows import LiveWindows
from etnet.windows import ByDuration

SENSOR = Sensor(1280, 720)
PIECE = 1 << 20


def _events(rate: float, seconds: float) -> Events:
    """Moving edges: runs of neighbouring pixels, as a sensor's readout gives them."""
    rng, num = np.random.default_rng(0), int(rate * seconds)
    num_runs = num // 8
    x = (np.repeat(rng.integers(0, SENSOR.width, num_runs), 8) + np.tile(np.arange(8), num_runs)) % SENSOR.width
    y = np.repeat(rng.integers(0, SENSOR.height, num_runs), 8)
    t = np.repeat(np.sort(rng.integers(0, int(seconds * 1e6), num_runs)), 8)
    p = np.repeat(rng.choice(np.array([-1, 1], np.int8), num_runs), 8)
    return Events(x.astype(np.uint16), y.astype(np.uint16), t, p, SENSOR)


def _resident() -> float:
    """MB that this process holds now."""
    return int(Path("/proc/self/statm").read_text().split()[1]) * 4096 / 1e6


def paced(recording: Recording, seconds: float, out: Path | None = None) -> dict[str, object]:
    """Replay at its own speed, round and round, and a network's windows taken every 40 ms."""
    keep = Keep(seconds=5)
    live = LiveRecording(Replay(recording, is_looped=True), keep)
    recorder = None if out is None else Recorder(live, out, first=0)
    windows, late, resident = LiveWindows(live, ByDuration(40_000)), array("d"), array("d")
    busy, began = time.process_time(), time.monotonic()
    with live:
        while (elapsed := time.monotonic() - began) < seconds:
            window = windows.take(timeout=0.2)
            if window is not None:
                live.buffer.read(window.start, window.stop)
            extent = live.extent()
            elapsed = time.monotonic() - began
            if extent.until is not None and elapsed > 1:
                late.append(1000 * elapsed - (extent.until - recording.span.start) / 1000)
                resident.append(_resident())
    num_events = live.extent().num_events
    row: dict[str, object] = {
        "what": "replay at its own speed" + ("" if out is None else f", recorded as {out.suffix}"),
        "seconds": seconds,
        "mev_per_s": num_events / seconds / 1e6,
        "late_ms_median": float(np.median(late)),
        "late_ms_99": float(np.percentile(late, 99)),
        "late_ms_worst": max(late),
        "windows_merged": windows.num_merged,
        "resident_mb_of_each_tenth": [round(float(np.median(part))) for part in np.array_split(resident, 10)],
        "resident_mb_most": round(max(resident)),
        "cpu_share": (time.process_time() - busy) / seconds,
    }
    if recorder is not None:
        recorder.stop()
        row["missing_events"] = recorder.num_missing
    return row


def reading(folder: Path, events: Events) -> list[dict[str, object]]:
    """Mev per CPU second of taking in and decoding, beside faery's decoders of the same bytes."""
    packet = np.empty(len(events), faery.EVENTS_DTYPE)
    packet["t"], packet["x"], packet["y"], packet["on"] = events.t, events.x, events.y, events.p > 0
    path = folder / "events.es"
    size = (SENSOR.width, SENSOR.height)
    events_to_file(iter([packet]), path, size, file_type="es", use_write_suffix=False)
    stream, records = path.read_bytes(), packet.tobytes()

    def ours(layout, content: bytes) -> Callable[[], object]:
        def run() -> int:
            decoder = decoder_of(layout, SENSOR)
            return sum(len(decoder.decode(content[i : i + PIECE])) for i in range(0, len(content), PIECE))

        return run

    def theirs_es() -> int:
        return sum(len(part) for part in faery.events_stream_from_file(path))

    def theirs_records() -> int:
        # What faery's own receiver does with the bytes of a datagram.
        parts = (np.frombuffer(records[i : i + 13 * 4096], faery.EVENTS_DTYPE) for i in range(0, len(records), 53_248))
        return sum(len(part) for part in parts if part["t"][0] >= 0)

    def taken_in() -> None:
        buffer = LiveBuffer(SENSOR, Keep(seconds=5))
        for start in range(0, len(events), 50_000):
            buffer.add(events[start : start + 50_000], None, (), no_triggers())

    calls = {
        "Event Stream, ours": ours("es", stream[EVENT_STREAM_HEAD:]),
        "Event Stream, faery": theirs_es,
        "t64 records, ours (decoded and checked)": ours("t64_x16_y16_on8", records),
        "t64 records, faery (a view of the bytes)": theirs_records,
        "into the buffer": taken_in,
    }
    took = best_of_each(calls, 5, time.process_time)
    return [{"what": name, "mev_per_cpu_s": len(events) / seconds / 1e6} for name, seconds in took.items()]


def main() -> None:
    """Measure and keep."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seconds", type=float, default=30)
    parser.add_argument("--rate", type=float, default=10e6)
    options = parser.parse_args()
    rows: list[dict[str, object]] = []
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        rows += reading(folder, _events(4e6, 1.0))
        events = _events(options.rate, 2.0)
        recording = recording_of_events(events, "made up")
        rows.append(paced(recording, options.seconds))
        for suffix in (".aedat4", ".h5"):
            rows.append(paced(recording, min(options.seconds, 10), folder / f"live{suffix}"))
    report("live", rows)


if __name__ == "__main__":
    main()

"""Seek times of `Playback` in recordings of 10 s, 1 min and 10 min, beside a full replay from the start.

The recordings repeat a bundled one end to end, so that their events are like those of a real sensor. Seeks go to
random windows after the first pass has laid its states within the byte budget; the frame cache is left empty.
The last rows are a program that is started again: its first frames with a cache on disk beside those without one.
"""

import argparse
import random
import statistics
import tempfile
import time
from pathlib import Path

import numpy as np
import torch
from measure import report

from etnet.bundled import samples
from etnet.events.events import Events
from etnet.events.open import open_recording
from etnet.events.recording import Recording, Span
from etnet.nets.weights import load_model
from etnet.playback.disk_cache import DiskCache
from etnet.playback.playback import Playback
from etnet.windows import ByDuration, plan_windows

WINDOW = 40_000
BUDGET = 512 << 20
NUM_SEEKS = 12


class RepeatedSource:
    """One recording again and again; nothing is copied but what is read."""

    def __init__(self, events: Events, period: int, times: int) -> None:
        self.events, self.period, self.times = events, period, times

    @property
    def num_events(self) -> int:
        return len(self.events) * self.times

    def read(self, start: int, stop: int) -> Events:
        parts = []
        for repeat in range(start // len(self.events), -(-stop // len(self.events))):
            offset = repeat * len(self.events)
            part = self.events[max(start - offset, 0) : min(stop - offset, len(self.events))]
            parts.append(Events(part.x, part.y, part.t + repeat * self.period, part.p, part.sensor))
        return Events.concatenate(parts, self.events.sensor)

    def close(self) -> None:
        pass


def repeated(recording: Recording, seconds: int) -> Recording:
    """The recording, repeated to `seconds`."""
    events = recording.read(0, recording.num_events)
    period = recording.span.duration + 1
    times = -(-seconds * 1_000_000 // period)
    span = Span(recording.span.start, recording.span.stop + (times - 1) * period)
    source = RepeatedSource(events, period, int(times))
    return Recording(f"{seconds} s", "repeated", source, recording.sensor, span)


def measure(seconds: int) -> dict[str, object]:
    """Lay states over the whole recording, then seek at random."""
    recording = repeated(open_recording(samples()[0]), seconds)
    model, windows = load_model("etnet-half"), plan_windows(recording, ByDuration(WINDOW))
    playback = Playback(model, recording, windows, BUDGET)
    start = time.perf_counter()
    playback.lay_state(len(windows) - 1)
    replay = time.perf_counter() - start
    walk, took, replayed = random.Random(0), [], []
    for _ in range(NUM_SEEKS):
        index = walk.randrange(len(windows))
        replayed.append(playback.plan(index).num_replayed)
        start = time.perf_counter()
        playback.at(index)
        took.append(time.perf_counter() - start)
    neighbour = time.perf_counter()
    playback.at(max(0, index - 1))
    neighbour = time.perf_counter() - neighbour
    return {
        "recording_s": seconds,
        "windows": len(windows),
        "states_held": sum(len(held) for held in playback.cached().states),
        "median_seek_s": statistics.median(took),
        "worst_seek_s": max(took),
        "median_replayed": float(np.median(replayed)),
        "neighbour_s": neighbour,
        "full_replay_s": replay,
        "median_to_full_replay": statistics.median(took) / replay,
    }


def measure_restart(seconds: int) -> list[dict[str, object]]:
    """A frame that an earlier run made, and one between its states, with and without the cache on disk."""
    recording, model = repeated(open_recording(samples()[0]), seconds), load_model("etnet-half")
    windows, rows = plan_windows(recording, ByDuration(WINDOW)), []
    visited, between = len(windows) - 1, len(windows) // 2
    with tempfile.TemporaryDirectory() as folder:
        first = DiskCache(Path(folder))
        playback = Playback(model, recording, windows, BUDGET, first)
        for index in range(visited):
            playback.lay_state(index)
            first.flush()
        playback.at(visited)
        first.flush()
        for name, disk in (("without", None), ("with", DiskCache(Path(folder)))):
            start = time.perf_counter()
            again = Playback(model, recording, windows, BUDGET, disk)
            opened = time.perf_counter() - start
            start = time.perf_counter()
            if again.frame(visited) is None:
                again.at(visited)
            took = time.perf_counter() - start
            again = Playback(model, recording, windows, BUDGET, disk)
            start = time.perf_counter()
            again.at(between)
            far = time.perf_counter() - start
            if disk is not None:
                disk.flush()
            rows.append(
                {"restart": name, "windows": len(windows), "open_s": opened, "visited_s": took, "far_seek_s": far}
            )
    return rows


def main() -> None:
    """Measure the three lengths, and a restart; with --restart that alone."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--restart", action="store_true")
    about: dict[str, object] = {"threads": torch.get_num_threads()}
    if not parser.parse_args().restart:
        report("seek", [about, *(measure(seconds) for seconds in (10, 60, 600))])
    report("restart", [about, *measure_restart(10)])


if __name__ == "__main__":
    main()

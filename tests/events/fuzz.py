"""Damage done to files, and what may come of it: a recording that reads, or a RecordingError of one line."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np

from etnet.errors import RecordingError
from etnet.events.examine import examine
from etnet.events.open import open_recording

LARGEST_READ = 1 << 20
ROOT = Path(__file__).resolve().parents[2] / "etnet"


def damaged(content: bytes, rng: np.random.Generator) -> bytes:
    """Cut, flip, overwrite, double, or blow up a number, mostly near the beginning where headers are."""
    spoilt = bytearray(content)
    for _ in range(int(rng.integers(1, 4))):
        if not spoilt:
            break
        reach = len(spoilt) if rng.random() < 0.5 else min(len(spoilt), 2048)
        place = int(rng.integers(0, reach))
        kind = rng.integers(0, 6)
        if kind == 0:
            del spoilt[place:]
        elif kind == 1:
            spoilt[place] ^= 1 << int(rng.integers(0, 8))
        elif kind == 2:
            spoilt[place : place + 8] = rng.bytes(int(rng.integers(1, 9)))
        elif kind == 3:
            spoilt[place : place + 4] = b"\xff\xff\xff\x7f"
        elif kind == 4:
            del spoilt[place : place + int(rng.integers(1, 64))]
        else:
            spoilt[place:place] = spoilt[place : place + int(rng.integers(1, 64))]
    return bytes(spoilt)


def is_ours(error: BaseException) -> bool:
    """Whether it was raised in a file of this project, and not of a library that one called."""
    trace = error.__traceback__
    while trace is not None and trace.tb_next is not None:
        trace = trace.tb_next
    return trace is None or ROOT in Path(trace.tb_frame.f_code.co_filename).parents


def try_to_read(path: Path) -> str:
    """Open, read a little, let the doctor look it through. Anything but a RecordingError of our own goes through."""
    try:
        with open_recording(path) as recording:
            stop = min(recording.num_events, LARGEST_READ)
            for start, end in ((0, stop), (recording.num_events - stop, recording.num_events), (stop // 2, stop)):
                events = recording.read(start, end)
                assert len(events) == end - start
                assert (np.diff(events.t) >= 0).all()
                assert len(events) == 0 or (
                    events.x.max() < recording.sensor.width and events.y.max() < recording.sensor.height
                )
            if recording.ground_truth is not None and len(recording.ground_truth):
                frame = recording.ground_truth.read_frame(len(recording.ground_truth) - 1)
                assert frame.ndim == 2
            examine(recording)
            return "opened"
    except RecordingError as refusal:
        cause: BaseException | None = refusal
        while cause is not None:
            # Slips of our own must not hide behind the containment of libraries, which assert what a file should be.
            is_slip = isinstance(cause, (AssertionError, NameError, AttributeError))
            if (is_slip and is_ours(cause)) or "TypeCheck" in type(cause).__name__:
                raise cause from None
            cause = cause.__cause__
        return "refused" if "\n" not in str(refusal) else "a refusal of several lines"


def fuzz(seed_file: Path, folder: Path, num_rounds: int, rng: np.random.Generator) -> dict[str, int]:
    """Damage a file again and again; counts what came of it."""
    content, counts = seed_file.read_bytes(), {"opened": 0, "refused": 0}
    for number in range(num_rounds):
        path = folder / f"{number}{seed_file.suffix}"
        path.write_bytes(damaged(content, rng))
        counts[try_to_read(path)] += 1
        path.unlink()
    shutil.rmtree(folder, ignore_errors=True)
    return counts

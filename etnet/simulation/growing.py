"""A video becomes a recording page by page: what is simulated by now can be read while the rest is being made."""

from __future__ import annotations

import time
from collections.abc import Callable
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from threading import Condition

import h5py
import numpy as np
from jaxtyping import Float32, Int64

from etnet.errors import Cancelled, EtnetError, RecordingError
from etnet.events.cache import grey
from etnet.events.events import Events, Sensor
from etnet.events.formats.hdf5.writing import WrittenFile, written_file
from etnet.events.recording import GroundTruth, Recording, Remark, Span
from etnet.files import cannot_write
from etnet.simulation.beginning import Beginning
from etnet.simulation.footage import Footage
from etnet.simulation.video import Shown, VideoConfig, footage_of, simulated

FEWEST_FRAMES = 4
"""Before so many there is nothing to show."""
LARGEST = 2 << 30
"""Bytes of one simulation on disk; what comes after is left out, and said."""
LOOK_AT_SIZE = 64
"""Frames from one look at the size of the file to the next."""


@dataclass(frozen=True, slots=True)
class Pace:
    """How far a simulation is. Seconds of video, and seconds of work that one of them takes (`None`: not known yet)."""

    done: float
    total: float
    work: float | None
    is_over: bool


@dataclass(frozen=True)
class _Grown:
    """The events that were there at one moment. File and datasets are the writer's own: HDF5 locks within a process."""

    file: h5py.File
    num_events: int
    sensor: Sensor

    def read(self, start: int, stop: int) -> Events:
        """Events start … stop − 1."""
        x, y, t, p = (np.asarray(self.file[f"events/{name}"][start:stop]) for name in ("xs", "ys", "ts", "ps"))  # pyright: ignore[reportIndexIssue]
        signed = np.where(p, 1, -1).astype(np.int8)
        return Events(x.astype(np.uint16), y.astype(np.uint16), np.rint(t * 1e6).astype(np.int64), signed, self.sensor)

    def close(self) -> None:
        """The file goes with the last recording that reads it."""


class GrowingVideo:
    """Simulates `video` into `out` (the file that `simulate_video` writes). `run` belongs to a thread of its own."""

    def __init__(
        self,
        video: Path,
        out: Path,
        config: VideoConfig,
        name: str,
        largest: int = LARGEST,
        opened: Callable[[Path, VideoConfig, Callable[[], bool]], Footage] | None = None,
        beginning: Beginning | None = None,
    ) -> None:
        """`opened` gives the video's frames, and may ask while it waits for one whether it is cancelled.

        `beginning`: that of this video, seen at this size; what is known of it is not computed once more.
        """
        self.config, self._beginning = config, beginning
        self._video, self._out, self._name, self._largest = video, out, name, largest
        self._opened = opened or (lambda video, config, is_cancelled: footage_of(video, config))
        self._changed = Condition()
        self._file: WrittenFile | None = None
        self._frames: Footage | None = None
        self._stamps: list[int] = []
        self._shown = Shown(-1, 0, 0, 0)
        self._work = 0.0
        self._ended = ""
        self._trouble: EtnetError | None = None
        self._is_over = False
        self._newest: Recording | None = None

    def run(self, is_cancelled: Callable[[], bool]) -> None:
        """Simulate to the end, or until cancelled. What goes wrong is raised by `wait` and `recording`."""
        try:
            with closing(self._opened(self._video, self.config, is_cancelled)) as frames:
                file = written_file(self._out, libver=("v110", "v110"))
                with self._changed:
                    self._file, self._frames = file, frames
                self._simulate(file, frames, is_cancelled)
        except EtnetError as error:
            self._end(error)
        except OSError as error:
            self._end(cannot_write(Path(self._name), error))
        except Exception as error:
            self._end(RecordingError(f"{self._name}: cannot be simulated ({error})"))
        else:
            self._end(None)

    def wait(self, is_cancelled: Callable[[], bool], patience: float = 0.1) -> Recording:
        """The recording, once there is enough of it to show."""
        with self._changed:
            while not (self._is_over or (len(self._stamps) >= FEWEST_FRAMES and self._shown.num_events)):
                if is_cancelled():
                    raise Cancelled("nobody wants this simulation any more")
                self._changed.wait(patience)
        return self.recording()

    def recording(self) -> Recording:
        """What there is by now; the same object while nothing was added."""
        with self._changed:
            if self._trouble is not None and not self._is_enough:
                raise self._trouble
            if self._file is None or self._frames is None or not self._is_enough:
                raise RecordingError(f"{self._name}: nothing moves in it, so an event sensor sees nothing")
            held = self._newest
            truth = held.ground_truth if held is not None else None
            is_same = truth is not None and len(truth) == len(self._stamps)
            if held is None or not is_same or (self._is_over and held.latest is not None):
                self._newest = held = self._snapshot(self._file, self._frames.sensor, held)
            return held

    @property
    def has_failed(self) -> bool:
        """Whether an error ended it before there was anything to show; begun again, it may come to something."""
        with self._changed:
            return self._trouble is not None and not self._is_enough

    @property
    def _is_enough(self) -> bool:
        return len(self._stamps) >= 2 and self._shown.num_events > 0

    @property
    def pace(self) -> Pace:
        """How far it is."""
        with self._changed:
            if self._frames is None:
                return Pace(0.0, 0.0, None, self._is_over)
            done = (self._stamps[-1] + self._frames.interval) / 1e6 if self._stamps else 0.0
            total = done if self._is_over else max(self._frames.duration, done)
            return Pace(done, total, self._work / done if done else None, self._is_over)

    def _simulate(self, file: WrittenFile, frames: Footage, is_cancelled: Callable[[], bool]) -> None:
        began = time.thread_time()
        for shown in simulated(file, frames, self.config, beginning=self._beginning):
            if is_cancelled():
                raise Cancelled("the simulation was stopped")
            file.check()
            with self._changed:
                self._shown = shown
                self._stamps.append(shown.stamp)
                self._work = time.thread_time() - began
                self._changed.notify_all()
            if (shown.frame + 1) % LOOK_AT_SIZE == 0 and file.id.get_filesize() > self._largest:
                size, at = self._largest >> 20, shown.stamp / 1e6
                self._ended = f"simulated for {at:.1f} s only: its events then fill {size:,} MB"
                return

    def _end(self, trouble: EtnetError | None) -> None:
        with self._changed:
            self._trouble = trouble
            if trouble is not None and not isinstance(trouble, Cancelled):
                self._ended = self._ended or str(trouble)
            self._is_over = True
            self._changed.notify_all()

    def _snapshot(self, file: h5py.File, sensor: Sensor, before: Recording | None) -> Recording:
        stamps: Int64[np.ndarray, " n"] = np.array(self._stamps, np.int64)
        source = _Grown(file, self._shown.num_events, sensor)
        first = before.span.start if before is not None else int(source.read(0, 1).t[0])

        def read_frame(index: int) -> Float32[np.ndarray, "h w"]:
            return grey(np.asarray(file[f"images/image{index:09d}"]), is_bgr=True)

        values = f"contrast {self.config.contrast:g}, noise {self.config.noise:g}"
        values += f", bandwidth {self.config.cutoff_hz:g} Hz" if self.config.cutoff_hz else ""
        remarks = [Remark("assumed", f"simulated from a video (ESIM, {values}, {sensor} pixels)")]
        if self._frames is not None:
            remarks += [Remark("assumed", said) for said in list(self._frames.remarks)]
        if self._ended:
            remarks.append(Remark("assumed", self._ended))
        return Recording(
            self._name, "a video, simulated", source, sensor, Span(first, self._shown.last_event), tuple(remarks),
            GroundTruth(stamps, read_frame), self._out, latest=None if self._is_over else self.recording,
        )  # fmt: skip

"""Record what comes live while it comes: AEDAT4 or event_utils HDF5, with frames and triggers, and a log beside it.

The recorder reads the live buffer in a thread of its own, so a slow disk delays neither camera nor network. What leaves
the buffer before it is written is missing in the file, and counted.
"""

from __future__ import annotations

import contextlib
from collections.abc import Sequence
from pathlib import Path
from threading import Event, Thread
from typing import Protocol, runtime_checkable

from etnet.errors import EtnetError, RecordingError
from etnet.events.events import Events
from etnet.events.recording import Bracketing
from etnet.events.triggers import Triggers
from etnet.files import check_target
from etnet.live.log import LogWriter, log_of
from etnet.live.recording import LiveRecording, Loss
from etnet.live.source import CameraFrame, Setting
from etnet.live.windows import KeptWindows

FLUSH_SECONDS = 0.5
"""From one flush to the next: what a kill costs at most."""
BATCH = 1 << 18
"""Events that are written at once."""

_SUFFIXES = (".aedat4", ".h5", ".hdf5")


@runtime_checkable
class _Writer(Protocol):
    num_events: int

    def add_events(self, events: Events) -> None: ...
    def add_frame(self, frame: CameraFrame, num_before: int) -> None: ...
    def add_triggers(self, triggers: Triggers) -> None: ...
    def flush(self) -> None: ...
    def close(self) -> None: ...


class Recorder:
    """Writes `live` to `path` from now on, or from event `first` on, until `stop`.

    A file that opens is there from the first moment; a kill leaves all up to the last flush.
    """

    def __init__(self, live: LiveRecording, path: Path, *, first: int | None = None, overwrite: bool = False) -> None:
        check_recordable(path, overwrite)
        self.live, self.path = live, path
        self.first = live.extent().num_events if first is None else first
        """The number of the file's first event."""
        self.num_missing = 0
        """Events that had left the buffer before the disk got to them."""
        self._at, self._frame_at, self._trigger_at, self._note_at, self._window_at = self.first, 0, 0, 0, 0
        if first is None:
            self._skip_what_was()  # before the settings are asked: a change in between is told twice, and never lost
        self._windows: KeptWindows | None = None
        self._told_loss, self._told_missing = Loss(), 0
        self._trouble: EtnetError | None = None
        try:
            settings = live.source.settings()
            self._writer: _Writer = _writer_of(path, live, settings)
            self._log = LogWriter(path, live.source.name, live.sensor)
            self._log.settings(live.extent().until or 0, settings)
        except OSError as error:
            raise RecordingError(f"{path.name}: cannot be recorded to ({error.strerror or error})") from error
        self._stopped = Event()
        self._thread = Thread(target=self._run, name=f"record {path.name}", daemon=True)
        self._thread.start()

    def follow(self, windows: KeptWindows, policy: str, downsample: int) -> None:
        """Keep these windows in the log, those before `first` left out, and how the network sees the events."""
        self._log.seen_through(policy, downsample)
        self._windows = windows

    @property
    def num_events(self) -> int:
        """Events in the file by now."""
        return self._writer.num_events

    @property
    def is_over(self) -> bool:
        """Whether it ended, be it by `stop` or by a fault of the disk."""
        return not self._thread.is_alive()

    def stop(self) -> None:
        """Write what is still there and finish the file. Raises RecordingError if the disk failed."""
        self._stopped.set()
        self._thread.join()
        if self._trouble is not None:
            raise self._trouble

    def __enter__(self) -> Recorder:
        return self

    def __exit__(self, *_: object) -> None:
        self.stop()

    def _run(self) -> None:
        try:
            while True:
                is_last = self._stopped.is_set()
                self._catch_up(is_last)
                if is_last:
                    break
                self._stopped.wait(FLUSH_SECONDS)
            self._writer.close()
            self._log.close()
        except EtnetError as error:
            self._trouble = error
        except (OSError, RuntimeError) as error:  # HDF5 words a full disk as a RuntimeError
            reason = getattr(error, "strerror", None) or str(error).splitlines()[0]
            self._trouble = RecordingError(f"{self.path.name}: recording ended, the disk failed ({reason})")
        if self._trouble is not None:
            for file in (self._writer, self._log):
                with contextlib.suppress(EtnetError, OSError, RuntimeError, ValueError):
                    file.close()
            self.live.note(str(self._trouble))

    def _catch_up(self, is_last: bool) -> None:
        extent = self.live.extent()
        while self._at < extent.num_events:
            # Asked anew, and no further than this round goes: the next one counts what left behind its end.
            first_held = min(self.live.extent().first_held, extent.num_events)
            if self._at < first_held:
                self.num_missing += first_held - self._at
                self._at = first_held
                continue
            stop = min(self._at + BATCH, extent.num_events)
            try:
                events = self.live.buffer.read(self._at, stop)
            except RecordingError:
                continue  # it left this very moment
            self._writer.add_events(events)
            self._at = stop
        self._add_frames(extent.until, is_last)
        start, triggers = self.live.buffer.triggers_from(self._trigger_at)
        self._trigger_at = start + len(triggers)
        if len(triggers):
            self._writer.add_triggers(triggers)
        self._writer.flush()
        self._add_to_log()

    def _add_frames(self, until: int | None, is_last: bool) -> None:
        start, frames = self.live.buffer.frames_from(self._frame_at)
        self._frame_at = start
        for frame in frames:
            if not is_last and (until is None or frame.stamp >= until):
                break  # events before it may still come
            self._writer.add_frame(frame, self._num_before(frame.stamp))
            self._frame_at += 1

    def _num_before(self, stamp: int) -> int:
        """Events of the file before a stamp."""
        recording = self.live.recording()
        assert isinstance(recording.source, Bracketing)
        try:
            index = recording.index_at(stamp)
        except RecordingError:
            index = self._at
        return max(0, min(index, self._at) - self.first - self.num_missing)

    def _add_to_log(self) -> None:
        self._note_at, notes = self.live.notes_from(self._note_at)
        for note in notes:
            self._log.note(note)
        windows = self._windows
        if windows is not None:
            self._window_at = max(self._window_at, windows.first_known)
        while windows is not None and self._window_at < len(windows) and windows[self._window_at].stop <= self._at:
            window = windows[self._window_at]
            if window.start >= self.first and self.num_missing == 0:
                self._log.window(window, self.first, windows.num_merged(self._window_at))
            self._window_at += 1
        if self.live.loss != self._told_loss or self.num_missing != self._told_missing:
            self._told_loss, self._told_missing = self.live.loss, self.num_missing
            self._log.loss(self.live.extent().until or 0, self.live.loss, self.num_missing)
        self._log.flush()

    def _skip_what_was(self) -> None:
        """Frames, triggers and notes from before the recording began."""
        start, frames = self.live.buffer.frames_from(0)
        self._frame_at = start + len(frames)
        start, triggers = self.live.buffer.triggers_from(0)
        self._trigger_at = start + len(triggers)
        self._note_at, _ = self.live.notes_from(0)


def check_recordable(path: Path, overwrite: bool, source: str | None = None) -> None:
    """An error if nothing can be recorded there: a suffix without a writer, a file that is there already.

    Also where it is the recording that `source` names: it would be empty before it was replayed.
    """
    if path.suffix.lower() not in _SUFFIXES:
        known = ", ".join(_SUFFIXES)
        raise RecordingError(f'{path.name}: live recordings have no layout for "{path.suffix}"; take one of {known}')
    check_target(path)
    if source is not None and path.exists() and Path(source).exists() and path.samefile(source):
        raise RecordingError(f"{path.name}: is the recording that is replayed; choose another name")
    for there in (path, log_of(path)):
        if there.exists() and not overwrite:
            raise RecordingError(f"{there.name}: is there already; choose another name or allow overwriting")


def _writer_of(path: Path, live: LiveRecording, settings: Sequence[Setting]) -> _Writer:
    """The suffix's writer, imported only now: every viewer loads this module, and few record."""
    if path.suffix.lower() == ".aedat4":
        from etnet.live.aedat4_writer import Aedat4Writer

        return Aedat4Writer(path, live.sensor, live.source.name, settings)
    from etnet.live.hdf5_writer import Hdf5Writer

    return Hdf5Writer(path, live.sensor, live.source.name, settings)

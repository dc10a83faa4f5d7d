"""The log beside a recorded file: the windows as they were cut, what was lost, faults, and the source's settings, first
all as they were at the beginning, then each that was changed.

One JSON object a line, appended, so that a kill costs the last line at most. `RECORDING.live.jsonl` belongs to
`RECORDING`; event numbers in it count from the file's first event.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from etnet.errors import RecordingError, WindowError
from etnet.events.events import Sensor
from etnet.events.recording import Recording
from etnet.live.binning import Downsample
from etnet.live.recording import Loss, Note
from etnet.live.source import Setting
from etnet.plain_values import PlainError, bounded_json
from etnet.windows import Window

_LONGEST_LINE = 4096
_LONGEST_TEXT = 600
"""Signs of a name or a note; JSON writes some of them with six."""
_LARGEST = 1 << 28


def log_of(path: Path) -> Path:
    """Where the log of a recorded file lies."""
    return path.with_name(path.name + ".live.jsonl")


class LogWriter:
    """Appends lines."""

    def __init__(self, recording: Path, source: str, sensor: Sensor) -> None:
        self._file = log_of(recording).open("w", encoding="utf-8", newline="\n")
        self._line({"live": 1, "source": source[:_LONGEST_TEXT], "sensor": [sensor.width, sensor.height]})

    def settings(self, stamp: int, settings: Sequence[Setting]) -> None:
        """What holds from `stamp` (µs) on."""
        for setting in settings:
            self._line({"stamp": stamp, "setting": [setting.name, setting.plain]})

    def seen_through(self, policy: str, downsample: int) -> None:
        """How windows are cut from here on, and how many pixels a side the network sees as one."""
        self._line({"policy": policy, "downsample": downsample})

    def window(self, window: Window, first_event: int, num_merged: int) -> None:
        """One window; `first_event` is the number of the file's first event."""
        row = [window.start - first_event, window.stop - first_event, window.t_start, window.t_stop, num_merged]
        self._line({"window": row})

    def note(self, note: Note) -> None:
        """A fault, its end, or a setting that was changed."""
        line: dict[str, Any] = {"stamp": note.stamp, "note": note.text[:_LONGEST_TEXT]}
        if note.setting is not None:
            line["setting"] = [note.setting.name, note.setting.plain]
        self._line(line)

    def loss(self, stamp: int, loss: Loss, num_missing: int) -> None:
        """What was lost by now; `num_missing` events came and are not in the file."""
        line = {"stamp": stamp, "lost_packets": loss.packets, "held_up": loss.held_up, "missing_events": num_missing}
        self._line(line)

    def flush(self) -> None:
        """What was given so far is in the file from here on."""
        self._file.flush()

    def close(self) -> None:
        """Finish it."""
        self._file.close()

    def _line(self, content: dict[str, Any]) -> None:
        line = json.dumps(content, ensure_ascii=False)
        assert len(line) < _LONGEST_LINE
        self._file.write(line + "\n")


@dataclass(frozen=True, slots=True)
class AsCut:
    """The windows of a recorded file as they were cut live, and the binning under which the network saw them."""

    windows: Sequence[Window]
    num_merged: Sequence[int]
    """How many windows of the policy each holds."""
    downsample: Downsample
    num_cut_off: int
    """Windows whose events are not all in the file, because it was cut short."""


def windows_as_cut(recording: Recording) -> AsCut:
    """Read them from the log beside the recording's file. Raises WindowError if there is none, or it says nothing."""
    if recording.path is None or not log_of(recording.path).is_file():
        name = recording.name if recording.path is None else log_of(recording.path).name
        raise WindowError(f"{name}: there is no log of live windows; only what was recorded live has one")
    log = log_of(recording.path)
    if log.stat().st_size > _LARGEST:
        raise WindowError(f"{log.name}: a log of more than {_LARGEST >> 20} MB; it is no log of windows")
    windows: list[Window] = []
    merged: list[int] = []
    downsample: Downsample = 1
    num_cut_off = 0
    with log.open(encoding="utf-8", errors="replace") as file:
        for number, line in enumerate(file, 1):
            if not line.endswith("\n"):
                break  # the line in which its writer was stopped
            content = _parsed(line, number, log.name)
            if "downsample" in content:
                downsample = _downsample(content["downsample"], number, log.name)
            if "window" in content:
                window, num_merged = _window(content["window"], len(windows), number, log.name)
                if window.stop > recording.num_events:
                    num_cut_off += 1
                elif not num_cut_off:
                    windows.append(window)
                    merged.append(num_merged)
    if not windows:
        raise WindowError(f"{log.name}: holds no windows; the network was not running while it was recorded")
    return AsCut(tuple(windows), tuple(merged), downsample, num_cut_off)


def _parsed(line: str, number: int, name: str) -> dict[str, Any]:
    try:
        content = bounded_json(line, _LONGEST_LINE)
    except PlainError:
        content = None
    if not isinstance(content, dict):
        raise RecordingError(f'{name}: line {number} reads "{line[:60].strip()}"; wanted one JSON object')
    return content


def _downsample(value: Any, number: int, name: str) -> Downsample:
    if value not in (1, 2, 4) or isinstance(value, bool):
        raise RecordingError(f"{name}: line {number} has pixels binned by {str(value)[:40]}; wanted 1, 2 or 4")
    return value


def _window(row: Any, index: int, number: int, name: str) -> tuple[Window, int]:
    if not isinstance(row, list) or len(row) != 5:
        raise RecordingError(f"{name}: line {number} holds no window; wanted start, stop, t_start, t_stop, merged")
    start, stop, t_start, t_stop, num_merged = (_whole(value, number, name) for value in row)
    if not 0 <= start <= stop or t_stop < t_start:
        raise RecordingError(f"{name}: line {number} holds a window that runs backwards: {row}")
    return Window(index, start, stop, t_start, t_stop), num_merged


def _whole(value: Any, number: int, name: str) -> int:
    if not isinstance(value, int) or isinstance(value, bool) or abs(value) >= 2**62:
        raise RecordingError(f"{name}: line {number} has {str(value)[:40]!r} where a whole number should be")
    return value

"""Pictures that lie beside the events, on their way to ground truth: their clock, their range, their order, their size.

A fault of the pictures never costs the events: it is said, and the recording opens without them.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from decimal import ROUND_HALF_EVEN, Decimal
from threading import Lock

import numpy as np
from jaxtyping import Float32, Int64, Shaped

from etnet.errors import RecordingError
from etnet.events.assumptions import TimeUnit
from etnet.events.events import Sensor
from etnet.events.formats.base import Remarks, contained
from etnet.events.formats.camera_frames import in_order
from etnet.events.formats.columns import LARGEST_STAMP, stamps_in_microseconds
from etnet.events.formats.frame_range import colour_picture, grey_picture, judged_range, with_colours_last
from etnet.events.formats.time_unit import PER_SECOND, UNITS
from etnet.events.recording import GroundTruth, Span

MOST_FRAMES = 2_000_000
"""Ten hours at 50 a second."""

ReadFlow = Callable[[int], Float32[np.ndarray, "2 h w"]]


@dataclass(frozen=True)
class Frames:
    """Pictures as a container has them. `stamps` are as stored, `usual` is what they count by the layout's convention.

    `read_raw(i)` gives the numbers of picture i; `white` is what the file itself says is white. `flow`, where the
    layout has it, makes the reader of optical flow from the unit and the stamps in µs.
    """

    stamps: Shaped[np.ndarray, " n"] | Sequence[Decimal]
    usual: TimeUnit
    read_raw: Callable[[int], Shaped[np.ndarray, ...]]
    size: Sensor
    is_bgr: bool | Callable[[int], bool] = False
    white: float | None = None
    flow: Callable[[TimeUnit, Int64[np.ndarray, " n"]], ReadFlow | None] | None = None

    def __len__(self) -> int:
        return len(self.stamps)


def found_frames(look: Callable[[], Frames | None], name: str, remarks: Remarks) -> Frames | None:
    """What `look` finds; None, and that is said, where the pictures are at fault."""
    try:
        with contained(name, "the frames"):
            found = look()
        check_frames(0 if found is None else len(found), name)
    except RecordingError as fault:
        _say_left_out(fault, name, remarks)
        return None
    return found if found is not None and len(found) else None


def check_frames(count: int, where: str) -> None:
    """An error for more frames than anybody takes, before their stamps are read."""
    if count > MOST_FRAMES:
        raise RecordingError(f"{where}: {count:,} frames are more than {MOST_FRAMES:,}")


def attached(
    frames: Frames | None, span: Span, stated: TimeUnit | None, name: str, remarks: Remarks
) -> GroundTruth | None:
    """The pictures on the events' clock, in order, as grey in 0 … 1."""
    if frames is None:
        return None
    try:
        with contained(name, "the frames"):
            return _truth(frames, span, stated, name, remarks)
    except RecordingError as fault:
        _say_left_out(fault, name, remarks)
        return None


def _truth(frames: Frames, span: Span, stated: TimeUnit | None, name: str, remarks: Remarks) -> GroundTruth:
    unit = _unit(frames, span, stated, name, remarks)
    stamps = in_microseconds(frames.stamps, unit, name)
    lock = Lock()

    def read_raw(index: int) -> Shaped[np.ndarray, ...]:
        with lock, contained(name, f"frame {index}"):
            return with_colours_last(frames.read_raw(index))

    black, white = judged_range(len(frames), read_raw, remarks, frames.white)

    def read_frame(index: int) -> Float32[np.ndarray, "h w"]:
        picture = read_raw(index)
        is_bgr = frames.is_bgr if isinstance(frames.is_bgr, bool) else frames.is_bgr(index)
        return grey_picture(picture, black, white, f"{name}: frame {index}", is_bgr)

    def read_colour(index: int) -> Float32[np.ndarray, "h w 3"]:
        picture = read_raw(index)
        is_bgr = frames.is_bgr if isinstance(frames.is_bgr, bool) else frames.is_bgr(index)
        return colour_picture(picture, black, white, f"{name}: frame {index}", is_bgr)

    read_frame(0)
    first = read_raw(0)
    has_colour = first.ndim == 3 and first.shape[2] >= 3
    read_flow = None if frames.flow is None else frames.flow(unit, stamps)
    truth = GroundTruth(stamps, read_frame, read_flow, white, read_colour if has_colour else None)
    return in_order(stamps, truth, remarks)


def _unit(frames: Frames, span: Span, stated: TimeUnit | None, name: str, remarks: Remarks) -> TimeUnit:
    """The stated unit, else the usual one, unless only another one brings the pictures to the events."""
    if stated is not None:
        return stated
    fitting: list[TimeUnit] = [unit for unit in UNITS if _share_beside(frames, unit, span, name) >= 0.5]
    if not fitting or frames.usual in fitting:
        return frames.usual
    remarks.assumed(
        f"the stamps of the frames count {fitting[0]}: in {frames.usual}, as is usual, none would lie among the events"
    )
    return fitting[0]


def _share_beside(frames: Frames, unit: TimeUnit, span: Span, name: str) -> float:
    """Share of the pictures that lie among the events, or no farther from them than a tenth of their time."""
    try:
        stamps = in_microseconds(frames.stamps, unit, name)
    except RecordingError:
        return 0.0
    margin = max(span.duration // 10, 100_000)
    # A hundred pictures in one thousandth of the time are no pictures of it.
    is_spread = len(stamps) < 2 or int(np.ptp(stamps)) * 20 >= span.duration
    beside = np.count_nonzero((stamps >= span.start - margin) & (stamps <= span.stop + margin))
    return float(beside / len(stamps)) if is_spread else 0.0


def in_microseconds(
    stamps: Shaped[np.ndarray, " n"] | Sequence[Decimal], unit: TimeUnit, name: str
) -> Int64[np.ndarray, " n"]:
    """Stamps of pictures as µs, rounded half to even; decimal ones exactly."""
    if isinstance(stamps, np.ndarray):
        return stamps_in_microseconds(stamps, unit, name)
    scale = Decimal(10**6) / PER_SECOND[unit]
    whole = [(stamp * scale).to_integral_value(ROUND_HALF_EVEN) for stamp in stamps]
    if any(abs(stamp) >= LARGEST_STAMP for stamp in whole):
        raise RecordingError(f"{name}: a frame's stamp is no time in {unit}; mend it")
    return np.array([int(stamp) for stamp in whole], np.int64)


def _say_left_out(fault: RecordingError, name: str, remarks: Remarks) -> None:
    text = str(fault).removeprefix(f"{name}: ")
    remarks.repaired(f"the frames were left out and the events kept: {text}")

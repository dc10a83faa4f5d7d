"""Protocols: what exactly is fed, what is scored and how it is averaged. Two are in use; their numbers differ."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from etnet.errors import RecordingError
from etnet.evaluation.bootstrap import Averaging
from etnet.evaluation.datasets import Cut, Sequence, sequence_called, start_of
from etnet.evaluation.metrics import SSIM_EVREAL, SSIM_PAPER, SSIMVariant
from etnet.events.recording import GroundTruth, Recording
from etnet.windows import Window

ProtocolName = Literal["paper", "evreal"]


@dataclass(frozen=True, slots=True)
class Protocol:
    """A named way of scoring. Windows always run between frames; the file's last frame is never used."""

    name: ProtocolName
    ssim: SSIMVariant
    averaging: Averaging
    warm_up: int
    """µs before the cut that are fed without being scored; 0 is a cold start at the cut."""
    first_window: Literal["events before", "empty"]
    """What is fed for the first frame: the events before it, or an empty voxel grid that still steps the state."""
    clips: bool
    """Predictions are clipped to 0 … 1 before they are scored."""
    post_processes: bool
    """A model's own post-processing is applied (E2VID: robust 1–99 %)."""


PAPER = Protocol("paper", SSIM_PAPER, "sequences", 0, "events before", clips=False, post_processes=False)
"""ET-Net's evaluation code: cold start at the cut, no clipping, mean of the sequences' means."""
EVREAL = Protocol("evreal", SSIM_EVREAL, "frames", 10_000_000, "empty", clips=True, post_processes=True)
"""EVREAL (Ercan et al. 2023): ten seconds of warm-up, clipped, weighted by frames."""
PROTOCOLS: dict[ProtocolName, Protocol] = {"paper": PAPER, "evreal": EVREAL}


@dataclass(frozen=True, slots=True)
class Part:
    """The stretch of a recording that is to be scored, seconds since its first event; `None` is its own end."""

    begin: float | None = None
    end: float | None = None

    def stamps(self, recording: Recording) -> tuple[int, int]:
        """Its first and last stamp, µs."""
        first = recording.span.start
        begin = min(start_of(recording), first) if self.begin is None else first + round(self.begin * 1e6)
        return begin, _end_of(recording) if self.end is None else first + round(self.end * 1e6)

    def __str__(self) -> str:
        return f"from {self.begin or 0:g} s to {'the end' if self.end is None else f'{self.end:g} s'}"


@dataclass(frozen=True, slots=True)
class Item:
    """One step of a protocol: the window that is fed, and the ground-truth frame that it is scored against, if any."""

    window: Window
    frame: int | None


@dataclass(frozen=True, slots=True)
class Plan:
    """A protocol on one recording, from a cold start: its items in order, and what was taken for granted."""

    items: tuple[Item, ...]
    sequence: Sequence | None
    remarks: tuple[str, ...]

    @property
    def frames(self) -> tuple[int, ...]:
        """The ground-truth frames that are scored."""
        return tuple(item.frame for item in self.items if item.frame is not None)


def plan_protocol(recording: Recording, protocol: Protocol, whole: bool = False, part: Part | None = None) -> Plan:
    """What `protocol` feeds and scores of `recording`. A known sequence is cut as the tables do, unless `whole`, or
    unless a `part` is given, which then takes the cut's place.

    Each window ends at its frame's stamp, as the file has it: a lag between the two sensors is never corrected here.
    """
    sequence = None if whole or part is not None else sequence_called(recording.name)
    truth = recording.ground_truth
    if truth is None or len(truth) < 3:
        raise RecordingError(
            f"{recording.name}: {len(truth) if truth else 0} ground-truth frames, scoring wants at least 3; "
            "look at it in the viewer, which shows sharpness and contrast instead"
        )
    scored, fed_from, remarks = _scored_span(recording, protocol, sequence, part)
    fed = [i for i, t in enumerate(truth.stamps) if fed_from <= t <= scored[1]]
    last = fed[-1] if protocol.warm_up == 0 and fed else len(truth) - 1
    # The paper's code cuts the file first, so that the frame it leaves out is the cut's last.
    fed = [i for i in fed if i != last]
    if not any(truth.stamps[i] >= scored[0] for i in fed):
        where = part or (sequence.cut if sequence else "it")
        raise RecordingError(
            f"{recording.name}: too few ground-truth frames lie in {where}; "
            + ("widen --from and --to" if part else "score the whole recording instead (--whole)")
        )
    windows = _windows(recording, protocol, fed_from, [int(truth.stamps[i]) for i in fed])
    frames = [i if truth.stamps[i] >= scored[0] else None for i in fed]
    items = tuple(map(Item, windows, frames))
    return Plan(items, sequence, remarks + _check_comparable(recording, truth, items))


def _check_comparable(recording: Recording, truth: GroundTruth, items: tuple[Item, ...]) -> tuple[str, ...]:
    """An error where frames and events cannot be compared; a remark where some frames have no events before them."""
    scored = [item for item in items if item.frame is not None]
    if not scored:
        return ()
    sensor, (height, width) = recording.sensor, truth.read_frame(scored[0].frame or 0).shape
    if (width, height) != (sensor.width, sensor.height):
        raise RecordingError(
            f"{recording.name}: its frames have {width}×{height} pixels and the sensor {sensor}, so they cannot be "
            "compared pixel by pixel; bring them to the sensor's size"
        )
    num_empty = sum(item.window.start == item.window.stop for item in scored)
    is_among = [recording.span.start <= item.window.t_stop <= recording.span.stop for item in scored]
    if num_empty == len(scored) or not any(is_among):
        raise RecordingError(
            f"{recording.name}: none of the {len(scored)} frames to score lies among the events (frames "
            f"{int(truth.stamps[0])} … {int(truth.stamps[-1])} µs, events {recording.span.start} … "
            f"{recording.span.stop} µs); bring them to one clock"
        )
    return (f"{num_empty} of {len(scored)} scored windows hold no event",) if num_empty > 1 else ()


def _scored_span(
    recording: Recording, protocol: Protocol, sequence: Sequence | None, part: Part | None
) -> tuple[tuple[int, int], int, tuple[str, ...]]:
    """First and last scored stamp, the stamp from which events are fed, and remarks."""
    start = start_of(recording)
    if part is not None:
        begin, end = part.stamps(recording)
        fed_from = max(start, begin - protocol.warm_up)
        remark = f"{recording.name}: only its frames {part} are scored, and events are fed from "
        return (begin, end), fed_from, (f"{remark}{(fed_from - recording.span.start) / 1e6:g} s on",)
    if sequence is None or sequence.cut is None:
        kind = "is no known sequence" if sequence is None else f"is scored whole in {sequence.dataset}"
        return (start, _end_of(recording)), start, (f"{recording.name} {kind}: all its frames are scored",)
    cut: Cut = sequence.cut
    scored = (start + round(cut.start * 1e6), start + round(cut.stop * 1e6))
    remarks = [f"{recording.name} is cut to {cut}"]
    if _end_of(recording) < scored[1]:
        remarks.append(f"{recording.name} ends {(scored[1] - _end_of(recording)) / 1e6:.2f} s before the cut does")
    return scored, max(start, scored[0] - protocol.warm_up), tuple(remarks)


def _end_of(recording: Recording) -> int:
    truth = recording.ground_truth
    assert truth is not None
    return max(recording.span.stop, int(truth.stamps[-1]))


def _windows(recording: Recording, protocol: Protocol, fed_from: int, stamps: list[int]) -> list[Window]:
    """One window to each frame: from the frame before it; the first one as the protocol says."""
    edges = [recording.index_at(t) for t in stamps]
    if protocol.first_window == "empty":
        first = Window(0, edges[0], edges[0], stamps[0], stamps[0])
    else:
        first = Window(0, recording.index_at(fed_from), edges[0], fed_from, stamps[0])
    between = [Window(i, edges[i - 1], edges[i], stamps[i - 1], stamps[i]) for i in range(1, len(stamps))]
    return [first, *between]

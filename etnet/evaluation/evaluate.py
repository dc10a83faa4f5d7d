"""Score a model on a recording under a protocol: replay exactly what the protocol feeds, from a cold start."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor

from etnet.errors import ModelError, RecordingError
from etnet.evaluation.lpips import LPIPS, Taps, load_lpips
from etnet.evaluation.metrics import (
    best_affine,
    contrast,
    mean_squared_error,
    robust_range,
    sharpness,
    structural_similarity,
)
from etnet.evaluation.protocol import Part, Plan, Protocol, plan_protocol
from etnet.evaluation.scores import ROWS, Measure, Row, Scores
from etnet.evaluation.temporal import estimate_flow, temporal_consistency
from etnet.events.recording import GroundTruth, Recording
from etnet.nets.base import Reconstructor
from etnet.nets.runtime import device_of
from etnet.reconstruction import window_voxel

Progress = Callable[[float], None]
"""Called with the fraction done."""


@dataclass(frozen=True, slots=True)
class Judges:
    """The networks that compare images: LPIPS-Alex, and LPIPS-VGG where its weights are at hand."""

    lpips: LPIPS
    lpips_vgg: LPIPS | None = None

    @staticmethod
    def default() -> Judges:
        """LPIPS-Alex as it ships with the package, alone."""
        return Judges(load_lpips())

    def all(self) -> Iterator[tuple[Measure, LPIPS]]:
        """Measure and network."""
        yield "lpips", self.lpips
        if self.lpips_vgg is not None:
            yield "lpips_vgg", self.lpips_vgg


@dataclass(frozen=True, slots=True)
class FrameJudge:
    """Scores single frames under one protocol. The viewer's strip uses it too, so that its numbers are the same."""

    protocol: Protocol
    judges: Judges

    def prepare(self, frame: Tensor, post_processing: str = "none") -> Tensor:
        """A network's raw frame (`1 1 h w`) as the protocol scores it."""
        if self.protocol.post_processes and post_processing == "robust":
            frame = robust_range(frame)
        return self._clip(frame)

    def fit(self, frame: Tensor, truth: Tensor) -> Tensor:
        """The frame with the gain and offset that bring it nearest to its ground truth."""
        return self._clip(best_affine(frame, truth))

    def features(self, image: Tensor) -> dict[Measure, Taps]:
        """What the judges see in an image; that of a ground-truth frame serves all rows."""
        return {measure: judge.features(image) for measure, judge in self.judges.all()}

    def score(self, frame: Tensor, truth: Tensor, truth_features: dict[Measure, Taps]) -> dict[Measure, float]:
        """Every measure that needs one frame alone."""
        values: dict[Measure, float] = {
            "mse": mean_squared_error(frame, truth).item(),
            "ssim": structural_similarity(frame, truth, self.protocol.ssim).item(),
        }
        for measure, judge in self.judges.all():
            values[measure] = judge.distance(judge.features(frame), truth_features[measure]).item()
        values["sharpness"] = sharpness(frame).item()
        values["contrast"] = contrast(frame).item()
        return values

    def _clip(self, frame: Tensor) -> Tensor:
        return frame.clamp(0, 1) if self.protocol.clips else frame


def evaluate(
    model: Reconstructor,
    recording: Recording,
    protocol: Protocol,
    judges: Judges | None = None,
    whole: bool = False,
    estimates_flow: bool = True,
    name: str | None = None,
    on_progress: Progress | None = None,
    part: Part | None = None,
) -> Scores:
    """Frame-by-frame scores of `model` on the part of `recording` that `protocol` scores, or on another `part`.

    Temporal consistency takes the file's own flow; without it DIS on ground truth, which a remark says, or nothing
    when `estimates_flow` is off. Raises RecordingError without ground truth.
    """
    evaluation = Evaluation(model, recording, protocol, judges, whole, estimates_flow, name, part)
    for fraction in evaluation.run():
        if on_progress is not None:
            on_progress(fraction)
    return evaluation.scores()


class Evaluation:
    """An evaluation that can be done step by step: the viewer shows its scores while they come.

    Raises as `evaluate` does.
    """

    def __init__(
        self,
        model: Reconstructor,
        recording: Recording,
        protocol: Protocol,
        judges: Judges | None = None,
        whole: bool = False,
        estimates_flow: bool = True,
        name: str | None = None,
        part: Part | None = None,
    ) -> None:
        self.plan = plan_protocol(recording, protocol, whole, part)
        truth = recording.ground_truth
        assert truth is not None
        self._truth = truth
        self._model = model
        self._recording = recording
        self._judge = FrameJudge(protocol, judges or Judges.default())
        self._flow = _FlowOf(truth, estimates_flow)
        self._table = _Table()
        self._name = name or model.name

    def run(self) -> Iterator[float]:
        """Replay the plan from a cold start; gives the fraction done after each window."""
        state, before = None, None
        grey = _mean_grey(self._truth, self.plan)
        device = device_of(self._model)
        for done, item in enumerate(self.plan.items, start=1):
            # Entered for each window: the caller is not inside it between two windows.
            with torch.inference_mode():
                voxel = window_voxel(self._model, self._recording, item.window)[None].to(device)
                pyramid, state = self._model.encode(voxel, state)
                if item.frame is not None:  # what is only warm-up is not decoded
                    before = self._score(item.frame, self._model.decode(pyramid)[0].float(), grey, before)
            yield done / len(self.plan.items)

    def scores(self) -> Scores:
        """What was scored up to now."""
        rows = self._table.rows()
        stamps = np.asarray(self._truth.stamps, np.int64)[list(self.plan.frames)][: self._table.num_frames]
        remarks = (*self.plan.remarks, *self._flow.remarks(self._recording.name))
        protocol = self._judge.protocol.name
        return Scores(self._name, self._recording.name, protocol, self.plan.sequence, stamps, rows, remarks)

    def _score(self, number: int, frame: Tensor, grey: float, before: _Scored | None) -> _Scored:
        if not bool(torch.isfinite(frame).all()):
            said = f"{self._name}: its frame for camera frame {number} is not finite"
            raise ModelError(f"{said}; its weights are damaged, or its memory grew beyond what numbers hold")
        target = _as_image(self._truth.read_frame(number)).to(frame.device)
        prepared = self._judge.prepare(frame, getattr(self._model, "post_processing", "none"))
        images: dict[Row, Tensor] = {
            "as it is": prepared,
            "best affine per frame": self._judge.fit(prepared, target),
            "constant grey": torch.full_like(target, grey),
        }
        features = self._judge.features(target)
        moved = self._flow.into(number) if before is not None and before.number == number - 1 else None
        for row, image in images.items():
            values = self._judge.score(image, target, features)
            values["temporal"] = math.nan
            if moved is not None and before is not None:
                pair = (before.images[row], image)
                values["temporal"] = temporal_consistency((before.target, target), pair, moved.to(target)).item()
            self._table.add(row, values)
        return _Scored(number, target, images)


@dataclass(frozen=True, slots=True)
class _Scored:
    """A scored frame, kept for the temporal measure of the next one."""

    number: int
    target: Tensor
    images: dict[Row, Tensor]


class _FlowOf:
    """The flow into a ground-truth frame: the file's, or an estimate."""

    def __init__(self, truth: GroundTruth, estimates: bool) -> None:
        self._truth = truth
        self._estimates = estimates
        self._without: set[int] = set()
        self._remark = "TC: no flow in the file, not measured"
        if truth.read_flow is not None:
            self._remark = "TC: with the file's own flow"
        elif estimates:
            self._remark = "TC: the file has no flow; estimated with DIS on ground truth"

    def remarks(self, name: str) -> tuple[str, ...]:
        """Where the flow comes from, and how many of the frames of the recording `name` had none up to now."""
        if not self._without:
            return (self._remark,)
        num = len(self._without)
        counted = "1 frame of {}, which has" if num == 1 else f"{num} frames of {{}}, which have"
        return self._remark, f"TC: not measured at {counted.format(name)} no flow that can be read"

    def into(self, frame: int) -> Tensor | None:
        """From frame − 1 to `frame`, `1 2 h w`; None where there is none."""
        if self._truth.read_flow is not None:
            try:
                flow = self._truth.read_flow(frame)
            except RecordingError:
                self._without.add(frame)  # as where a scene is cut
                return None
            return torch.from_numpy(np.ascontiguousarray(flow, np.float32))[None]
        if not self._estimates:
            return None
        return torch.from_numpy(estimate_flow(self._truth.read_frame(frame - 1), self._truth.read_frame(frame)))[None]


class _Table:
    """Collects values into columns."""

    def __init__(self) -> None:
        self._values: dict[Row, dict[Measure, list[float]]] = {row: {} for row in ROWS}

    def add(self, row: Row, values: dict[Measure, float]) -> None:
        for measure, value in values.items():
            self._values[row].setdefault(measure, []).append(value)

    @property
    def num_frames(self) -> int:
        return len(self._values["as it is"].get("mse", ()))

    def rows(self) -> dict[Row, dict[Measure, np.ndarray]]:
        return {
            row: {measure: np.array(values, np.float64) for measure, values in columns.items()}
            for row, columns in self._values.items()
        }


def _mean_grey(truth: GroundTruth, plan: Plan) -> float:
    """The mean of all scored ground-truth pixels."""
    return float(np.mean([truth.read_frame(frame).mean(dtype=np.float64) for frame in plan.frames]))


def _as_image(frame: np.ndarray) -> Tensor:
    return torch.from_numpy(np.ascontiguousarray(frame, np.float32))[None, None]

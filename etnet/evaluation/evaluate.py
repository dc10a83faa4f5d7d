"""Score a model on a recording under a protocol: replay exactly what the protocol feeds, from a cold start."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor

from etnet.evaluation.lpips import LPIPS, Taps, load_lpips
from etnet.evaluation.metrics import (
    best_affine,
    contrast,
    mean_squared_error,
    robust_range,
    sharpness,
    structural_similarity,
)
from etnet.evaluation.protocol import Item, Plan, Protocol, plan_protocol
from etnet.evaluation.scores import ROWS, Measure, Row, Scores
from etnet.evaluation.temporal import estimate_flow, temporal_consistency
from etnet.events.recording import GroundTruth, Recording
from etnet.nets.base import Reconstructor
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
) -> Scores:
    """Frame-by-frame scores of `model` on the part of `recording` that `protocol` scores.

    Temporal consistency takes the file's own flow; without it DIS on ground truth, which a remark says, or nothing
    when `estimates_flow` is off. Raises RecordingError without ground truth.
    """
    plan = plan_protocol(recording, protocol, whole)
    truth = recording.ground_truth
    assert truth is not None
    judge = FrameJudge(protocol, judges or Judges.default())
    flow = _FlowOf(truth, estimates_flow)
    table = _Table()
    grey = _mean_grey(truth, plan)
    before: tuple[int, Tensor, dict[Row, Tensor]] | None = None
    with torch.inference_mode():
        for item, frame in _replay(model, recording, plan, on_progress):
            assert item.frame is not None
            target = _as_image(truth.read_frame(item.frame)).to(frame.device)
            prepared = judge.prepare(frame, getattr(model, "post_processing", "none"))
            images: dict[Row, Tensor] = {
                "as it is": prepared,
                "best affine per frame": judge.fit(prepared, target),
                "constant grey": torch.full_like(target, grey),
            }
            features = judge.features(target)
            moved = flow.into(item.frame) if before is not None and before[0] == item.frame - 1 else None
            for row, image in images.items():
                values = judge.score(image, target, features)
                values["temporal"] = math.nan
                if moved is not None and before is not None:
                    pair = (before[2][row], image)
                    values["temporal"] = temporal_consistency((before[1], target), pair, moved.to(target)).item()
                table.add(row, values)
            before = item.frame, target, images
    stamps = np.asarray(truth.stamps, np.int64)[list(plan.frames)]
    remarks = (*plan.remarks, flow.remark)
    return Scores(name or model.name, recording.name, protocol.name, plan.sequence, stamps, table.rows(), remarks)


def _replay(
    model: Reconstructor, recording: Recording, plan: Plan, on_progress: Progress | None
) -> Iterator[tuple[Item, Tensor]]:
    """The scored items with the model's raw frames. What is only warm-up is not decoded."""
    state = None
    device = next(iter(model.parameters())).device if isinstance(model, torch.nn.Module) else torch.device("cpu")
    for done, item in enumerate(plan.items, start=1):
        voxel = window_voxel(model, recording, item.window)[None].to(device)
        pyramid, state = model.encode(voxel, state)
        if item.frame is not None:
            yield item, model.decode(pyramid)[0].float()
        if on_progress is not None:
            on_progress(done / len(plan.items))


class _FlowOf:
    """The flow into a ground-truth frame: the file's, or an estimate."""

    def __init__(self, truth: GroundTruth, estimates: bool) -> None:
        self._truth = truth
        self._estimates = estimates
        self.remark = "TC: no flow in the file, not measured"
        if truth.read_flow is not None:
            self.remark = "TC: with the file's own flow"
        elif estimates:
            self.remark = "TC: the file has no flow; estimated with DIS on ground truth"

    def into(self, frame: int) -> Tensor | None:
        """From frame − 1 to `frame`, `1 2 h w`."""
        if self._truth.read_flow is not None:
            return torch.from_numpy(np.ascontiguousarray(self._truth.read_flow(frame), np.float32))[None]
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

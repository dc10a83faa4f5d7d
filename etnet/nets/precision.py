"""Which precision is fastest on this machine: measured, because CPUs differ by a factor of hundreds."""

from __future__ import annotations

import logging
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Literal

import torch

from etnet.errors import ModelError
from etnet.nets.fingerprint import weights_sha256
from etnet.nets.kept_choices import keep_choice, kept_choice
from etnet.nets.runtime import Precision, Runtime, apply_runtime, default_runtime

if TYPE_CHECKING:
    from torch import Tensor

    from etnet.nets.presets import Network

PrecisionChoice = Literal["fp32", "bf16", "auto"]
_PROBE_SIZE = (180, 240)
_PROBE_STEPS = 2
LARGEST_DIFFERENCE = 0.05
"""Between a pixel of the frames in bf16 and in fp32 (0 … 1), beyond which bf16 is refused: ten times what was measured
with our weights. Some processors and versions of torch have wrong bf16 convolutions."""

_log = logging.getLogger(__name__)


def choose_runtime(model: Network, precision: PrecisionChoice, device: str = "cpu") -> Runtime:
    """The runtime for `precision`. "auto" is decided once for each network and machine, and kept (`decide`)."""
    if precision not in ("fp32", "bf16", "auto"):
        raise ModelError(f"precision is {precision!r}; it takes 'fp32', 'bf16' or 'auto'")
    if precision != "auto":
        return default_runtime(precision, device)
    decision = decide(model, device)
    _log.info("%s: %s", model.name, decision.sentence)
    return default_runtime(decision.precision, device)


@dataclass(frozen=True, slots=True)
class PrecisionDecision:
    """What "auto" came to on this machine, and the measurement behind it. Seconds are those of one step."""

    precision: Precision
    fp32_seconds: float
    bf16_seconds: float
    """Infinite where the processor has no bf16 worth trying."""
    difference: float
    """The largest difference of a pixel between the two frames, 0 … 1."""

    @property
    def sentence(self) -> str:
        """The decision in words."""
        if self.bf16_seconds == float("inf"):
            return "precision auto: fp32, because this processor computes bf16 more slowly"
        speed = f"{self.fp32_seconds * 1e3:.0f} ms a step in fp32, {self.bf16_seconds * 1e3:.0f} ms in bf16"
        if self.difference > LARGEST_DIFFERENCE:
            return f"precision auto: fp32, because bf16 frames differ by {self.difference:.2g} ({speed})"
        return f"precision auto: {self.precision} ({speed}; frames differ by at most {self.difference:.1g})"


def decide(model: Network, device: str = "cpu") -> PrecisionDecision:
    """The decision for this network here: the kept one, or one that is measured now and kept.

    It compares the speed of a step and its frame with fp32's. The same machine gives the same answer ever after,
    whatever else runs on it at the moment.
    """
    name = f"precision {device} {weights_sha256(model)}"
    kept = kept_choice(name)
    if kept is not None:
        try:
            return PrecisionDecision(**kept)
        except TypeError:
            pass
    decision = _measured(model, device)
    keep_choice(name, asdict(decision))
    return decision


def bf16_is_worth_trying(device: str = "cpu", size: int = 256) -> bool:
    """Whether a bf16 matrix product takes at most twice as long as an fp32 one.

    CPUs without bf16 instructions fall back to code that is hundreds of times slower: a whole step in bf16 would
    take minutes there, so a product of 34 MFLOP decides first. A smaller one says little: of 4 MFLOP, beginning and
    ending the threads takes as long as the work, and a CPU that is 2.3 times as fast in bf16 came out slower.
    """

    def product(dtype: torch.dtype) -> Callable[[], object]:
        matrix = torch.ones(size, size, dtype=dtype, device=device)
        return lambda: matrix @ matrix

    return best_of(product(torch.bfloat16)) <= 2 * best_of(product(torch.float32))


def best_of(call: Callable[[], object], runs: int = 3) -> float:
    """Seconds of the fastest of `runs` calls, after one that is not counted."""
    call()
    seconds = []
    for _ in range(runs):
        start = time.perf_counter()
        call()
        seconds.append(time.perf_counter() - start)
    return min(seconds)


def _measured(model: Network, device: str) -> PrecisionDecision:
    if not bf16_is_worth_trying(device):
        return PrecisionDecision("fp32", 0.0, float("inf"), 0.0)
    before: Runtime = model.runtime
    try:
        fp32_seconds, fp32_frame = _step(model, default_runtime("fp32", device), device)
        bf16_seconds, bf16_frame = _step(model, default_runtime("bf16", device), device)
    finally:
        apply_runtime(model, before)
    difference = float((fp32_frame - bf16_frame).abs().nan_to_num(nan=torch.inf).max())
    use_bf16 = bf16_seconds < fp32_seconds and difference <= LARGEST_DIFFERENCE
    return PrecisionDecision("bf16" if use_bf16 else "fp32", fp32_seconds, bf16_seconds, difference)


def _step(model: Network, runtime: Runtime, device: str) -> tuple[float, Tensor]:
    """Seconds of one step under `runtime`, and the frame after two made-up windows."""
    apply_runtime(model, runtime)
    generator = torch.Generator().manual_seed(0)
    votes = torch.randn(_PROBE_STEPS, 1, model.bins, *_PROBE_SIZE, generator=generator)
    voxels = (votes * (votes.abs() > 1)).to(device)
    with torch.inference_mode():
        step = model(voxels[0])
        for voxel in voxels[1:]:
            step = model(voxel, step.state)

        def again() -> None:
            float(model(voxels[-1], step.state).frame[0, 0, 0, 0])

        return best_of(again, runs=2), step.frame.float().cpu()

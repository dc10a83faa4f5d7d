"""The terms of the training loss (paper, §3.3, eq. 5) and our L1 terms."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass

import torch
from jaxtyping import Bool, Float
from torch import Tensor, nn
from torch.nn.functional import avg_pool2d, grid_sample

from etnet.evaluation.lpips import LPIPS
from etnet.nets.etnet import ETNet
from etnet.nets.padding import PATCH
from etnet.training.config import LossConfig

OCCLUSION_SHARPNESS = 50.0
"""α of the visibility mask exp(−α (I₁ − W(I₀))²), as in the released code."""


@dataclass(frozen=True, slots=True)
class Terms:
    """Unweighted means over a batch, and their weighted sum."""

    total: Tensor
    perceptual: Tensor
    l1: Tensor
    gradient: Tensor
    tone: Tensor
    context: Tensor
    alive: Tensor
    temporal: Tensor

    def numbers(self) -> dict[str, Tensor]:
        """For the log, not read yet: reading a number waits for the device that computes it."""
        names = ("total", "perceptual", "l1", "gradient", "tone", "context", "alive", "temporal")
        return {name: getattr(self, name).detach() for name in names}


@dataclass(frozen=True, slots=True)
class Pairs:
    """Which frames of a batch follow which (rows of the batch), and the flow from one to the other.

    `share` is what their mean counts beside those of other processes (`World.share_of`).
    """

    before: Tensor
    after: Tensor
    flow: Float[Tensor, "p 2 h w"]
    share: Tensor | float = 1.0


def score(
    prediction: Float[Tensor, "b 1 h w"],
    target: Float[Tensor, "b 1 h w"],
    config: LossConfig,
    lpips: LPIPS,
    pairs: Pairs | None = None,
    context: Tensor | None = None,
    alive: Tensor | None = None,
) -> Terms:
    """The loss of a batch of frames, in fp32; temporal consistency where there are `pairs`. `context` and `alive` are
    those terms, which are not told from frames."""
    prediction = prediction.float()
    zero = prediction.new_zeros(())
    perceptual = lpips(prediction, target).mean() if config.perceptual else zero
    l1 = (prediction - target).abs().mean()
    gradient = gradient_l1(prediction, target)
    tone = (avg_pool2d(prediction, PATCH) - avg_pool2d(target, PATCH)).abs().mean()
    temporal = zero
    if pairs is not None and len(pairs.before):
        temporal = pairs.share * temporal_consistency(
            prediction[pairs.before], prediction[pairs.after], target[pairs.before], target[pairs.after], pairs.flow
        )
    weighted = {
        "perceptual": perceptual,
        "l1": l1,
        "gradient": gradient,
        "tone": tone,
        "context": zero if context is None else context,
        "alive": zero if alive is None else alive,
        "temporal": temporal,
    }
    total = torch.stack([getattr(config, name) * term for name, term in weighted.items()]).sum()
    return Terms(total, **weighted)


def without_tone(
    prediction: Float[Tensor, "b 1 h w"], target: Float[Tensor, "b 1 h w"], is_gamma: Bool[Tensor, " b"]
) -> Float[Tensor, "b 1 h w"]:
    """The frames marked `is_gamma` with the gain and offset that bring them nearest to their target (least squares).

    Gain and offset are not trained through: a frame must not gain by becoming easier to fit.
    """
    prediction = prediction.float()
    with torch.no_grad():
        mean, wanted = (image.mean((2, 3), keepdim=True) for image in (prediction, target))
        spread = ((prediction - mean) ** 2).mean((2, 3), keepdim=True)
        gain = ((prediction - mean) * (target - wanted)).mean((2, 3), keepdim=True) / (spread + 1e-6)
        gain = gain.clamp_min(0.1)  # never upside down, never flat
        offset = wanted - gain * mean
    return torch.where(is_gamma[:, None, None, None], gain * prediction + offset, prediction)


def gradient_l1(prediction: Float[Tensor, "b 1 h w"], target: Float[Tensor, "b 1 h w"]) -> Tensor:
    """Mean absolute error of the differences between neighbours, down and across."""
    error = prediction - target
    return error.diff(dim=-2).abs().mean() + error.diff(dim=-1).abs().mean()


def warp(image: Float[Tensor, "b c h w"], flow: Float[Tensor, "b 2 h w"]) -> Float[Tensor, "b c h w"]:
    """The image moved along `flow` (x, y in pixels, on the grid of the result): result(x) = image(x − flow(x)).

    With align_corners=True, so that a flow of zero changes nothing; outside the image the border goes on.
    """
    height, width = image.shape[-2:]
    x = torch.arange(width, device=image.device) - flow[:, 0]
    y = torch.arange(height, device=image.device)[:, None] - flow[:, 1]
    grid = torch.stack((2 * x / (width - 1) - 1, 2 * y / (height - 1) - 1), dim=-1)
    return grid_sample(image, grid, mode="bilinear", padding_mode="border", align_corners=True)


def temporal_consistency(
    prediction_before: Float[Tensor, "b 1 h w"],
    prediction_after: Float[Tensor, "b 1 h w"],
    target_before: Float[Tensor, "b 1 h w"],
    target_after: Float[Tensor, "b 1 h w"],
    flow: Float[Tensor, "b 2 h w"],
) -> Tensor:
    """exp(−50 (I₁ − W(I₀))²) · |P₁ − W(P₀)| / (|P₁| + |W(P₀)| + 10⁻⁵), the mean over pixels (paper, eq. 5)."""
    visible = torch.exp(-OCCLUSION_SHARPNESS * (target_after - warp(target_before, flow)) ** 2)
    warped = warp(prediction_before, flow)
    change = (prediction_after - warped).abs() / (prediction_after.abs() + warped.abs() + 1e-5)
    return (visible * change).mean()


def silence(drives: Iterable[Float[Tensor, "b c h w"]]) -> Tensor:
    """How silent the units are that a ReLU follows: max(0, −1 − mean / deviation) of each channel's drive, averaged.

    0 while every unit fires for more than about a sixth of what it sees. A ReLU that never fires has no gradient and
    stays as it is; this one has, and brings it back.
    """
    found = []
    for drive in drives:
        deviation, mean = torch.std_mean(drive.float(), dim=(0, 2, 3))
        found.append(torch.relu(-1 - mean / (deviation.detach() + 1e-6)).mean())
    return torch.stack(found).mean()


@contextmanager
def drives_of(model: ETNet) -> Iterator[list[Tensor]]:
    """Collects what the upsampler's ReLUs are given while the network decodes."""
    seen: list[Tensor] = []

    def keep(module: nn.Module, inputs: object, output: Tensor) -> None:
        seen.append(output)

    convolutions = [module for module in model.upsampler.modules() if isinstance(module, nn.Conv2d)]
    handles = [convolution.register_forward_hook(keep) for convolution in convolutions]
    try:
        yield seen
    finally:
        for handle in handles:
            handle.remove()

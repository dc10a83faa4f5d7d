"""Measures of a frame against its ground truth and of a frame by itself. Images are `b 1 h w`, 0 … 1; fp64 inside."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import torch
from jaxtyping import Float, Float64
from torch import Tensor
from torch.nn import functional

Images = Float[Tensor, "b 1 h w"]
Values = Float64[Tensor, " b"]

K1, K2 = 0.01, 0.03
"""The constants of Wang et al. 2004."""


@dataclass(frozen=True, slots=True)
class SSIMVariant:
    """Which structural similarity is meant: papers mean different ones by the same four letters."""

    window: Literal["uniform", "gaussian"]
    side: int
    data_range: float
    uses_sample_covariance: bool
    sigma: float = 1.5
    """Of the Gaussian window, pixels."""

    def kernel(self) -> Float64[Tensor, " side"]:
        """The window's weights along one axis; they sum to 1."""
        if self.window == "uniform":
            return torch.full((self.side,), 1 / self.side, dtype=torch.float64)
        offsets = torch.arange(self.side, dtype=torch.float64) - self.side // 2
        weights = torch.exp(-0.5 * (offsets / self.sigma) ** 2)
        return weights / weights.sum()


SSIM_PAPER = SSIMVariant("uniform", side=7, data_range=2.0, uses_sample_covariance=True)
"""What ET-Net's code computes: scikit-image's defaults for floating-point images."""
SSIM_EVREAL = SSIMVariant("gaussian", side=11, data_range=1.0, uses_sample_covariance=False)
"""EVREAL's choice, that of Wang et al. 2004."""


def mean_squared_error(prediction: Images, target: Images) -> Values:
    """The mean of the squared differences of each pair."""
    return ((prediction.double() - target.double()) ** 2).mean(dim=(1, 2, 3))


def structural_similarity(prediction: Images, target: Images, variant: SSIMVariant) -> Values:
    """Mean SSIM (Wang et al. 2004) over the places where the window lies wholly inside the image."""
    if min(prediction.shape[2:]) < variant.side:
        raise ValueError(f"SSIM: got {tuple(prediction.shape)}; it takes images of at least {variant.side}²")
    x, y = prediction.double(), target.double()
    kernel = variant.kernel().to(x.device)

    def local_mean(image: Tensor) -> Tensor:
        rows = functional.conv2d(image, kernel.view(1, 1, -1, 1))
        return functional.conv2d(rows, kernel.view(1, 1, 1, -1))

    mean_x, mean_y = local_mean(x), local_mean(y)
    samples = variant.side**2
    unbias = samples / (samples - 1) if variant.uses_sample_covariance else 1.0
    variance_x = unbias * (local_mean(x * x) - mean_x**2)
    variance_y = unbias * (local_mean(y * y) - mean_y**2)
    covariance = unbias * (local_mean(x * y) - mean_x * mean_y)

    c1, c2 = (K1 * variant.data_range) ** 2, (K2 * variant.data_range) ** 2
    likeness = (2 * mean_x * mean_y + c1) * (2 * covariance + c2)
    largest = (mean_x**2 + mean_y**2 + c1) * (variance_x + variance_y + c2)
    return (likeness / largest).mean(dim=(1, 2, 3))


def best_affine(prediction: Images, target: Images) -> Images:
    """a · prediction + b with the a and b of each image that lie nearest to its target (least squares).

    It takes brightness and contrast out of a comparison. A flat prediction becomes the target's mean.
    """
    x, y = prediction.double(), target.double()
    mean_x, mean_y = x.mean(dim=(1, 2, 3), keepdim=True), y.mean(dim=(1, 2, 3), keepdim=True)
    variance = ((x - mean_x) ** 2).mean(dim=(1, 2, 3), keepdim=True)
    covariance = ((x - mean_x) * (y - mean_y)).mean(dim=(1, 2, 3), keepdim=True)
    gain = torch.where(variance > 0, covariance / variance.clamp_min(torch.finfo(variance.dtype).tiny), 0.0)
    return (gain * (x - mean_x) + mean_y).to(prediction.dtype)


def robust_range(image: Images, low: float = 0.01, high: float = 0.99) -> Images:
    """Stretch each image so that its 1st and 99th percentile become 0 and 1, then clip (E2VID's post-processing)."""
    flat = image.double().flatten(1)
    bounds = torch.quantile(flat, torch.tensor([low, high], dtype=flat.dtype, device=flat.device), dim=1)
    start, stop = (bound.view(-1, 1, 1, 1) for bound in bounds)
    width = (stop - start).clamp_min(torch.finfo(torch.float32).eps)
    return ((image.double() - start) / width).clamp(0, 1).to(image.dtype)


def sharpness(image: Images) -> Values:
    """Mean length of the gradient by central differences, per pixel. Needs no ground truth; noise raises it too."""
    x = image.double()
    across = (x[..., 1:-1, 2:] - x[..., 1:-1, :-2]) / 2
    down = (x[..., 2:, 1:-1] - x[..., :-2, 1:-1]) / 2
    return torch.hypot(across, down).mean(dim=(1, 2, 3))


def contrast(image: Images) -> Values:
    """RMS contrast: the standard deviation of the image. Needs no ground truth."""
    return image.double().flatten(1).std(dim=1, correction=0)

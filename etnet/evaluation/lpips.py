"""LPIPS v0.1 (Zhang et al. 2018) as a differentiable module with frozen weights, read from plain arrays.

The distance compares the activations of a classifier at five depths: each is scaled to unit length over its channels,
squared differences are weighted by a learned non-negative vector, averaged over the image and summed over the depths.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Literal

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor, nn
from torch.nn import functional

from etnet.bundled import bundled_folder
from etnet.errors import WeightsError

ALEX_FILE = "lpips_alex_v0.1_fp16.npz"
SHIFT = (-0.030, -0.088, -0.188)
SCALE = (0.458, 0.448, 0.450)
LENGTH_EPSILON = 1e-10


@dataclass(frozen=True, slots=True)
class Convolution:
    """One convolution followed by a ReLU. `name` is the layer's index in the arrays, e.g. "features.3"."""

    name: str
    stride: int = 1
    padding: int = 1
    pools_before: Literal[0, 2, 3] = 0
    is_tap: bool = True


ALEX = (
    Convolution("features.0", stride=4, padding=2),
    Convolution("features.3", padding=2, pools_before=3),
    Convolution("features.6", pools_before=3),
    Convolution("features.8"),
    Convolution("features.10"),
)
"""AlexNet: a tap after each of its five convolutions. `pools_before` is the max-pool's side; its stride is always 2."""

Taps = tuple[Tensor, ...]


class LPIPS(nn.Module):
    """`lpips(prediction, target)` → one distance an image; 0 for equal images. Images are `b 1 h w` (or 3) in 0 … 1.

    Differentiable in both images; the weights are buffers, so no optimiser ever finds them. Always computed in fp32,
    under autocast too. A target that is compared more than once: keep `features(target)` and call `distance`.
    """

    shift: Tensor
    scale: Tensor

    def __init__(self, arrays: Mapping[str, np.ndarray], layers: tuple[Convolution, ...] = ALEX) -> None:
        super().__init__()
        self.layers = layers
        for name in expected_names(layers):
            self.register_buffer(name.replace(".", "_"), torch.from_numpy(np.asarray(arrays[name], np.float32)))
        self.register_buffer("shift", torch.tensor(SHIFT).view(1, 3, 1, 1))
        self.register_buffer("scale", torch.tensor(SCALE).view(1, 3, 1, 1))

    def forward(self, prediction: Float[Tensor, "b c h w"], target: Float[Tensor, "b c h w"]) -> Float[Tensor, " b"]:
        """The distance of each pair of images."""
        return self.distance(self.features(prediction), self.features(target))

    def features(self, image: Float[Tensor, "b c h w"]) -> Taps:
        """Activations at the five taps, each of unit length over its channels."""
        if image.shape[1] not in (1, 3) or min(image.shape[2:]) < MIN_SIDE:
            raise ValueError(f"LPIPS: got {tuple(image.shape)}; it takes b × 1 or 3 channels × at least {MIN_SIDE}²")
        with torch.autocast(image.device.type, enabled=False):
            x = ((2 * image.float() - 1) - self.shift) / self.scale
            taps = []
            for layer in self.layers:
                if layer.pools_before:
                    x = functional.max_pool2d(x, layer.pools_before, 2)
                weight, bias = self._array(f"{layer.name}.weight"), self._array(f"{layer.name}.bias")
                x = functional.relu(functional.conv2d(x, weight, bias, layer.stride, layer.padding))
                if layer.is_tap:
                    # vector_norm's gradient at zero is zero; that of a plain square root would be NaN.
                    taps.append(x / (torch.linalg.vector_norm(x, dim=1, keepdim=True) + LENGTH_EPSILON))
            return tuple(taps)

    def distance(self, first: Taps, second: Taps) -> Float[Tensor, " b"]:
        """The distance between the features of two batches of images of one size."""
        # A 1×1 convolution is a weighted sum over channels, and the mean over the image may go first.
        squares = [((a - b) ** 2).mean(dim=(2, 3)) for a, b in zip(first, second, strict=True)]
        weighted = [x * self._array(f"lin{index}.weight").view(1, -1) for index, x in enumerate(squares)]
        return torch.stack([x.sum(dim=1) for x in weighted]).sum(dim=0)

    def _array(self, name: str) -> Tensor:
        return self.get_buffer(name.replace(".", "_"))


MIN_SIDE = 31
"""Smaller images leave nothing after AlexNet's two max-pools."""


def expected_names(layers: tuple[Convolution, ...]) -> list[str]:
    """The arrays that a network of these layers needs."""
    convolutions = [f"{layer.name}.{part}" for layer in layers for part in ("weight", "bias")]
    num_taps = sum(layer.is_tap for layer in layers)
    return convolutions + [f"lin{index}.weight" for index in range(num_taps)]


def load_lpips(path: Path | None = None) -> LPIPS:
    """LPIPS-Alex with the weights that ship with the package, or with those in `path` (.npz)."""
    path = path or bundled_folder() / "models" / ALEX_FILE
    try:
        with np.load(path, allow_pickle=False) as file:
            arrays = {name: file[name] for name in file.files}
    except (OSError, ValueError) as error:
        raise WeightsError(f"{path.name}: LPIPS weights cannot be read ({error}); reinstall the package") from error
    missing = sorted(set(expected_names(ALEX)) - set(arrays))
    if missing:
        raise WeightsError(f"{path.name}: no LPIPS-Alex weights, {missing[0]} is missing; give the file as shipped")
    return LPIPS(arrays)


def perceptual_distance(frame: Float[Tensor, "1 1 h w"], target: Float[Tensor, "1 1 h w"]) -> float | None:
    """LPIPS-Alex of one pair in 0 … 1, on the CPU; `None` below `MIN_SIDE` pixels a side. Loads its weights once."""
    if min(target.shape[-2:]) < MIN_SIDE:
        return None
    with torch.inference_mode():
        return float(_shipped()(frame, target))


@cache
def _shipped() -> LPIPS:
    return load_lpips()

"""What makes TPA know the image's brightness: in training, a linear layer has to read it off TPA's output alone."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import torch
from jaxtyping import Float
from torch import Tensor, nn
from torch.nn.functional import avg_pool2d, pixel_shuffle

from etnet.nets.etnet import ETNet
from etnet.nets.padding import PATCH, pad_to_grid

CELLS = 4
"""Cells on a token's side whose mean brightness is read: 2 × 2 pixels each."""


class ContextReader(nn.Module):
    """TPA's output → brightness at a half of the image's size. It is no part of the network and is not exported.

    The upsampler learns to do without TPA before TPA has learned anything, as the skips are the shorter way. Read
    directly, TPA has to hold the picture from the first update on; under blind squares, where nothing but other
    tokens can tell what is hidden, its attention has to look there.
    """

    def __init__(self, dim: int, generator: torch.Generator) -> None:
        super().__init__()
        self.read = nn.Linear(dim, CELLS**2)
        with torch.no_grad():
            nn.init.normal_(self.read.weight, std=dim**-0.5 / 4, generator=generator)
            nn.init.constant_(self.read.bias, 0.4)  # about the mean of a frame

    def forward(self, context: Float[Tensor, "b d i j"]) -> Float[Tensor, "b 1 ic jc"]:
        """Brightness in cells of 2 × 2 pixels, padding included."""
        return pixel_shuffle(self.read(context.movedim(1, -1)).movedim(-1, 1), CELLS)

    def error(self, context: Float[Tensor, "b d i j"], target: Float[Tensor, "b 1 h w"]) -> Tensor:
        """Mean absolute error against the target's cells; padding, where nothing is to be known, does not count."""
        cell = PATCH // CELLS
        weight = avg_pool2d(pad_to_grid(torch.ones_like(target)), cell)
        truth = avg_pool2d(pad_to_grid(target), cell)
        return ((self(context.float()) * weight - truth).abs()).sum() / weight.sum()


@contextmanager
def context_of(model: ETNet) -> Iterator[list[Tensor]]:
    """Collects TPA's outputs while the network decodes."""
    seen: list[Tensor] = []
    handle = model.tpa.register_forward_hook(lambda module, inputs, output: seen.append(output))  # pyright: ignore[reportArgumentType]
    try:
        yield seen
    finally:
        handle.remove()

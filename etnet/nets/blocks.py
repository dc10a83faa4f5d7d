"""Convolutional building blocks of the recurrent backbone and the upsampler (paper, §3.2 RCB and MLU)."""

from __future__ import annotations

import torch
from jaxtyping import Float
from torch import Tensor, nn
from torch.nn.functional import interpolate, relu


class ConvReLU(nn.Module):
    """5×5 convolution and ReLU; stride 2 halves the image."""

    def __init__(self, channels_in: int, channels_out: int, stride: int = 1) -> None:
        super().__init__()
        self.conv = nn.Conv2d(channels_in, channels_out, kernel_size=5, stride=stride, padding=2)

    def forward(self, image: Float[Tensor, "b c h w"]) -> Float[Tensor, "b d i j"]:
        return relu(self.conv(image))


class ConvLSTM(nn.Module):
    """3×3 convolutional LSTM; the gates come from [input, hidden] in the order in, forget, out, cell.

    c′ = σ(f) c + σ(i) tanh(g), h′ = σ(o) tanh(c′) (Shi et al. 2015, as in the released code).
    """

    def __init__(self, channels: int) -> None:
        super().__init__()
        self.gates = nn.Conv2d(2 * channels, 4 * channels, kernel_size=3, padding=1)

    def forward(
        self, image: Float[Tensor, "b c h w"], memory: tuple[Tensor, Tensor] | None
    ) -> tuple[Float[Tensor, "b c h w"], Float[Tensor, "b c h w"]]:
        hidden, cell = memory if memory is not None else (torch.zeros_like(image), torch.zeros_like(image))
        gates = self.gates(torch.cat((image, hidden.to(image.dtype)), dim=1)).float()
        enter, forget, out, candidate = gates.chunk(4, dim=1)
        cell = torch.sigmoid(forget) * cell + torch.sigmoid(enter) * torch.tanh(candidate)
        hidden = torch.sigmoid(out) * torch.tanh(cell)
        return hidden, cell


class ConvGRU(nn.Module):
    """3×3 convolutional gated recurrent unit: h′ = h (1 − u) + tanh(out[x, h r]) u, u and r = σ of [x, h] (FireNet)."""

    def __init__(self, channels: int) -> None:
        super().__init__()
        self.reset = nn.Conv2d(2 * channels, channels, kernel_size=3, padding=1)
        self.update = nn.Conv2d(2 * channels, channels, kernel_size=3, padding=1)
        self.out = nn.Conv2d(2 * channels, channels, kernel_size=3, padding=1)

    def forward(self, image: Float[Tensor, "b c h w"], hidden: Tensor | None) -> Float[Tensor, "b c h w"]:
        hidden = torch.zeros_like(image, dtype=torch.float32) if hidden is None else hidden
        both = torch.cat((image, hidden.to(image.dtype)), dim=1)
        update, reset = torch.sigmoid(self.update(both).float()), torch.sigmoid(self.reset(both).float())
        candidate = self.out(torch.cat((image, (hidden * reset).to(image.dtype)), dim=1)).float()
        return hidden * (1 - update) + torch.tanh(candidate) * update


class Residual(nn.Module):
    """Two 3×3 convolutions beside the identity, ReLU after the first and after the sum (E2VID, FireNet)."""

    def __init__(self, channels: int) -> None:
        super().__init__()
        self.first = nn.Conv2d(channels, channels, kernel_size=3, padding=1)
        self.second = nn.Conv2d(channels, channels, kernel_size=3, padding=1)

    def forward(self, image: Float[Tensor, "b c h w"]) -> Float[Tensor, "b c h w"]:
        return relu(self.second(relu(self.first(image))) + image)


class RecurrentLevel(nn.Module):
    """One level of the backbone: halve the image, double the channels, remember (paper, eq. 2)."""

    def __init__(self, channels_in: int, channels_out: int) -> None:
        super().__init__()
        self.down = ConvReLU(channels_in, channels_out, stride=2)
        self.memory = ConvLSTM(channels_out)

    def forward(
        self, image: Float[Tensor, "b c h w"], memory: tuple[Tensor, Tensor] | None
    ) -> tuple[Float[Tensor, "b d i j"], Float[Tensor, "b d i j"]]:
        return self.memory(self.down(image), memory)


class Upsample(nn.Module):
    """One block of the upsampler: bilinear × 2, then 5×5 convolution and ReLU (paper, eq. 4)."""

    def __init__(self, channels_in: int, channels_out: int) -> None:
        super().__init__()
        self.conv = ConvReLU(channels_in, channels_out)

    def forward(self, image: Float[Tensor, "b c h w"]) -> Float[Tensor, "b d i j"]:
        return self.conv(interpolate(image, scale_factor=2, mode="bilinear", align_corners=False))

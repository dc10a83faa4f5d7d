"""Convolutional building blocks of the recurrent backbone and the upsampler (paper, §3.2 RCB and MLU)."""

from __future__ import annotations

import torch
from jaxtyping import Float
from torch import Tensor, nn
from torch.nn.functional import interpolate, relu, silu


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


class ConvNorm(nn.Module):
    """Convolution, norm over the whole image and SiLU (PIE-Net); `is_active=False` leaves the SiLU out."""

    def __init__(self, channels_in: int, channels_out: int, kernel: int = 3, is_active: bool = True) -> None:
        super().__init__()
        self.conv = nn.Conv2d(channels_in, channels_out, kernel, padding=kernel // 2)
        self.norm = nn.GroupNorm(1, channels_out)
        self.is_active = is_active

    def forward(self, image: Float[Tensor, "b c h w"]) -> Float[Tensor, "b d h w"]:
        normed = self.norm(self.conv(image))
        return silu(normed) if self.is_active else normed


class NormalisedConvLSTM(nn.Module):
    """Convolutional LSTM with norms on cell and hidden state (PIE-Net); gates in the order in, forget, out, cell.

    The gates come from [input, hidden] through a 3×3 expansion, one weight a channel for the whole image
    (squeeze and excite, Hu et al. 2018) and a 1×1 projection.
    """

    GROUPS = 4
    SQUEEZE = 8

    def __init__(self, channels_in: int, channels: int) -> None:
        super().__init__()
        wide = 2 * (channels_in + channels)
        self.expand = ConvNorm(channels_in + channels, wide)
        self.squeeze = nn.Conv2d(wide, max(1, wide // self.SQUEEZE), kernel_size=1, bias=False)
        self.excite = nn.Conv2d(max(1, wide // self.SQUEEZE), wide, kernel_size=1, bias=False)
        self.project = ConvNorm(wide, 4 * channels, kernel=1, is_active=False)
        self.hidden_norm = nn.GroupNorm(self.GROUPS, channels)
        self.cell_norm = nn.GroupNorm(self.GROUPS, channels)
        self.channels = channels

    def forward(
        self, image: Float[Tensor, "b c h w"], memory: tuple[Tensor, Tensor] | None
    ) -> tuple[Float[Tensor, "b d h w"], Float[Tensor, "b d h w"]]:
        empty = image.new_zeros(len(image), self.channels, *image.shape[-2:], dtype=torch.float32)
        hidden, cell = (empty, empty) if memory is None else memory
        wide = self.expand(torch.cat((image, hidden.to(image.dtype)), dim=1))
        weights = torch.sigmoid(self.excite(relu(self.squeeze(wide.mean((2, 3), keepdim=True)))))
        enter, forget, out, candidate = self.project(wide * weights).float().chunk(4, dim=1)
        cell = self.cell_norm(torch.sigmoid(forget) * cell + torch.sigmoid(enter) * torch.tanh(candidate)).float()
        return self.hidden_norm(torch.sigmoid(out) * torch.tanh(cell)).float(), cell

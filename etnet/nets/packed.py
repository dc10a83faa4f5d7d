"""Layers packed once for the processor's own kernels: reordered, cast, with their activation fused.

`pack` puts a packed forward before each layer's own; `unpack` takes it away. The weights stay where they are, and a
layer whose weights changed is packed again. Wherever the packed kernels do not apply (a gradient is wanted, another
device, a processor without oneDNN) a layer's own forward runs: it is the fallback, in plain torch, and the two are
equal to rounding.
"""

from __future__ import annotations

from typing import Any

import torch
from torch import Tensor, nn

from etnet.nets.attention import MultiHeadAttention
from etnet.nets.attention_kernels import has_onednn
from etnet.nets.blocks import ConvLSTM, ConvReLU
from etnet.nets.transformer import FeedForward

_NO_SCALARS: list[float] = []


def pack(model: nn.Module) -> None:
    """Let every layer that has a packed form run in it; the weights are packed at their first use."""
    unpack(model)
    inside = {id(part) for module in model.modules() for part in _owned(module)}
    for module in model.modules():
        if id(module) in inside:
            continue
        if isinstance(module, ConvReLU):
            module.forward = PackedConvolution(module.conv, "relu", module)
        elif isinstance(module, ConvLSTM):
            module.forward = PackedMemory(module)
        elif isinstance(module, nn.Conv2d) and _is_simple(module):
            module.forward = PackedConvolution(module, "none", module)  # pyright: ignore[reportAttributeAccessIssue]
        elif isinstance(module, FeedForward):
            module.forward = PackedFeedForward(module)
        elif isinstance(module, MultiHeadAttention):
            module._project = PackedProjection(module)
        elif isinstance(module, nn.Linear):
            module.forward = PackedLinear(module, "none", module)  # pyright: ignore[reportAttributeAccessIssue]


def unpack(model: nn.Module) -> None:
    """Let every layer run its own forward."""
    for module in model.modules():
        for name in ("forward", "_project"):
            if isinstance(module.__dict__.get(name), _Packed):
                del module.__dict__[name]


def _owned(module: nn.Module) -> tuple[nn.Module, ...]:
    """Layers that never run by themselves, because the module around them packs them."""
    if isinstance(module, ConvReLU):
        return (module.conv,)
    return (module.expand, module.contract) if isinstance(module, FeedForward) else ()


def _is_simple(conv: nn.Conv2d) -> bool:
    return conv.groups == 1 and conv.padding_mode == "zeros" and not isinstance(conv.padding, str)


class _Packed:
    """Weights of one layer, packed for each dtype in which it runs; `layer` is called where they do not apply."""

    def __init__(self, layer: nn.Module) -> None:
        self.layer = layer
        self._packs: dict[torch.dtype, tuple[object, tuple[Tensor, ...]]] = {}

    def __getstate__(self) -> dict[str, Any]:
        """A copy packs for itself: packed tensors can neither be copied nor stored."""
        return {**self.__dict__, "_packs": {}}

    def _own(self, *arguments: Any) -> Any:
        """The layer's own forward, in plain torch."""
        return type(self.layer).forward(self.layer, *arguments)

    def _weights(self, weight: Tensor, bias: Tensor | None, example: Tensor) -> tuple[Tensor, ...]:
        """(packed weight, bias) in the dtype that is in force; packed again when the weight is another."""
        dtype, stamp = _dtype_in_force(), (weight.data_ptr(), 0 if weight.is_inference() else weight._version)
        if dtype not in self._packs or self._packs[dtype][0] != stamp:
            cast = [] if bias is None else [bias.detach().to(dtype)]
            packed = self._pack(weight.detach().to(dtype), example)
            self._packs = {**self._packs, dtype: (stamp, (packed, *cast))}
        return self._packs[dtype][1]

    def _pack(self, weight: Tensor, example: Tensor) -> Tensor:
        raise NotImplementedError


class PackedConvolution(_Packed):
    """A convolution and its activation as one oneDNN call."""

    def __init__(self, conv: nn.Conv2d, activation: str, layer: nn.Module) -> None:
        super().__init__(layer)
        self.conv = conv
        self.activation = activation
        self.geometry = [list(conv.padding), list(conv.stride), list(conv.dilation), 1]

    def __call__(self, image: Tensor) -> Tensor:
        conv = self.conv
        if not _applies(image, conv.weight):
            return self._own(image)
        weight, *bias = self._weights(conv.weight, conv.bias, image)
        image = image.to(_dtype_in_force())
        return torch.ops.mkldnn._convolution_pointwise(
            image, weight, bias[0] if bias else None, *self.geometry, self.activation, _NO_SCALARS, ""
        )

    def _pack(self, weight: Tensor, example: Tensor) -> Tensor:
        weight = weight.contiguous(memory_format=torch.channels_last)
        return torch.ops.mkldnn._reorder_convolution_weight(weight, *self.geometry, list(example.shape))


class PackedLinear(_Packed):
    """A linear layer and its activation as one oneDNN call; `rows` are those of a weight that several share."""

    def __init__(
        self, linear: nn.Linear | MultiHeadAttention, activation: str, layer: nn.Module, rows: slice = slice(None)
    ) -> None:
        super().__init__(layer)
        self.linear = linear
        self.activation = activation
        self.rows = rows

    def __call__(self, tokens: Tensor) -> Tensor:
        if not _applies(tokens, self.parameters[0]):
            return self._own(tokens)
        return self.product(tokens)

    @property
    def parameters(self) -> tuple[Tensor, Tensor | None]:
        """Weight and bias as the network holds them."""
        if isinstance(self.linear, MultiHeadAttention):
            return self.linear.in_proj_weight, self.linear.in_proj_bias
        return self.linear.weight, self.linear.bias

    def product(self, tokens: Tensor) -> Tensor:
        """The packed product itself."""
        weight, *bias = self._weights(*self.parameters, tokens)
        tokens = tokens.to(_dtype_in_force())
        return torch.ops.mkldnn._linear_pointwise(
            tokens, weight, bias[0][self.rows] if bias else None, self.activation, _NO_SCALARS, ""
        )

    def _pack(self, weight: Tensor, example: Tensor) -> Tensor:
        batch = example.numel() // example.shape[-1]
        return torch.ops.mkldnn._reorder_linear_weight(weight[self.rows].contiguous(), batch)


class PackedFeedForward(_Packed):
    """Two packed linear layers, the ReLU inside the first."""

    def __init__(self, layer: FeedForward) -> None:
        super().__init__(layer)
        self.expand = PackedLinear(layer.expand, "relu", layer.expand)
        self.contract = PackedLinear(layer.contract, "none", layer.contract)

    def __call__(self, tokens: Tensor) -> Tensor:
        if not _applies(tokens, self.expand.parameters[0]):
            return self._own(tokens)
        return self.contract.product(self.expand.product(tokens))


class PackedProjection(_Packed):
    """q, k and v of an attention site: one packed product where query and memory are the same, else two."""

    def __init__(self, layer: MultiHeadAttention) -> None:
        super().__init__(layer)
        dim = layer.in_proj_weight.shape[1]
        self.all = PackedLinear(layer, "none", layer)
        self.query = PackedLinear(layer, "none", layer, slice(None, dim))
        self.memory = PackedLinear(layer, "none", layer, slice(dim, None))

    def __call__(self, query: Tensor, memory: Tensor) -> tuple[Tensor, ...]:
        if not _applies(query, self.all.parameters[0], memory):
            return MultiHeadAttention._project(self.layer, query, memory)  # pyright: ignore[reportArgumentType]
        if query is memory:
            return self.all.product(query).chunk(3, dim=-1)
        return self.query.product(query), *self.memory.product(memory).chunk(2, dim=-1)


class PackedMemory(_Packed):
    """A ConvLSTM whose three sigmoids are one, and whose tanh is 2σ(2x) − 1: torch's own is ten times slower.

    The two agree to 3 · 10⁻⁷ in absolute terms. Gates, cell and hidden state are fp32 in every precision.
    """

    layer: ConvLSTM

    def __call__(self, image: Tensor, memory: tuple[Tensor, Tensor] | None) -> tuple[Tensor, Tensor]:
        if not _applies(image, self.layer.gates.weight, *(memory or ())):
            return self._own(image, memory)
        channels = image.shape[1]
        hidden, cell = memory if memory is not None else (torch.zeros_like(image), torch.zeros_like(image).float())
        gates = self.layer.gates(torch.cat((image, hidden.to(image.dtype)), dim=1)).float()
        enter, forget, out = torch.sigmoid(gates[:, : 3 * channels]).chunk(3, dim=1)
        cell = torch.addcmul(forget * cell, enter, _tanh(gates[:, 3 * channels :]))
        return _tanh(cell).mul_(out), cell


def _tanh(values: Tensor) -> Tensor:
    """tanh x = 2σ(2x) − 1, in a tensor of its own."""
    return values.mul(2).sigmoid_().mul_(2).sub_(1)


def _dtype_in_force() -> torch.dtype:
    """What a layer computes in here: autocast's dtype inside it, else fp32."""
    return torch.get_autocast_dtype("cpu") if torch.is_autocast_enabled("cpu") else torch.float32


def _applies(values: Tensor, weight: Tensor, *others: Tensor) -> bool:
    """Whether the packed kernels can take this call; `others` are read beside `values`."""
    if values.device.type != "cpu" or weight.device.type != "cpu" or weight.dtype != torch.float32:
        return False
    if torch.is_grad_enabled() and any(tensor.requires_grad for tensor in (values, weight, *others)):
        return False
    return values.numel() > 0 and has_onednn()

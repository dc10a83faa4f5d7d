"""What turns gradients into steps: AdamW, or Muon for the matrices and AdamW for everything else."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Iterable
from typing import Any

import torch
from jaxtyping import Float
from torch import Tensor, nn
from torch.optim import Optimizer

from etnet.nets.attention import MultiHeadAttention
from etnet.nets.blocks import ConvLSTM
from etnet.nets.etnet import ETNet
from etnet.training.config import OptimiserConfig

NEWTON_SCHULZ = (3.4445, -4.7750, 2.0315)
"""Coefficients of the odd polynomial that drives all singular values to about 1 (Jordan et al. 2024, "Muon")."""
NUM_ITERATIONS = 5
OTHERS_RATE_SHARE = 0.25
"""What is no matrix learns at this share of the rate: at a rate that suits matrices biases drive ReLUs silent."""
LIKE_ADAM = 0.2
"""An orthogonal r × c matrix times this times √max(r, c) is about as large, element by element, as a step of AdamW, so
that one learning rate serves both (Liu et al. 2025, "Muon is scalable for LLM training", eq. 4)."""


class Muon(Optimizer):
    """Steps of equal size in every direction for matrices; AdamW for what is no matrix.

    A matrix's momentum is replaced by the nearest orthogonal matrix, so that directions with small gradients are
    learned as fast as those with large ones. Groups with `blocks` > 0 are matrices (a convolution is out × in·k·k),
    made of that many matrices on top of each other (q, k, v; the four gates); groups with `blocks` = 0 are AdamW's.
    """

    def __init__(self, groups: Iterable[dict[str, Any]], weight_decay: float, momentum: float = 0.95) -> None:
        defaults = {"lr": 1e-3, "weight_decay": weight_decay, "momentum": momentum, "betas": (0.9, 0.999), "eps": 1e-8}
        super().__init__(groups, defaults)

    @torch.no_grad()
    def step(self, closure: Callable[[], float] | None = None) -> None:  # pyright: ignore[reportIncompatibleMethodOverride]
        """One update from the gradients that the parameters hold."""
        assert closure is None, "gradients are computed before the step"
        for group in self.param_groups:
            trained = [parameter for parameter in group["params"] if parameter.grad is not None]
            for parameter in trained:
                parameter.mul_(1 - group["lr"] * group["weight_decay"])
            if group["blocks"]:
                self._step_matrices(trained, group)
            else:
                self._step_others(trained, group)

    def _step_matrices(self, trained: list[nn.Parameter], group: dict[str, Any]) -> None:
        by_shape: dict[tuple[int, int], list[tuple[Tensor, Tensor]]] = defaultdict(list)
        for parameter in trained:
            assert parameter.grad is not None
            state = self.state[parameter]
            mean = state.setdefault("mean", torch.zeros_like(parameter))
            mean.lerp_(parameter.grad, 1 - group["momentum"])
            ahead = parameter.grad.lerp(mean, group["momentum"])
            for target, piece in zip(parameter.chunk(group["blocks"]), ahead.chunk(group["blocks"]), strict=True):
                matrix = piece.flatten(1)
                by_shape[matrix.shape[0], matrix.shape[1]].append((target, matrix))
        for shape, found in by_shape.items():
            steps = orthogonalised(torch.stack([matrix for _, matrix in found]))
            size = group["lr"] * LIKE_ADAM * max(shape) ** 0.5
            for (target, _), step in zip(found, steps, strict=True):
                target.sub_(step.reshape(target.shape), alpha=size)

    def _step_others(self, trained: list[nn.Parameter], group: dict[str, Any]) -> None:
        first, second = group["betas"]
        for parameter in trained:
            assert parameter.grad is not None
            state = self.state[parameter]
            mean = state.setdefault("mean", torch.zeros_like(parameter))
            square = state.setdefault("square", torch.zeros_like(parameter))
            count = state.setdefault("count", torch.zeros(())).add_(1).item()
            mean.lerp_(parameter.grad, 1 - first)
            square.mul_(second).addcmul_(parameter.grad, parameter.grad, value=1 - second)
            scale = (square / (1 - second**count)).sqrt_().add_(group["eps"])
            parameter.addcdiv_(mean, scale, value=-group["lr"] / (1 - first**count))


def orthogonalised(matrices: Float[Tensor, "n r c"]) -> Float[Tensor, "n r c"]:
    """About U Vᵀ of each matrix U S Vᵀ: singular values between .7 and 1.2, by five Newton-Schulz iterations."""
    a, b, c = NEWTON_SCHULZ
    is_tall = matrices.shape[1] > matrices.shape[2]
    x = matrices.mT if is_tall else matrices
    x = x / (torch.linalg.matrix_norm(x, keepdim=True) + 1e-7)
    for _ in range(NUM_ITERATIONS):
        gram = x @ x.mT
        x = a * x + (b * gram + c * (gram @ gram)) @ x
    return x.mT if is_tall else x


def build_optimiser(model: ETNet, others: Iterable[nn.Parameter], config: OptimiserConfig) -> Optimizer:
    """The optimiser that the config names, over the network's parameters and `others`."""
    if config.kind == "adamw":
        return torch.optim.AdamW([*model.parameters(), *others], weight_decay=config.weight_decay)
    return Muon(_groups(model, list(others)), config.weight_decay)


def _groups(model: ETNet, others: list[nn.Parameter]) -> list[dict[str, Any]]:
    """The head and the tail meet voxels and images, not features, and stay with AdamW as is usual for Muon."""
    blocks: dict[int, list[nn.Parameter]] = {0: list(others), 1: [], 3: [], 4: []}
    fused = {module.in_proj_weight: 3 for module in model.modules() if isinstance(module, MultiHeadAttention)}
    fused |= {module.gates.weight: 4 for module in model.modules() if isinstance(module, ConvLSTM)}
    ends = {*model.head.parameters(), *model.tail.parameters()}
    for parameter in model.parameters():
        is_matrix = parameter.ndim >= 2 and parameter not in ends
        blocks[fused.get(parameter, 1) if is_matrix else 0].append(parameter)
    return [
        {"params": parameters, "blocks": count, "rate_share": 1.0 if count else OTHERS_RATE_SHARE}
        for count, parameters in blocks.items()
    ]

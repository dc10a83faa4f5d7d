"""What turns gradients into steps: AdamW, or Muon for the matrices and AdamW for everything else."""

# pyright: reportPrivateImportUsage=false
# torch's own optimisers are written with its _foreach functions; there is no public name for them.
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
GRAM_FROM = 1.5
"""From this ratio of the sides on, iterating on the Gram matrix takes fewer products than iterating on the matrix."""
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

    def load_state_dict(self, state_dict: dict[str, Any]) -> None:
        """As torch does it, but counts stay with the processor, which reads them at each step."""
        super().load_state_dict(state_dict)
        numbers = [number for group in state_dict["param_groups"] for number in group["params"]]
        parameters = [parameter for group in self.param_groups for parameter in group["params"]]
        for number, parameter in zip(numbers, parameters, strict=True):
            if "count" in state_dict["state"].get(number, {}):
                self.state[parameter]["count"] = state_dict["state"][number]["count"]

    @torch.no_grad()
    def step(self, closure: Callable[[], float] | None = None) -> None:  # pyright: ignore[reportIncompatibleMethodOverride]
        """One update from the gradients that the parameters hold."""
        assert closure is None, "gradients are computed before the step"
        for group in self.param_groups:
            trained: list[Tensor] = [parameter for parameter in group["params"] if parameter.grad is not None]
            if not trained:
                continue
            torch._foreach_mul_(trained, 1 - group["lr"] * group["weight_decay"])
            if group["blocks"]:
                self._step_matrices(trained, group)
            else:
                self._step_others(trained, group)

    def _step_matrices(self, trained: list[Tensor], group: dict[str, Any]) -> None:
        gradients, means = _gradients(trained), self._held(trained, "mean")
        torch._foreach_lerp_(means, gradients, 1 - group["momentum"])
        ahead = torch._foreach_lerp(gradients, means, group["momentum"])
        by_shape: dict[tuple[int, int], list[tuple[Tensor, Tensor]]] = defaultdict(list)
        for parameter, direction in zip(trained, ahead, strict=True):
            for target, piece in zip(parameter.chunk(group["blocks"]), direction.chunk(group["blocks"]), strict=True):
                matrix = piece.flatten(1)
                by_shape[matrix.shape[0], matrix.shape[1]].append((target, matrix))
        for shape, found in by_shape.items():
            steps = orthogonalised(torch.stack([matrix for _, matrix in found]))
            size = group["lr"] * LIKE_ADAM * max(shape) ** 0.5
            targets = [target for target, _ in found]
            torch._foreach_add_(targets, [s.reshape(t.shape) for s, t in zip(steps, targets, strict=True)], alpha=-size)

    def _step_others(self, trained: list[Tensor], group: dict[str, Any]) -> None:
        """AdamW on all of them at once: hundreds of small vectors are slow one by one."""
        first, second = group["betas"]
        by_count: dict[float, list[Tensor]] = defaultdict(list)
        for parameter in trained:
            count = self.state[parameter].setdefault("count", torch.zeros(())).add_(1).item()
            by_count[count].append(parameter)
        for count, parameters in by_count.items():
            gradients = _gradients(parameters)
            means, squares = self._held(parameters, "mean"), self._held(parameters, "square")
            torch._foreach_lerp_(means, gradients, 1 - first)
            torch._foreach_mul_(squares, second)
            torch._foreach_addcmul_(squares, gradients, gradients, value=1 - second)
            scales = torch._foreach_div(squares, 1 - second**count)
            torch._foreach_sqrt_(scales)
            torch._foreach_add_(scales, group["eps"])
            torch._foreach_addcdiv_(parameters, means, scales, value=-group["lr"] / (1 - first**count))

    def _held(self, parameters: list[Tensor], name: str) -> list[Tensor]:
        return [self.state[parameter].setdefault(name, torch.zeros_like(parameter)) for parameter in parameters]


def _gradients(parameters: list[Tensor]) -> list[Tensor]:
    return [parameter.grad for parameter in parameters if parameter.grad is not None]


def orthogonalised(matrices: Float[Tensor, "n r c"]) -> Float[Tensor, "n r c"]:
    """About U Vᵀ of each matrix U S Vᵀ: singular values between .7 and 1.2, by five Newton-Schulz iterations.

    Each iteration is X ← (aI + bG + cG²) X with G = X Xᵀ. For wide matrices the small side is enough: what multiplies X
    is gathered in Q, G follows as M G M, and X is touched at the beginning and at the end alone.
    """
    is_tall = matrices.shape[1] > matrices.shape[2]
    x = matrices.mT if is_tall else matrices
    x = x / (torch.linalg.matrix_norm(x, keepdim=True) + 1e-7)
    x = _by_gram(x) if x.shape[2] > GRAM_FROM * x.shape[1] else _by_matrix(x)
    return x.mT if is_tall else x


def _by_matrix(x: Float[Tensor, "n r c"]) -> Float[Tensor, "n r c"]:
    a, b, c = NEWTON_SCHULZ
    for _ in range(NUM_ITERATIONS):
        gram = x @ x.mT
        x = a * x + (b * gram + c * (gram @ gram)) @ x
    return x


def _by_gram(x: Float[Tensor, "n r c"]) -> Float[Tensor, "n r c"]:
    a, b, c = NEWTON_SCHULZ
    gram = x @ x.mT
    identity = torch.eye(x.shape[1], dtype=x.dtype, device=x.device).expand_as(gram)
    gathered = identity
    for iteration in range(NUM_ITERATIONS):
        factor = torch.baddbmm(b * gram, gram, gram, alpha=c) + a * identity
        gathered = factor if iteration == 0 else factor @ gathered
        if iteration + 1 < NUM_ITERATIONS:
            gram = factor @ gram @ factor
    return gathered @ x


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

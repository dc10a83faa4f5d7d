"""Which precision is fastest on this machine: measured, because CPUs differ by a factor of hundreds."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING, Literal

import torch

from etnet.errors import ModelError
from etnet.nets.runtime import Runtime, apply_runtime

if TYPE_CHECKING:
    from etnet.nets.presets import Network

PrecisionChoice = Literal["fp32", "bf16", "auto"]
_PROBE_SIZE = (96, 128)


def choose_runtime(model: Network, precision: PrecisionChoice, device: str = "cpu") -> Runtime:
    """The runtime for `precision`; "auto" times one encode and decode of each."""
    if precision not in ("fp32", "bf16", "auto"):
        raise ModelError(f"precision is {precision!r}; it takes 'fp32', 'bf16' or 'auto'")
    if precision != "auto":
        return Runtime(precision=precision)
    if not bf16_is_worth_trying(device):
        return Runtime(precision="fp32")
    candidates = [Runtime(precision="fp32"), Runtime(precision="bf16")]
    return min(candidates, key=lambda runtime: _time_step(model, runtime, device))


def bf16_is_worth_trying(device: str = "cpu", size: int = 128) -> bool:
    """Whether a small bf16 matrix product is at most as slow as an fp32 one.

    CPUs without bf16 instructions fall back to code that is hundreds of times slower: a whole step in bf16 would
    take minutes there, so a product of 4 MFLOP decides first.
    """

    def product(dtype: torch.dtype) -> Callable[[], object]:
        matrix = torch.ones(size, size, dtype=dtype, device=device)
        return lambda: matrix @ matrix

    return _best_of(product(torch.bfloat16)) <= 1.5 * _best_of(product(torch.float32))


def _time_step(model: Network, runtime: Runtime, device: str) -> float:
    before = model.runtime
    apply_runtime(model, runtime)
    voxel = torch.zeros(1, model.bins, *_PROBE_SIZE, device=device)
    try:
        with torch.inference_mode():
            return _best_of(lambda: model(voxel))
    finally:
        apply_runtime(model, replace(before))


def _best_of(call: Callable[[], object], runs: int = 3) -> float:
    call()
    seconds = []
    for _ in range(runs):
        start = time.perf_counter()
        call()
        seconds.append(time.perf_counter() - start)
    return min(seconds)

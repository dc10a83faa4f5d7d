"""Draws that several parts of a scene share."""

from __future__ import annotations

import math
from typing import overload

import numpy as np
from jaxtyping import Float64

from etnet.simulation.config import Range


@overload
def log_uniform(rng: np.random.Generator, within: Range) -> float: ...
@overload
def log_uniform(
    rng: np.random.Generator, within: Range, size: int | tuple[int, ...]
) -> Float64[np.ndarray, "*size"]: ...
def log_uniform(
    rng: np.random.Generator, within: Range, size: int | tuple[int, ...] | None = None
) -> float | Float64[np.ndarray, "*size"]:
    """Numbers whose logarithm is uniform over `within`. Both ends 0 gives 0."""
    low, high = within
    if high <= 0:
        return 0.0 if size is None else np.zeros(size)
    drawn = np.exp(rng.uniform(math.log(max(low, 1e-9)), math.log(high), size))
    return float(drawn) if size is None else drawn

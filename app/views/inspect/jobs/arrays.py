"""Tensors as the arrays that pictures are drawn from."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from torch import Tensor


def array(tensor: Tensor) -> np.ndarray:
    """The values as read-only float32."""
    values = tensor.detach().float().cpu().numpy()
    values.flags.writeable = False
    return values

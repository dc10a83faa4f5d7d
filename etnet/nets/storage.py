"""How much memory tensors really hold."""

from __future__ import annotations

from collections.abc import Iterable

from torch import Tensor


def kept_alive(tensors: Iterable[Tensor]) -> int:
    """Bytes that these tensors keep from being freed: of a view it is the whole of what it looks into, counted once."""
    blocks = {(block := tensor.untyped_storage()).data_ptr(): block.nbytes() for tensor in tensors}
    return sum(blocks.values())

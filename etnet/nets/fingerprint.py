"""A network's weights as one hash."""

from __future__ import annotations

import hashlib
from typing import Any

from torch import nn


def weights_sha256(model: nn.Module) -> str:
    """A hash of a network's configuration and weights, whatever file and order they came in."""
    config: Any = getattr(model, "config", None)
    digest = hashlib.sha256(f"{type(model).__name__} {config!r}".encode())
    for name, tensor in sorted(model.state_dict().items()):
        digest.update(f"{name} {tuple(tensor.shape)}".encode())
        digest.update(tensor.detach().float().cpu().contiguous().numpy().astype("<f4", copy=False).data)
    return digest.hexdigest()

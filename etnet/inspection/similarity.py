"""Which places hold what one place holds: cosine similarity, in the same window or against another window or run."""

from __future__ import annotations

import torch
from jaxtyping import Float
from torch import Tensor

from etnet.inspection.features import FeatureMap


def cosine_similarity(
    map_: FeatureMap, reference: Float[Tensor, " channels"], mean: Float[Tensor, " channels"] | None = None
) -> Float[Tensor, "rows columns"]:
    """v · r / (|v| |r|) of every vector of a map with one (`map_.at(x, y)`, of this map or of another); −1 … 1.

    `mean` is taken off both first, where all vectors share a large part; a vector of length zero is like nothing, 0.
    """
    if reference.shape[-1] != map_.values.shape[-1]:
        raise ValueError(
            f"the reference has {reference.shape[-1]} channels, the map {map_.values.shape[-1]}; "
            "take it from a map of the same feature of the same network"
        )
    values, wanted = map_.values.double(), reference.double()
    if mean is not None:
        values, wanted = values - mean.double(), wanted - mean.double()
    lengths = values.norm(dim=-1) * wanted.norm()
    return torch.where(lengths > 0, values @ wanted / lengths.clamp_min(1e-300), 0.0).float()

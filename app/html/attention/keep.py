"""A threshold on a map: which of its tokens are drawn, by the mass that they hold or by their rank."""

from __future__ import annotations

import numpy as np
from jaxtyping import Bool, Float

from app.html.attention.look import Keep
from app.html.units import count, of_whole


def kept(row: Float[np.ndarray, " tokens"], keep: Keep) -> Bool[np.ndarray, " tokens"]:
    """The tokens of a map that are drawn."""
    kind, _, number = keep.partition(" ")
    if kind == "all":
        return np.ones(len(row), bool)
    import torch

    from etnet.inspection.threshold import holding, strongest

    weights = torch.from_numpy(row.copy())
    return (holding(weights, int(number) / 100) if kind == "mass" else strongest(weights, int(number))).numpy()


def kept_words(row: Float[np.ndarray, " tokens"], keep: Keep) -> str:
    """How many tokens are drawn and what they hold; empty where all are."""
    if keep == "all":
        return ""
    drawn = kept(row, keep)
    tokens = f"{count(int(drawn.sum()))} token{'' if drawn.sum() == 1 else 's'}"
    return f"{tokens} hold {of_whole(float(row[drawn].sum() / max(float(row.sum()), 1e-20)))}"

"""How attention is shown: a value that all maps are drawn by."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

from app.html.pictures import Tones

Gather = Literal["mean", "max", "min"]
Order = Literal["network", "effect", "image", "entropy", "distance"]
"""Of maps: the network's, by the effect of masking on the pixel or on the image, by how sharp they are, or how far."""
Direction = Literal["attends to", "attended by"]
MapRange = Literal["shared", "per map"]
Weight = Literal["alpha", "value"]
"""Attention weights α, or what is handed over by them: ‖αvW_O‖."""
Keep = Literal["all", "mass 50", "mass 90", "top 10", "top 50"]
"""Which tokens of a map are drawn: the fewest that hold so much of it in per cent, or so many of the strongest."""
SITE_PATTERN = r"scale[0-3]\.(encoder|decoder)\.\d{1,2}\.(self|cross)"
"""How the library names a site."""
MOST_HEADS = 64


@dataclass(frozen=True, slots=True)
class AttentionLook:
    """How attention is shown: from which pixel, one head or all gathered (`None`), and how it is coloured."""

    query: tuple[int, int]
    head: int | None = None
    opacity: float = 1.0
    map_range: MapRange = "shared"
    tones: Tones = field(default_factory=Tones)
    gather: Gather = "mean"
    order: Order = "network"
    direction: Direction = "attends to"
    is_linear: bool = False
    is_smooth: bool = False
    keep: Keep = "all"

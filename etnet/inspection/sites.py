"""Names of attention sites taken apart, and what a network has to look into."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

from etnet.errors import ModelError

if TYPE_CHECKING:
    from etnet.nets.attention import Attention

Direction = Literal["attends to", "attended by"]
"""Of a token's map: its row (where it looks) or its column (who looks at it)."""

_PATTERN = re.compile(r"scale(\d)\.(encoder|decoder)\.(\d+)\.(self|cross)")


@dataclass(frozen=True, slots=True, order=True)
class Site:
    """One attention: "scale2.decoder.0.cross". Scales by the paper's index, 1 the finest of three."""

    scale: int
    part: Literal["encoder", "decoder"]
    layer: int
    kind: Literal["self", "cross"]

    @staticmethod
    def of(name: str) -> Site:
        """Take a name apart."""
        found = _PATTERN.fullmatch(name)
        if found is None:
            raise ModelError(f"{name!r} is no attention site; one is called like 'scale1.encoder.2.self'")
        scale, part, layer, kind = found.groups()
        return Site(int(scale), part, int(layer), kind)  # pyright: ignore[reportArgumentType]  the pattern says so

    @property
    def name(self) -> str:
        """As the network calls it."""
        return f"scale{self.scale}.{self.part}.{self.layer}.{self.kind}"

    def reads(self, coarsest: int) -> int:
        """The scale whose tokens are read: its own, or in cross-attention the next coarser; the coarsest its own."""
        return min(self.scale + 1, coarsest) if self.kind == "cross" else self.scale

    def in_words(self, coarsest: int, direction: Direction = "attends to") -> str:
        """A title that says direction and scales: "1/4 keys that this 1/2 query attends to"."""
        query, key = (f"1/{2**scale}" if scale else "full-size" for scale in (self.scale, self.reads(coarsest)))
        if direction == "attends to":
            return f"{key} keys that this {query} query attends to"
        return f"{query} queries that attend to this {key} key"


def sites_of(attention: Attention) -> tuple[Site, ...]:
    """The probed sites, in the order in which the network passes them. Says so where a network has no attention."""
    if not attention.sites:
        raise ModelError("no attention was probed; this network has none, or AttentionProbe named no site of it")
    return tuple(Site.of(name) for name in attention.sites)

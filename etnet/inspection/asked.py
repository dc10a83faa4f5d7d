"""What an inspector shows, as a value: the question that a copied snippet of Python answers."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import Literal, get_args

from etnet.errors import ModelError
from etnet.inspection.basis import Centre
from etnet.inspection.entropy import HeadChoice
from etnet.inspection.features import Feature
from etnet.inspection.mass import Region
from etnet.inspection.sites import Direction
from etnet.nets.intervention import Intervention

What = Literal[
    "frame", "voxel", "map", "numbers", "value_weighted", "received", "rollout", "links",
    "effect", "atlas", "feature", "colours", "similarity", "map_difference", "path", "track", "masked",
    "attribution", "occlusion", "gates", "norms", "memory_depth", "curve", "cause", "sources", "spread", "error",
    "table", "sinks", "padding", "without", "apart",
]  # fmt: skip
"""One for each inspector."""

NEEDED: dict[What, tuple[str, ...]] = {
    "frame": (), "voxel": (), "map": ("site", "token"), "numbers": ("site", "token", "quantity"),
    "value_weighted": ("site", "token"), "received": ("site",), "rollout": ("token",), "links": ("token", "count"),
    "effect": ("part",), "atlas": (), "feature": ("feature",), "colours": ("feature",),
    "similarity": ("feature", "pixel"), "map_difference": ("site", "pixel"), "path": ("pixel", "until"),
    "track": ("pixel", "site", "windows", "quantity"), "masked": ("pixel", "site", "windows"),
    "attribution": ("pixel",), "occlusion": ("pixel",),
    "gates": ("level", "quantity"), "norms": ("windows",), "memory_depth": ("depths",), "curve": ("windows",),
    "cause": ("pixel",), "sources": ("pixel",), "spread": (), "error": (),
    "table": ("token", "quantity"), "sinks": ("site",), "padding": ("site", "token"), "without": ("cut",),
    "apart": ("quantity",),
}  # fmt: skip
"""The fields that a question cannot do without; the others have the defaults of the inspector's function."""


@dataclass(frozen=True, slots=True)
class OneMap:
    """One map of a moment: of which pixel's token, at which site, of which heads, in which direction."""

    pixel: tuple[int, int]
    site: str
    head: HeadChoice = "mean"
    direction: Direction = "attends to"


@dataclass(frozen=True, slots=True)
class Asked:
    """One inspector's question. Fields that a question does not use are left at `None`."""

    what: What
    site: str | None = None
    token: int | None = None
    pixel: tuple[int, int] | None = None
    head: HeadChoice | None = None
    direction: Direction | None = None
    feature: Feature | None = None
    centre: Centre | None = None
    level: int | None = None
    part: str | None = None
    """The name of an ablation."""
    quantity: str | None = None
    """Which field of the result: "entropy" and the like."""
    windows: tuple[int, int] | None = None
    """First and last window, both included."""
    until: int | None = None
    region: Region | None = None
    near: int | None = None
    """Pixels to each side of the query, in place of a region."""
    depths: Sequence[int] | None = None
    count: int | None = None
    discard: float | None = None
    num_back: int | None = None
    patch: int | None = None
    levels: frozenset[int] | None = None
    tolerance: float | None = None
    towards: float | None = None
    furthest: int | None = None
    drop: float | None = None
    num_seeds: int | None = None
    floor: float | None = None
    then: OneMap | None = None
    """Of "map_difference": the other moment's map, where it is of another query than this one's."""
    age: int | None = None
    """Of "attribution": of how many windows before the moment's the events are; 0 by default."""
    cut: Intervention | None = None
    """Of "without": what is taken away for one decode."""
    reference: Feature | None = None
    """Of "similarity": the other moment's feature, where its network has another site than this one's."""

    def __post_init__(self) -> None:
        if self.what not in get_args(What):
            raise ModelError(f"{self.what!r} cannot be asked; there are {', '.join(get_args(What))}")
        missing = [name for name in NEEDED[self.what] if getattr(self, name) is None]
        if missing:
            raise ModelError(f"{self.what!r} is asked with no {' and no '.join(missing)}; give it")

    def given(self, *names: str) -> dict[str, object]:
        """Those of some fields that are set."""
        known = {field.name for field in fields(self)}
        assert known >= set(names)
        return {name: getattr(self, name) for name in names if getattr(self, name) is not None}

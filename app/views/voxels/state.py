"""Which voxel bin is enlarged."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from app.state.checks import whole


@dataclass(frozen=True, slots=True)
class VoxelsState:
    """`None` shows all bins beside each other."""

    view: ClassVar[str] = "voxels"
    voxel_bin: int | None = whole(None, 0, 31)

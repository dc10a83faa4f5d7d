"""How grey values are shown."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from etnet.render.tone import Tone


@dataclass(frozen=True, slots=True)
class ReconstructionState:
    """`tone` maps the network's raw output, and the camera's frame, to grey levels."""

    view: ClassVar[str] = "reconstruction"
    tone: Tone = "auto"

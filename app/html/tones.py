"""How grey values are shown, the same for the reconstruction and the camera."""

from __future__ import annotations

from dataclasses import dataclass

from etnet.render.tone import Tone


@dataclass(frozen=True, slots=True)
class Tones:
    """`is_linear_light` is what the network's card says of its frames."""

    tone: Tone = "auto"
    is_linear_light: bool = True

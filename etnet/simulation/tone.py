"""From a video's code values to light and back, by the transfer curve that the file states.

Sources: ITU-R BT.709-6 (§1.2), IEC 61966-2-1 (sRGB), ITU-R BT.2100-2 (PQ and HLG, tables 4 and 5). Light is relative:
1 is white. PQ states absolute luminance; its white is 203 cd/m² (ITU-R BT.2408-7, §2.1), so light above 1 occurs.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Literal

import numpy as np
from jaxtyping import Float, Float32, UInt8, UInt16

Curve = Literal["bt709", "srgb", "pq", "hlg", "linear", "gamma"]
PQ_WHITE = 203.0
"""cd/m² that count as white."""
_HLG_WHITE = 0.265
"""Scene light of HLG's reference white, 75 % of the signal (BT.2408-7, table 1)."""
_A, _B, _C = 0.17883277, 0.28466892, 0.55991073
_M1, _M2, _C1, _C2, _C3 = 0.1593017578125, 78.84375, 0.8359375, 18.8515625, 18.6875


@dataclass(frozen=True, slots=True)
class Tone:
    """A transfer curve; `gamma` is the exponent of "gamma" alone."""

    curve: Curve = "gamma"
    gamma: float = 2.2

    def light(self, code: Float[np.ndarray, "*shape"]) -> Float[np.ndarray, "*shape"]:
        """Relative linear light of code values in 0 … 1."""
        code = np.clip(code, 0.0, 1.0)
        if self.curve == "bt709":
            return np.where(code < 0.081, code / 4.5, ((code + 0.099) / 1.099) ** (1 / 0.45))
        if self.curve == "srgb":
            return np.where(code <= 0.04045, code / 12.92, ((code + 0.055) / 1.055) ** 2.4)
        if self.curve == "pq":
            root = code ** (1 / _M2)
            return (np.maximum(root - _C1, 0) / (_C2 - _C3 * root)) ** (1 / _M1) * (10_000 / PQ_WHITE)
        if self.curve == "hlg":
            scene = np.where(code <= 0.5, code**2 / 3, (np.exp((code - _C) / _A) + _B) / 12)
            return scene / _HLG_WHITE
        return code if self.curve == "linear" else code**self.gamma

    def code(self, light: Float[np.ndarray, "*shape"]) -> Float32[np.ndarray, "*shape"]:
        """Code values in 0 … 1 of light: what a picture of this tone stores."""
        light = np.maximum(light, 0)
        if self.curve == "bt709":
            code = np.where(light < 0.018, 4.5 * light, 1.099 * light**0.45 - 0.099)
        elif self.curve == "srgb":
            code = np.where(light <= 0.0031308, 12.92 * light, 1.055 * light ** (1 / 2.4) - 0.055)
        elif self.curve == "pq":
            power = (light * (PQ_WHITE / 10_000)) ** _M1
            code = ((_C1 + _C2 * power) / (1 + _C3 * power)) ** _M2
        elif self.curve == "hlg":
            scene = light * _HLG_WHITE
            high = _A * np.log(np.maximum(12 * scene - _B, 1e-9)) + _C
            code = np.where(scene <= 1 / 12, np.sqrt(3 * scene), high)
        else:
            code = light if self.curve == "linear" else light ** (1 / self.gamma)
        return np.clip(code, 0, 1).astype(np.float32)

    def __str__(self) -> str:
        names = {"bt709": "BT.709", "srgb": "sRGB", "pq": "PQ", "hlg": "HLG", "linear": "linear"}
        return names.get(self.curve, f"gamma {self.gamma:g}")


@lru_cache(maxsize=16)
def light_table(tone: Tone, bits: int, is_limited: bool) -> Float32[np.ndarray, " levels"]:
    """Light of every whole code of `bits` bits. Limited range keeps black at 16 and white at 235 (× 2^(bits − 8))."""
    levels = np.arange(1 << bits, dtype=np.float64)
    if is_limited:
        unit = 1 << (bits - 8)
        code = (levels - 16 * unit) / (219 * unit)
    else:
        code = levels / ((1 << bits) - 1)
    return tone.light(code).astype(np.float32)


def stored_picture(
    light: Float32[np.ndarray, "h w"], tone: Tone, bits: int
) -> UInt8[np.ndarray, "h w"] | UInt16[np.ndarray, "h w"]:
    """The light as a picture of the tone it came in: 8 bits, or 16 where the source had more than 8."""
    kind, top = (np.uint8, 255) if bits <= 8 else (np.uint16, 65_535)
    return np.rint(tone.code(light) * np.float32(top)).astype(kind)

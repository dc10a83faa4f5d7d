"""Events that no light made, of a sensor that is looked at for long: its hot pixels stay the same."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float32

from etnet.simulation.sensor import Crossings, SensorTraits, draw_noise


class Noise:
    """Shot noise, four times rarer at white than at black, and hot pixels that are drawn once."""

    def __init__(self, num_pixels: int, traits: SensorTraits, rng: np.random.Generator) -> None:
        num_hot = int(rng.binomial(num_pixels, traits.hot_share))
        self._hot = rng.choice(num_pixels, num_hot, replace=False).astype(np.int64)
        self._rates = traits.hot_hz * rng.uniform(0.2, 1.0, num_hot)
        self._shots = SensorTraits(1.0, 1.0, shot_hz=traits.shot_hz)

    def draw(self, light: Float32[np.ndarray, "h w"], span: tuple[float, float], rng: np.random.Generator) -> Crossings:
        """Noise over `span` (µs) under this light, in no particular order."""
        shots = draw_noise(light, span, self._shots, rng)
        fired = rng.poisson(self._rates * (span[1] - span[0]) * 1e-6)
        pixel = np.repeat(self._hot, fired)
        t = rng.uniform(*span, len(pixel))
        p = np.where(rng.random(len(pixel)) < 0.7, 1, -1).astype(np.int8)
        return Crossings(*(np.concatenate(pair) for pair in zip(shots, (pixel, t, p), strict=True)))

"""Training sensors around real ones: what a twin measured of recordings becomes ranges to draw from."""

from __future__ import annotations

import math
from collections.abc import Sequence

from etnet.simulation.config import Range, SensorConfig
from etnet.simulation.settings import PixelSettings


def sensors_around(measured: Sequence[PixelSettings], widened: float = 1.5) -> SensorConfig:
    """Ranges around the settings of real sensors (`measure_twin(recording).pixels`).

    Each goes from the least value ÷ `widened` to the largest × `widened`; what is 0 for all of them stays off. One
    threshold in seven is drawn from the usual, wider range. A bandwidth is that of a white pixel, and becomes the time
    constant of all pixels.
    """
    if not measured or widened < 1:
        raise ValueError(f"{len(measured)} sensors, widened {widened:g} times; wanted one or more, and 1 or more")
    ratios = [math.log(one.pos_thres / one.neg_thres) for one in measured]
    centre = sum(ratios) / len(ratios)

    def within(values: Sequence[float], most: float = math.inf) -> Range:
        positive = [value for value in values if value > 0]
        return (min(positive) / widened, min(max(positive) * widened, most)) if positive else (0.0, 0.0)

    thresholds = [(one.pos_thres * one.neg_thres) ** 0.5 for one in measured]
    return SensorConfig(
        threshold_core=within(thresholds, 10.0),
        balance_center=math.exp(centre),
        balance_sigma=max(0.1, *(abs(ratio - centre) for ratio in ratios)),
        mismatch=within([one.sigma_thres / t for one, t in zip(measured, thresholds, strict=True)], 0.3),
        refractory_us=within([one.refractory_us for one in measured]),
        leak_hz=within([one.leak_rate_hz for one in measured]),
        shot_hz=within([one.shot_noise_rate_hz for one in measured]),
        hot_share=within([one.hot_share for one in measured], 1.0),
        hot_hz=within([one.hot_hz for one in measured]),
        low_pass_us=within([1e6 / (2 * math.pi * one.cutoff_hz) if one.cutoff_hz else 0.0 for one in measured]),
        lag_us=within([one.lag_us for one in measured]),
        dark=within([one.dark for one in measured], 1.0),
    )

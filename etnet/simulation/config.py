"""What a simulated clip may look like: ranges to draw from. Every range is a field; nothing is drawn elsewhere."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Literal

Range = tuple[float, float]


def check_range(name: str, value: Range, low: float = 0.0, high: float = math.inf) -> None:
    """Raise ValueError unless `low` ≤ value[0] ≤ value[1] ≤ `high`."""
    if not low <= value[0] <= value[1] <= high:
        raise ValueError(f"{name} is {value}; wanted two ascending numbers in {low:g} … {high:g}")


def check_share(name: str, value: float) -> None:
    """Raise ValueError unless `value` is a share or a probability."""
    if not 0.0 <= value <= 1.0:
        raise ValueError(f"{name} is {value}; wanted a share in 0 … 1")


@dataclass(frozen=True, slots=True)
class SensorConfig:
    """The pixel's physics. A range of (0, 0) switches that imperfection off.

    Thresholds are in units of natural-log intensity and drawn log-uniformly. Weng et al. 2021 (§4) take .1 … 1.5 and
    C_p = C_n · N(1, .1): `threshold_core_share=0, balance="normal", balance_sigma=.1`. Recordings show a C_p / C_n of
    1.3, which that draw all but excludes, hence the wider log-normal default.
    """

    threshold: Range = (0.1, 1.5)
    threshold_core: Range = (0.2, 1.0)
    threshold_core_share: float = 0.85
    balance: Literal["log-normal", "normal"] = "log-normal"
    balance_sigma: float = 0.25
    balance_center: float = 1.0
    """What C_p / C_n is drawn around."""
    mismatch: Range = (0.0, 0.08)
    """Standard deviation of each pixel's thresholds around the sensor's, as a share of them."""
    refractory_us: Range = (100.0, 3_000.0)
    leak_hz: Range = (0.0, 0.3)
    """ON events a pixel gives each second with nothing before it."""
    shot_hz: Range = (0.0, 0.5)
    """Noise events a pixel gives each second at darkness, fewer in the light."""
    hot_share: Range = (0.0, 0.001)
    hot_hz: Range = (5.0, 100.0)
    low_pass_us: Range = (300.0, 6_000.0)
    """Time constant of the photoreceptor."""
    lag_us: Range = (0.0, 12_000.0)
    """How much later than the ordinary camera's stamps the events come."""
    dark: Range = (0.004, 0.04)
    """Dark current: the sensor sees log(intensity + dark), intensity 1 being white."""

    def __post_init__(self) -> None:
        for name in ("threshold", "threshold_core"):
            check_range(name, getattr(self, name), 0.01, 10.0)
        for name in ("refractory_us", "leak_hz", "shot_hz", "hot_hz", "low_pass_us", "lag_us"):
            check_range(name, getattr(self, name))
        check_range("mismatch", self.mismatch, 0.0, 0.3)
        check_range("hot_share", self.hot_share, 0.0, 1.0)
        check_range("dark", self.dark, 1e-4, 1.0)
        check_share("threshold_core_share", self.threshold_core_share)
        if not self.balance_center > 0:
            raise ValueError(f"balance_center is {self.balance_center}; wanted a number above 0")
        if self.balance_sigma < 0:
            raise ValueError(f"balance_sigma is {self.balance_sigma}; wanted 0 or more")


@dataclass(frozen=True, slots=True)
class SceneConfig:
    """What is before the camera and how it moves (Multi-Object-2D: Weng et al. 2021, §4).

    A scene's speed is not drawn but solved for: from `density`, by rehearsing a few pixels of its path.
    """

    num_objects: tuple[int, int] = (0, 8)
    object_size: Range = (0.12, 0.6)
    """Diameter of an object as a share of the shorter side."""
    cutout_share: float = 0.45
    """How many objects are cut-outs; the others are random shapes."""
    shaded_share: float = 0.25
    """How many random shapes are shaded smoothly instead of textured from a photo."""
    smooth_share: float = 0.2
    """How many clips consist of large smooth objects, whose insides can only be known from far away."""
    smooth_scale: float = 2.5
    """How much larger than `object_size` their objects are."""
    static_camera_share: float = 0.12
    """How many clips have a resting background; it needs an object that moves."""
    straight_share: float = 0.0
    """How many moving backgrounds run straight, without sway, turn or zoom (a slider, a vehicle), half of them along
    the rows: edges along their way give no events."""
    ride_share: float = 0.5
    """How many clips have objects that keep to the background but for parallax and a wobble: a moving camera."""
    resting_share: float = 0.15
    """How many objects rest on the sensor."""
    halting_share: float = 0.25
    """How many objects halt now and then while the others go on."""
    object_speed_sigma: float = 0.6
    """Spread (of the natural log) of an object's speed around the background's."""
    blur_px: Range = (0.5, 1.2)
    """Sharpness of the optics, Gaussian σ in pixels."""
    exposure: Range = (0.08, 0.45)
    """Mean intensity of a scene, drawn log-uniformly."""
    black_share: Range = (0.0, 0.15)
    """Share of the first picture that an ordinary camera's black level swallows."""
    density: float = 0.38
    """Median of the aim, events per pixel and window while the scene's clock runs."""
    density_sigma: float = 0.75
    max_speed_px: float = 12.0
    """Nothing is driven faster than this, pixels per mean window."""
    pause_start: float = 0.02
    """Probability that a running scene's clock stops at the end of a window."""
    pause_stay: float = 0.85
    long_pause_stay: float = 0.95
    """The same for `smooth_share` clips."""

    def __post_init__(self) -> None:
        low, high = self.num_objects
        if not 0 <= low <= high <= 64:
            raise ValueError(f"num_objects is {self.num_objects}; wanted two ascending counts in 0 … 64")
        check_range("object_size", self.object_size, 0.02, 4.0)
        check_range("blur_px", self.blur_px, 0.0, 20.0)
        check_range("exposure", self.exposure, 0.001, 1.0)
        check_range("black_share", self.black_share, 0.0, 0.9)
        for name in ("cutout_share", "shaded_share", "smooth_share", "static_camera_share", "straight_share"):
            check_share(name, getattr(self, name))
        for name in ("ride_share", "resting_share", "halting_share", "pause_start", "pause_stay", "long_pause_stay"):
            check_share(name, getattr(self, name))
        for name in ("density", "max_speed_px", "smooth_scale"):
            if not getattr(self, name) > 0:
                raise ValueError(f"{name} is {getattr(self, name)}; wanted a number above 0")


@dataclass(frozen=True, slots=True)
class SequenceConfig:
    """One clip: its size (h, w) in pixels, its windows, and what may be seen in it."""

    size: tuple[int, int] = (112, 112)
    num_windows: int = 40
    window_us: float = 40_000.0
    clip_jitter: Range = (0.3, 3.0)
    """A clip's windows are `window_us` times this, log-uniform."""
    window_jitter: Range = (0.3, 3.0)
    """In a jittered clip each window is that times this."""
    jittered_share: float = 0.3
    bins: int = 5
    max_step_px: float = 1.0
    """Nothing moves more than this between two renderings."""
    target_tone: Literal["linear", "srgb"] = "linear"
    """Tone of the ground truth; the sensor always sees linear light."""
    scene: SceneConfig = field(default_factory=SceneConfig)
    sensor: SensorConfig = field(default_factory=SensorConfig)

    def __post_init__(self) -> None:
        if min(self.size) < 8:
            raise ValueError(f"size is {self.size}; wanted (h, w) of at least 8 pixels")
        if self.num_windows < 1 or self.bins < 1:
            raise ValueError(f"num_windows {self.num_windows} and bins {self.bins}: each is at least 1")
        if self.window_us < 100 or not 0 < self.max_step_px <= 8:
            raise ValueError(
                f"window_us {self.window_us} is at least 100, max_step_px {self.max_step_px} above 0 and at most 8"
            )
        check_range("clip_jitter", self.clip_jitter, 0.01, 100.0)
        check_range("window_jitter", self.window_jitter, 0.01, 100.0)
        check_share("jittered_share", self.jittered_share)

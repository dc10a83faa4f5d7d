"""Where things stand in the scene. x runs right, y runs down, z away from the viewer, into the past."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Float32

from app.views.scene.state import Camera
from etnet.events.events import Sensor

TOWARDS: dict[Camera, tuple[float, float, float]] = {
    "orbit": (-0.95, -0.62, -1.0),
    "side": (-1.0, -0.16, -0.12),
    "booth": (0.85, -0.22, -1.0),
}
"""From the middle of the box to the camera."""
CLOSE = 0.76
"""The booth's camera stands nearer than one that sees every corner."""
LOWERED = 0.3
"""How far below the middle the booth's camera looks, scene units: from above, the box lies low in the picture."""
FOR_TICKS = 0.09
"""How far below the middle the usual camera looks, so that the lowest tick has room."""
Vector = Float[np.ndarray, " 3"]
"""A place or a direction in the scene."""
LONG_SIDE = 3.6
"""Scene units of the sensor's longer side, whatever its pixels: one camera suits all sensors."""
DEPTH = 3.6
"""Scene units of one window's time."""


@dataclass(frozen=True, slots=True)
class Space:
    """The sensor's place: its middle is the origin, the newest moment is z = 0."""

    sensor: Sensor

    @property
    def unit(self) -> float:
        """Scene units of one pixel."""
        return LONG_SIDE / max(self.sensor.width, self.sensor.height)

    @property
    def width(self) -> float:
        """Scene units."""
        return self.sensor.width * self.unit

    @property
    def height(self) -> float:
        """Scene units."""
        return self.sensor.height * self.unit

    def place(self, pixels_and_age: Float32[np.ndarray, "n 3"]) -> Float32[np.ndarray, "n 3"]:
        """(x, y, age) → scene; age 0 is the newest event, 1 the oldest. x = 0 is the sensor's left edge."""
        middle = np.array([self.sensor.width / 2, self.sensor.height / 2, 0.0], np.float32)
        return (pixels_and_age - middle) * np.array([self.unit, self.unit, DEPTH], np.float32)

    def pixel_hit(self, origin: Vector, direction: Vector, z: float = 0.0) -> tuple[int, int] | None:
        """The pixel where a ray meets the plane at `z`; `None` when it misses it."""
        if abs(direction[2]) < 1e-9:
            return None
        reach = (z - origin[2]) / direction[2]
        if not np.isfinite(reach) or reach <= 0:
            return None
        hit = origin + reach * direction
        x = int(np.floor(hit[0] / self.unit + self.sensor.width / 2))
        y = int(np.floor(hit[1] / self.unit + self.sensor.height / 2))
        return (x, y) if 0 <= x < self.sensor.width and 0 <= y < self.sensor.height else None


@dataclass(frozen=True, slots=True)
class CameraPlace:
    """Where a camera stands and what it looks at; `fov` in radians, near and far in scene units."""

    position: tuple[float, float, float]
    look_at: tuple[float, float, float]
    fov: float
    near: float
    far: float


def camera_place(space: Space, camera: Camera, aspect: float) -> CameraPlace:
    """A preset that shows all of the scene on a canvas of any `aspect` (width ÷ height)."""
    aspect = min(max(aspect, 0.1), 10.0)
    if camera == "front":
        # A long lens flattens: at 4° the plane is a picture, and a click on it is a click on a pixel.
        fov = 0.07
        half = float(np.tan(fov / 2))
        distance = 1.05 * max(space.height / 2 / half, space.width / 2 / (half * aspect))
        return CameraPlace((0.0, 0.0, -distance), (0.0, 0.0, 0.0), fov, distance * 0.5, distance * 1.5)
    towards = np.array(TOWARDS[camera])
    towards /= np.linalg.norm(towards)
    middle = np.array([0.0, {"booth": LOWERED, "orbit": FOR_TICKS}.get(camera, 0.0), DEPTH / 2])
    fov = 0.5
    distance = _distance_to_see(space, middle, towards, fov, aspect) * (CLOSE if camera == "booth" else 1.0)
    position = middle + towards * distance
    x, y, z = map(float, position)
    return CameraPlace((x, y, z), (0.0, float(middle[1]), DEPTH / 2), fov, 0.05, distance * 6)


def box_corners(space: Space) -> Float[np.ndarray, "8 3"]:
    """The corners of the window's box."""
    halves = (space.width / 2, space.height / 2)
    return np.array([[x, y, z] for x in (-halves[0], halves[0]) for y in (-halves[1], halves[1]) for z in (0.0, DEPTH)])


def _distance_to_see(space: Space, middle: Vector, towards: Vector, fov: float, aspect: float) -> float:
    """How far back along `towards` every corner of the box (and its ticks) lies inside the picture."""
    right = np.cross(towards, np.array([0.0, 1.0, 0.0]))
    right /= np.linalg.norm(right)
    up = np.cross(right, towards)
    half = float(np.tan(fov / 2))
    offsets = box_corners(space) - np.array([0.0, 0.0, middle[2]])
    across, along, nearer = np.abs(offsets @ right), np.abs(offsets @ up), offsets @ towards
    # A corner `nearer` to the camera by n needs n more distance: |across| ≤ (d − n) · half · aspect.
    needed = np.maximum(across / (half * aspect), along / half) + nearer
    return 1.16 * float(needed.max())

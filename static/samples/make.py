"""Make the bundled recordings: `python static/samples/make.py` (needs scikit-image 0.26, whose pictures it uses).

Each is a background and pictures that move before it, seen by the sensor model of `etnet.simulation`.
Every path is a closed loop, so a player that repeats shows no jump.
"""

from __future__ import annotations

import json
import sys
from dataclasses import asdict, dataclass
from importlib.util import find_spec
from pathlib import Path

import cv2
import numpy as np
from jaxtyping import Float32, UInt8

from etnet.events.events import Events
from etnet.simulation.camera import Clock, Trajectory
from etnet.simulation.pictures import linear_of
from etnet.simulation.scene import Plane, Scene
from etnet.simulation.sensor import SensorTraits
from etnet.simulation.sequence import record
from etnet.simulation.textures import blurred, resized
from etnet.simulation.write import Take, write_take

Image = Float32[np.ndarray, "h w"]

SIZE = (180, 240)
SECONDS, FRAMES_A_SECOND = 2.0, 25
READOUT_US = 500
"""Events are read out together this often, row by row, as sensors with a scanning readout do; it packs tightly."""
TONES = 56
"""Tones of a frame, spaced by the square root of light as in a companding camera: half the bytes, no visible bands."""
BLUR = 0.8
TRAITS = SensorTraits(
    threshold_on=0.48,
    threshold_off=0.41,
    mismatch=0.03,
    refractory_us=1_000.0,
    leak_hz=0.05,
    shot_hz=0.05,
    hot_share=0.0002,
    hot_hz=20.0,
    low_pass_us=1_000.0,
    dark=0.02,
)


@dataclass(frozen=True)
class Loop:
    """A closed path: where the plane's centre is (pixels), its angle (degrees) and log scale; and for each of these
    how far it swings, how many times in the recording (whole numbers close the loop), and where in the swing it begins
    (turns)."""

    rest: tuple[float, float, float, float]
    swing: tuple[float, float, float, float]
    times: tuple[int, int, int, int] = (1, 1, 1, 1)
    begin: tuple[float, float, float, float] = (0.0, 0.25, 0.0, 0.0)

    def trajectory(self) -> Trajectory:
        """As a path over seconds."""
        unit = np.array([1, 1, np.pi / 180, 1.0])
        turns = 2 * np.pi * np.array(self.times, np.float64) / SECONDS
        column = (self.swing * unit)[:, None], turns[:, None], 2 * np.pi * np.array(self.begin)[:, None]
        return Trajectory(self.rest * unit, np.zeros(4), *column)


def picture(name: str, height: float, mean: float) -> Image:
    """A picture of scikit-image's in linear light, `height` pixels high, with a mean light of `mean`."""
    package = find_spec("skimage")
    if package is None or package.origin is None:
        sys.exit(
            "make.py: the pictures are in the wheel of scikit-image, which is missing: pip install scikit-image==0.26.0"
        )
    path = next((Path(package.origin).parent / "data").glob(f"{name}.*"))
    grey = cv2.imread(str(path), cv2.IMREAD_GRAYSCALE)
    assert grey is not None, path
    light = resized(linear_of(grey), height / grey.shape[0])
    return np.minimum(light * np.float32(mean / light.mean()), 1.0)


def backdrop(name: str, height: float, mean: float, path: Loop) -> Plane:
    """A picture that fills the view."""
    return Plane(blurred(picture(name, height, mean), BLUR), None, path.trajectory())


def photo_print(name: str, height: float, mean: float, path: Loop, border: int = 4) -> Plane:
    """A picture with the white border of a paper print."""
    light = picture(name, height, mean)
    light = cv2.copyMakeBorder(light, *[border] * 4, borderType=cv2.BORDER_CONSTANT, value=0.85)
    return _cut_out(light, np.ones_like(light), path)


def disc(name: str, height: float, mean: float, centre: tuple[float, float], diameter: int, path: Loop) -> Plane:
    """A round piece of a picture around `centre` (shares of its width and height), with a white rim."""
    light = picture(name, height, mean)
    x, y = int(centre[0] * light.shape[1]), int(centre[1] * light.shape[0])
    radius = diameter // 2
    light = light[y - radius : y + radius, x - radius : x + radius].copy()
    v, u = np.mgrid[: 2 * radius, : 2 * radius] - (radius - 0.5)
    distance = np.hypot(u, v)
    light[distance > radius - 4] = 0.85
    return _cut_out(light, np.clip(radius - distance, 0, 1).astype(np.float32), path)


def _cut_out(light: Image, alpha: Image, path: Loop) -> Plane:
    margin = [4] * 4
    light = cv2.copyMakeBorder(light, *margin, borderType=cv2.BORDER_REPLICATE)
    alpha = cv2.copyMakeBorder(alpha, *margin, borderType=cv2.BORDER_CONSTANT, value=0)
    return Plane(blurred(light, BLUR), blurred(alpha, BLUR), path.trajectory())


def astronaut() -> Scene:
    """An astronaut behind whom the camera sways, and a print of a cat that passes in front."""
    return Scene(
        (
            backdrop("astronaut", 300, 0.26, Loop((119, 141, 0, 0), (15, 9, 2.0, 0.03), begin=(0, 0.25, 0.1, 0.4))),
            photo_print("chelsea", 62, 0.25, Loop((64, 136, -6, 0), (30, 12, 7, 0.05), begin=(0.05, 0.3, 0.2, 0.0))),
        ),
        SIZE,
    )


def prints() -> Scene:
    """Three photo prints swinging before a brick wall, the nearer the wider."""
    return Scene(
        (
            backdrop("brick", 260, 0.12, Loop((119, 89, 0, 0), (6, 3, 0.7, 0.01))),
            photo_print("rocket", 74, 0.2, Loop((176, 52, 5, 0), (16, 8, 5, 0.0), begin=(0, 0.3, 0.25, 0))),
            photo_print("coffee", 84, 0.25, Loop((74, 62, -5, 0), (21, 10, 7, 0.03), begin=(0.1, 0.4, 0.5, 0))),
            photo_print("chelsea", 82, 0.3, Loop((138, 126, 3, 0), (30, 13, 8, 0.06), begin=(0.2, 0.5, 0.7, 0.2))),
        ),
        SIZE,
    )


def rolling() -> Scene:
    """A round portrait that rolls to and fro before a cup of coffee while the camera zooms."""
    roll = Loop((120, 128, 0, 0), (54, 2, 54 / 34 * 180 / np.pi, 0.0), begin=(0, 0.25, 0, 0))
    return Scene(
        (
            backdrop("coffee", 215, 0.2, Loop((119, 89, 0, 0), (8, 5, 2, 0.07), begin=(0.5, 0.2, 0.1, 0.6))),
            disc("astronaut", 190, 0.3, (0.44, 0.24), 68, roll),
        ),
        SIZE,
    )


SAMPLES = {"astronaut": (astronaut, 1), "prints": (prints, 2), "rolling": (rolling, 3)}
"""Name → scene and seed."""


def read_out(events: Events) -> Events:
    """The events as a scanning readout gives them: stamps at its ends, ordered by row and column within one."""
    t = events.t // READOUT_US * READOUT_US
    order = np.lexsort((events.x, events.y, t))
    return Events(events.x[order], events.y[order], t[order], events.p[order], events.sensor)


def companded(light: Float32[np.ndarray, "n h w"]) -> UInt8[np.ndarray, "n h w"]:
    """Linear light as 8-bit frames of few tones."""
    root = np.rint(np.sqrt(np.clip(light, 0, 1)) * (TONES - 1)) / (TONES - 1)
    return np.rint(255 * root**2).astype(np.uint8)


def make(name: str, folder: Path) -> Path:
    """Simulate one sample and write it into `folder`."""
    build, seed = SAMPLES[name]
    num_windows = round(SECONDS * FRAMES_A_SECOND)
    edges = np.rint(np.arange(num_windows + 1) * 1e6 / FRAMES_A_SECOND).astype(np.int64)
    ends = np.array([-1e6, float(edges[-1])])
    recorded = record(build(), Clock(ends, ends * 1e-6), TRAITS, edges, np.random.default_rng(seed), 0.5)
    take = Take(read_out(recorded.events), edges, companded(recorded.light))
    attributes = {
        "source": "etnet.simulation, static/samples/make.py",
        "seed": seed,
        "sensor_model": json.dumps(asdict(TRAITS), sort_keys=True),
        "picture_licence": "public domain and CC0; see README.md beside this file",
    }
    path = folder / f"{name}.h5"
    write_take(path, take, attributes, gzip_level=9)
    return path


def main() -> None:
    """Make all of them, into the folder named or beside this file."""
    folder = Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).resolve().parent
    for name in SAMPLES:
        path = make(name, folder)
        print(f"{path}: {path.stat().st_size / 1e6:.2f} MB")


if __name__ == "__main__":
    main()

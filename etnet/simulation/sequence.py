"""One simulated clip: draw a scene, a clock and a sensor, let them run, and know everything about it.

Pure in (pictures, config, rng): the same seed gives the same events.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from jaxtyping import Bool, Float32, Float64, Int64

from etnet.events.events import Events, Sensor
from etnet.simulation import camera, textures
from etnet.simulation.camera import Clock
from etnet.simulation.config import SequenceConfig
from etnet.simulation.draw import log_uniform
from etnet.simulation.pictures import PicturePool, srgb_of
from etnet.simulation.scene import Plane, Renderer, Scene
from etnet.simulation.sensor import PixelArray, SensorTraits, draw_noise, draw_traits, events_of
from etnet.voxel import voxel_array

GRID_PER_WINDOW = 16
"""Moments a window at which motion is measured before rendering."""
MIN_RENDERS = 3
"""Renderings a window at least, so that the low-pass settles and leak is spread out where nothing moves."""
REHEARSAL_PX = 24
"""Length of path on which a scene shows how many events it gives; its first third only fills the pixels' memory."""


@dataclass(frozen=True, slots=True)
class Exposure:
    """The ordinary camera: frame = clip(light − black, 0, 1), in the tone asked for."""

    black: float
    tone: str

    def frame(self, light: Float32[np.ndarray, "*shape"]) -> Float32[np.ndarray, "*shape"]:
        """Values in 0 … 1."""
        linear = np.clip(light - np.float32(self.black), 0, 1)
        return srgb_of(linear) if self.tone == "srgb" else linear


@dataclass(frozen=True, slots=True)
class Drawn:
    """What was drawn for one clip. `aimed_density` is in events per pixel and running window, `speed_px` in pixels a
    mean window, `gain` what the pictures' light was multiplied by."""

    traits: SensorTraits
    num_objects: int
    is_smooth: bool
    is_camera_static: bool
    gain: float
    black: float
    mean_window_us: float
    aimed_density: float
    speed_px: float
    is_paused: tuple[bool, ...]
    num_renders: int


@dataclass(frozen=True, eq=False)
class Sequence:
    """`t` windows; frame i is taken at `window_edges[i + 1]`, `first_frame` at `window_edges[0]`, frames in 0 … 1.

    `flow[i]` (x, y in pixels, on the grid of frame i) is how far the point that each pixel shows has come since the
    frame before: frame_i(x, y) = frame_{i−1}(x − flow_x, y − flow_y), except where it was hidden or out of view.
    Window i holds the events with edges[i] ≤ t < edges[i + 1] (µs), `event_index[i]` … `event_index[i + 1]`.
    """

    voxels: Float32[np.ndarray, "t bins h w"]
    frames: Float32[np.ndarray, "t h w"]
    first_frame: Float32[np.ndarray, "h w"]
    flow: Float32[np.ndarray, "t 2 h w"]
    events: Events
    window_edges: Int64[np.ndarray, " t_plus_1"]
    event_index: Int64[np.ndarray, " t_plus_1"]
    drawn: Drawn


@dataclass(frozen=True, eq=False)
class Recorded:
    """What a sensor and a camera saw of a scene: events, light at each edge, flow from each edge to the next."""

    events: Events
    light: Float32[np.ndarray, "t_plus_1 h w"]
    flow: Float32[np.ndarray, "t 2 h w"]
    num_renders: int


def simulate_sequence(pictures: PicturePool, config: SequenceConfig, rng: np.random.Generator) -> Sequence:
    """A fresh clip."""
    traits = draw_traits(config.sensor, rng)
    edges = _draw_edges(config, rng)
    is_smooth = bool(rng.random() < config.scene.smooth_share)
    is_static = bool(rng.random() < config.scene.static_camera_share)
    scene, gain, black = _expose(draw_scene(pictures, config, is_smooth, is_static, rng), config, rng)
    pause_stay = config.scene.long_pause_stay if is_smooth else config.scene.pause_stay
    clock, is_paused = camera.draw_clock(rng, edges.astype(np.float64), _lead_us(traits), config.scene, pause_stay)
    aim = config.scene.density * float(np.exp(config.scene.density_sigma * rng.standard_normal()))
    speed = _limited(aim / max(rehearse(scene, traits, rng), 1e-6), scene, config)
    recorded = record(scene, clock.at_speed(speed), traits, edges, rng, config.max_step_px)
    exposure = Exposure(black, config.target_tone)
    index = np.searchsorted(recorded.events.t, edges).astype(np.int64)
    frames = exposure.frame(recorded.light)
    drawn = Drawn(
        traits=traits,
        num_objects=len(scene.planes) - 1,
        is_smooth=is_smooth,
        is_camera_static=is_static,
        gain=gain,
        black=black,
        mean_window_us=float(np.diff(edges).mean()),
        aimed_density=aim,
        speed_px=speed,
        is_paused=tuple(bool(paused) for paused in is_paused),
        num_renders=recorded.num_renders,
    )
    voxels = np.stack([voxel_array(recorded.events[a:b], config.bins) for a, b in pairwise(index)])
    return Sequence(voxels, frames[1:], frames[0], recorded.flow, recorded.events, edges, index, drawn)


def draw_scene(
    pictures: PicturePool, config: SequenceConfig, is_smooth: bool, is_static: bool, rng: np.random.Generator
) -> Scene:
    """A background and objects with their paths, in the pictures' own light."""
    blur = float(rng.uniform(*config.scene.blur_px))
    is_riding = not is_static and rng.random() < config.scene.ride_share
    height, width = config.size
    if is_smooth and rng.random() < 0.6:
        light = textures.draw_shading((2 * height, 2 * width), rng)
    else:
        light = textures.draw_photo(pictures, config.size, blur * (4 if is_smooth else 1), rng)
    # Without such a share nothing is drawn for it, and clips of before stay as they are.
    is_straight = config.scene.straight_share > 0 and bool(rng.random() < config.scene.straight_share)
    planes = [Plane(light, None, camera.draw_background(rng, config.size, is_static, is_straight))]
    num_objects = int(rng.integers(config.scene.num_objects[0], config.scene.num_objects[1] + 1))
    # Without texture or a moving background only outlines give events, so there must be some.
    num_objects = max(num_objects, min(config.scene.num_objects[1], 3 if is_smooth else int(is_static)))
    for i in range(num_objects):
        diameter = min(config.size) * log_uniform(rng, config.scene.object_size)
        diameter *= config.scene.smooth_scale if is_smooth else 1.0
        texture, alpha = textures.draw_object(pictures, config.scene, diameter, blur, is_smooth, rng)
        path = camera.draw_object(rng, config.size, config.scene, planes[0].path, is_riding)
        if is_static and i == 0 and path.speed == 0.0:
            path = replace(path, speed=1.0)
        planes.append(Plane(texture, alpha, path))
    return Scene(tuple(planes), config.size)


def rehearse(scene: Scene, traits: SensorTraits, rng: np.random.Generator) -> float:
    """Events per pixel that a scene gives a clean sensor for each unit of its path, from two stretches of it."""
    s = np.arange(REHEARSAL_PX, dtype=np.float64)
    clean = SensorTraits(traits.threshold_on, traits.threshold_off, dark=traits.dark)
    renderer = Renderer(scene, s)
    pixels = PixelArray(renderer.image(0), 0.0, clean, rng)
    counts = [len(pixels.expose(renderer.image(i), float(i)).pixel) for i in range(1, len(s))]
    counted = counts[REHEARSAL_PX // 3 :]
    return sum(counted) / len(counted) / (scene.size[0] * scene.size[1])


def record(
    scene: Scene,
    clock: Clock,
    traits: SensorTraits,
    edges: Int64[np.ndarray, " t_plus_1"],
    rng: np.random.Generator,
    max_step_px: float = 1.0,
) -> Recorded:
    """Let the scene run through `edges` (µs), rendering so finely that nothing moves more than `max_step_px`."""
    times, is_edge = _render_times(scene, clock, edges, _lead_us(traits), max_step_px)
    s = clock.at(times)
    renderer = Renderer(scene, s)
    image = renderer.image(0)
    pixels = PixelArray(image, float(times[0]), traits, rng)
    crossings, light, flow, last_edge = [], [], [], -1
    for i in range(len(times)):
        if i:
            if s[i] != s[i - 1]:
                image = renderer.image(i)
            crossings.append(pixels.expose(image, float(times[i])))
        if is_edge[i]:
            light.append(image)
            if last_edge >= 0:
                flow.append(renderer.flow(last_edge, i))
            last_edge = i
    crossings = [found._replace(t=found.t + traits.lag_us) for found in crossings]
    crossings.append(draw_noise(light[0], (float(edges[0]), float(edges[-1])), traits, rng))
    events = events_of(crossings, Sensor(scene.size[1], scene.size[0]))
    inside = slice(*np.searchsorted(events.t, edges[[0, -1]]))
    return Recorded(events[inside], np.stack(light), np.stack(flow), len(times))


def _limited(speed: float, scene: Scene, config: SequenceConfig) -> float:
    """At most the speed at which what moves most in view moves `max_speed_px` a window, over the whole path."""
    speed = min(speed, config.scene.max_speed_px)
    s = np.linspace(0, speed * config.num_windows, 4 * config.num_windows + 1)
    fastest = float(scene.largest_steps(s).sum()) / config.num_windows
    return speed * min(1.0, config.scene.max_speed_px / max(fastest, 1e-9))


def _lead_us(traits: SensorTraits) -> float:
    """How long before the first edge the pixels look on: the lag, and for the low-pass to settle."""
    return traits.lag_us + 3 * traits.low_pass_us + 1_000.0


def _draw_edges(config: SequenceConfig, rng: np.random.Generator) -> Int64[np.ndarray, " t_plus_1"]:
    lengths = np.full(config.num_windows, config.window_us * log_uniform(rng, config.clip_jitter))
    if rng.random() < config.jittered_share:
        jitter = log_uniform(rng, config.window_jitter, config.num_windows)
        lengths *= jitter / jitter.mean()
    return np.concatenate([[0], np.cumsum(np.maximum(np.rint(lengths), 10).astype(np.int64))])


def _expose(scene: Scene, config: SequenceConfig, rng: np.random.Generator) -> tuple[Scene, float, float]:
    """The scene under a random exposure, the gain, and the black level of the ordinary camera."""
    first = Renderer(scene, np.zeros(1)).image(0)
    aim = log_uniform(rng, config.scene.exposure)
    gain = aim / max(float(first.mean()), 1e-3)
    black = float(np.quantile(first * gain, rng.uniform(*config.scene.black_share)))
    planes = tuple(replace(plane, light=plane.light * np.float32(gain)) for plane in scene.planes)
    return Scene(planes, scene.size), gain, black


def _render_times(
    scene: Scene, clock: Clock, edges: Int64[np.ndarray, " t_plus_1"], lead_us: float, max_step_px: float
) -> tuple[Float64[np.ndarray, " n"], Bool[np.ndarray, " n"]]:
    """When to render: at each edge, and between two of them so often that no step is longer than allowed."""
    stops = np.concatenate([[edges[0] - lead_us], edges.astype(np.float64)])
    shares = np.arange(GRID_PER_WINDOW) / GRID_PER_WINDOW
    grid = np.append((stops[:-1, None] + np.diff(stops)[:, None] * shares).ravel(), stops[-1])
    steps = scene.largest_steps(clock.at(grid))
    # A thousandth of a step for time itself keeps the length of path strictly ascending where nothing moves.
    length = np.concatenate([[0.0], np.cumsum(steps + 1e-3 * max_step_px / GRID_PER_WINDOW)])
    at_stops = length[::GRID_PER_WINDOW]
    counts = np.maximum(np.ceil(np.diff(at_stops) / max_step_px).astype(int), MIN_RENDERS)
    pieces = [
        np.interp(np.linspace(at_stops[i], at_stops[i + 1], count, endpoint=False), length, grid)
        for i, count in enumerate(counts)
    ]
    is_edge = np.zeros(int(counts.sum()) + 1, bool)
    is_edge[np.cumsum(counts)] = True
    return np.append(np.concatenate(pieces), stops[-1]), is_edge

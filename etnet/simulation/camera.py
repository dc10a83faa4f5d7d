"""How everything moves: smooth paths over distance, and a clock that says how far the scene has come."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool, Float64

from etnet.simulation.config import SceneConfig
from etnet.simulation.draw import log_uniform

Affine = Float64[np.ndarray, "n 2 3"]

CHANNELS = 4
"""Of a pose: x and y of a plane's centre (image pixels), its angle (radians), the natural log of its scale."""


@dataclass(frozen=True, eq=False)
class Trajectory:
    """A plane's smooth path: rest + drift · s + Σ amplitude · sin(frequency · s + phase), for each channel.

    `s` is the distance, in pixels, that a moving background typically travels; so the same path can be run at any
    speed, and a stopped clock stops everything. `speed` stretches this plane's own distance, `halts` are the
    (s, own s) knots of one that halts now and then. A plane with a `carrier` shares the carrier's shift × `parallax`.
    """

    rest: Float64[np.ndarray, " 4"]
    drift: Float64[np.ndarray, " 4"]
    amplitude: Float64[np.ndarray, "4 k"]
    frequency: Float64[np.ndarray, "4 k"]
    phase: Float64[np.ndarray, "4 k"]
    speed: float = 1.0
    halts: Float64[np.ndarray, "2 m"] | None = None
    carrier: Trajectory | None = None
    parallax: float = 1.0

    def poses(self, s: Float64[np.ndarray, " n"]) -> Float64[np.ndarray, "n 4"]:
        """(x, y, angle, log scale) at each distance."""
        own = s if self.halts is None else np.interp(s, self.halts[0], self.halts[1])
        own = own * self.speed
        waves = np.sin(own[:, None, None] * self.frequency + self.phase) * self.amplitude
        poses = self.rest + own[:, None] * self.drift + waves.sum(-1)
        if self.carrier is not None:
            carried = self.carrier.poses(np.concatenate([[0.0], s]))
            poses[:, :2] += self.parallax * (carried[1:, :2] - carried[0, :2])
        return poses

    def matrices(self, s: Float64[np.ndarray, " n"], texture_size: tuple[int, int]) -> Affine:
        """Affine maps from texture (x, y) to image (x, y) at each distance; `texture_size` is (h, w)."""
        x, y, angle, log_scale = self.poses(s).T
        cos, sin = np.exp(log_scale) * np.cos(angle), np.exp(log_scale) * np.sin(angle)
        u, v = (texture_size[1] - 1) / 2, (texture_size[0] - 1) / 2
        rows = [[cos, -sin, x - cos * u + sin * v], [sin, cos, y - sin * u - cos * v]]
        return np.stack([np.stack(row, -1) for row in rows], -2)


def invert(matrices: Affine) -> Affine:
    """The inverse of each affine map."""
    a, b, c = matrices[:, 0].T
    d, e, f = matrices[:, 1].T
    scale = 1 / (a * e - b * d)
    rows = [[e, -b, b * f - e * c], [-d, a, d * c - a * f]]
    return np.stack([np.stack(row, -1) for row in rows], -2) * scale[:, None, None]


def compose(outer: Affine, inner: Affine) -> Affine:
    """Maps that apply `inner` first, then `outer`."""
    result = outer[:, :, :2] @ inner
    result[:, :, 2] += outer[:, :, 2]
    return result


@dataclass(frozen=True, eq=False)
class Clock:
    """Where the scene stands on its paths at a time: knots of time (µs) and distance s (px), straight between."""

    t: Float64[np.ndarray, " k"]
    s: Float64[np.ndarray, " k"]

    def at(self, t: Float64[np.ndarray, " n"]) -> Float64[np.ndarray, " n"]:
        """Distance at each time."""
        return np.interp(t, self.t, self.s)

    def at_speed(self, factor: float) -> Clock:
        """The same clock, `factor` times as fast."""
        return replace(self, s=self.s * factor)


def draw_background(
    rng: np.random.Generator, size: tuple[int, int], is_static: bool, is_straight: bool = False
) -> Trajectory:
    """A background's path: drift, sway, turning and zooming, or drift alone; about one pixel a unit of distance."""
    height, width = size
    side = min(size)
    rest = np.array([(width - 1) / 2, (height - 1) / 2, rng.uniform(-0.3, 0.3), 0.0])
    amplitude, frequency, phase = np.zeros((4, 2)), np.zeros((4, 2)), rng.uniform(0, 2 * np.pi, (4, 2))
    drift = np.zeros(CHANNELS)
    if not is_static and is_straight:
        heading = rng.uniform(0, 2 * np.pi) if rng.random() < 0.5 else 0.0
        drift[:2] = np.cos(heading), np.sin(heading)
    elif not is_static:
        heading, sway = rng.uniform(0, 2 * np.pi), rng.uniform(0.0, 1.2)
        drift[:2] = rng.uniform(0.3, 1.0) * np.array([np.cos(heading), np.sin(heading)])
        for channel in range(2):
            wavelength = log_uniform(rng, (0.4 * side, 4 * side), 2)
            frequency[channel] = 2 * np.pi / wavelength
            amplitude[channel] = sway * rng.uniform(0, 1, 2) / frequency[channel]
        frequency[2:] = 2 * np.pi / log_uniform(rng, (0.6 * side, 6 * side), (2, 2))
        # A turn or a zoom of 2/side per pixel of distance moves the middle of an edge by one pixel.
        amplitude[2] = rng.uniform(0, 1) ** 2 * rng.uniform(0, 2, 2) / side / frequency[2]
        amplitude[3] = np.minimum(rng.uniform(0, 1) ** 2 * rng.uniform(0, 2, 2) / side / frequency[3], 0.15)
        drift[2] = rng.normal(0, 0.3) / side
    return Trajectory(rest, drift, amplitude, frequency, phase)


def draw_object(
    rng: np.random.Generator, size: tuple[int, int], config: SceneConfig, background: Trajectory, is_riding: bool
) -> Trajectory:
    """An object's path: it wanders about the view by itself, or rides with the background under parallax."""
    height, width = size
    side = min(size)
    spread = 0.9 if is_riding else 0.45
    rest = np.array(
        [
            (width - 1) / 2 + rng.uniform(-spread, spread) * width,
            (height - 1) / 2 + rng.uniform(-spread, spread) * height,
            rng.uniform(-np.pi, np.pi) if rng.random() < 0.5 else rng.uniform(-0.4, 0.4),
            rng.uniform(-0.15, 0.15),
        ]
    )
    amplitude, frequency, phase = np.zeros((4, 2)), np.ones((4, 2)), rng.uniform(0, 2 * np.pi, (4, 2))
    wobble = 0.15 if is_riding else 1.0
    for channel in range(2):
        reach = wobble * side * np.array([rng.uniform(0.15, 0.6), rng.uniform(0.02, 0.15)])
        amplitude[channel] = reach
        frequency[channel] = wobble * rng.uniform(0.3, 1.0, 2) / reach
    frequency[2:] = 2 * np.pi / log_uniform(rng, (0.5 * side, 5 * side), (2, 2))
    amplitude[2] = wobble * rng.uniform(0, 1) ** 2 * rng.uniform(0, 3, 2) / side / frequency[2]
    amplitude[3] = np.minimum(wobble * rng.uniform(0, 2, 2) / side / frequency[3], 0.15)
    drift = np.array([0.0, 0.0, wobble * rng.normal(0, 0.8) / side, 0.0])
    speed = float(np.exp(rng.normal(0, config.object_speed_sigma)))
    if rng.random() < config.resting_share:
        speed = 0.0
    halts = _draw_halts(rng, side) if rng.random() < config.halting_share else None
    carrier = background if is_riding else None
    return Trajectory(
        rest,
        drift,
        amplitude,
        frequency,
        phase,
        speed,
        halts,
        carrier,
        log_uniform(rng, (1.0, 2.0)) if is_riding else 1.0,
    )


def _draw_halts(rng: np.random.Generator, side: int) -> Float64[np.ndarray, "2 m"]:
    """Stretches of going and halting by turns, in distance, over more of it than any clip runs."""
    stretches = log_uniform(rng, (0.05 * side, 0.8 * side), 200)
    going = np.arange(200) % 2 == int(rng.integers(2))
    # Before distance 0, where a clip's lead lies, it goes.
    s, own = np.cumsum(stretches), np.cumsum(stretches * going)
    return np.stack([np.concatenate([[-1e4, 0.0], s]), np.concatenate([[-1e4, 0.0], own])])


def draw_clock(
    rng: np.random.Generator, edges: Float64[np.ndarray, " k"], lead_us: float, config: SceneConfig, pause_stay: float
) -> tuple[Clock, Bool[np.ndarray, " k_minus_1"]]:
    """A clock of mean speed 1 a mean window while it runs, and which windows are paused: in those it stands still.

    It stands at 0 at the first edge and begins `lead_us` before it. The first window is never paused.
    """
    num_windows, knots = len(edges) - 1, 8
    is_paused = np.zeros(num_windows, bool)
    for i in range(1, num_windows):
        is_paused[i] = rng.random() < (pause_stay if is_paused[i - 1] else config.pause_start)
    shares = np.arange(knots) / knots
    t = np.append((edges[:-1, None] + np.diff(edges)[:, None] * shares).ravel(), edges[-1])
    phase = (t[:-1] - edges[0]) / (edges[-1] - edges[0])
    swing, turns, start = rng.uniform(0, 1), log_uniform(rng, (0.5, 6.0)), rng.uniform(0, 2 * np.pi)
    speed = np.exp(swing * np.sin(2 * np.pi * turns * phase + start))
    speed *= num_windows / (speed * np.diff(t)).sum()
    steps = np.diff(t) * speed * ~np.repeat(is_paused, knots)
    s = np.concatenate([[-lead_us * speed[0], 0.0], np.cumsum(steps)])
    return Clock(np.concatenate([[edges[0] - lead_us], t]), s), is_paused


def largest_steps(
    matrices: Sequence[Affine], texture_sizes: Sequence[tuple[int, int]], size: tuple[int, int]
) -> Float64[np.ndarray, " n_minus_1"]:
    """Pixels by which anything in view moves from each set of maps to the next; the first plane is the background."""
    height, width = size
    corners = np.array([[0, 0, 1], [width - 1, 0, 1], [0, height - 1, 1], [width - 1, height - 1, 1]], np.float64).T
    background = matrices[0]
    moved = compose(background[1:], invert(background[:-1])) @ corners
    largest = np.hypot(*np.moveaxis(moved - corners[:2], 1, 0)).max(-1)
    for maps, (texture_height, texture_width) in zip(matrices[1:], texture_sizes[1:], strict=True):
        u, v = texture_width - 1, texture_height - 1
        points = maps @ np.array([[0, 0, 1], [u, 0, 1], [0, v, 1], [u, v, 1]], np.float64).T
        moves = np.hypot(*np.moveaxis(np.diff(points, axis=0), 1, 0)).max(-1)
        low, high = points.min(-1), points.max(-1)
        is_seen = (high > -1).all(-1) & (low < [width, height]).all(-1)
        largest = np.maximum(largest, moves * (is_seen[1:] | is_seen[:-1]))
    return largest

"""A second generator of validation clips: it renders, moves and senses with none of the code that training draws from.

One held-out picture moves over the sensor; pixels are perfect and compare log intensity with a threshold at every
rendering. What the two generators agree on was learned; what only ours shows was learned of our simulator.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import cv2
import numpy as np
import torch
from jaxtyping import Float32, UInt8
from torch import Tensor

from etnet.evaluation.lpips import LPIPS
from etnet.evaluation.metrics import best_affine
from etnet.events.events import Events, Sensor
from etnet.nets.base import State
from etnet.nets.etnet import ETNet
from etnet.training.config import TrainConfig
from etnet.training.data import draw_pictures
from etnet.training.films import Film
from etnet.voxel import voxel_array

SIZE = (128, 128)
RENDERS_A_WINDOW = 16
WINDOW_US = 20_000
THRESHOLDS = (0.02, 1.5)
"""Contrast thresholds between which the one that gives the wanted density is looked for."""
DARK = 0.02
GAMMA = 2.2
SEARCH_STEPS = 10


def other_films(config: TrainConfig) -> list[Film]:
    """A clip in linear light and a gamma-coded one for each of `validation.other_densities`, the same every time."""
    validation = config.validation
    if not validation.other_densities:
        return []
    pool = draw_pictures(config.data, "held-out", validation.seed)
    films = []
    for index, density in enumerate(validation.other_densities):
        for tone in ("linear", "gamma"):
            rng = np.random.default_rng([validation.seed, 11, index])  # the same picture and way in both tones
            film = other_film(pool.draw_photo(rng), density, tone == "gamma", validation.windows, rng)
            films.append(Film(f"{tone} {density:g}", *film))
    return films


def other_film(
    picture: UInt8[np.ndarray, "_ _"],
    density: float,
    is_gamma: bool,
    windows: int,
    rng: np.random.Generator,
    bins: int = 5,
) -> tuple[Tensor, Tensor]:
    """Voxel grids and frames (0 … 1) of one clip with about `density` events per pixel and window."""
    coded = _renders(picture, windows * RENDERS_A_WINDOW + 1, density, rng)
    light = coded if is_gamma else coded**GAMMA
    log = np.log(light + DARK)
    low, high = THRESHOLDS
    for _ in range(SEARCH_STEPS):
        middle = float(np.sqrt(low * high))
        is_denser = np.abs(_crossings(log, middle)).sum() / (windows * log[0].size) > density
        low, high = (middle, high) if is_denser else (low, middle)
    events = _events_of(_crossings(log, float(np.sqrt(low * high))))
    edges = np.searchsorted(events.t, np.arange(windows + 1) * WINDOW_US)
    voxels = np.stack([voxel_array(events[start:stop], bins) for start, stop in pairwise(edges)])
    return torch.from_numpy(voxels), torch.from_numpy(light[RENDERS_A_WINDOW::RENDERS_A_WINDOW]).unsqueeze(1)


@torch.no_grad()
def affine_by_film(model: ETNet, films: Sequence[Film], score_every: int, lpips: LPIPS) -> dict[str, float]:
    """LPIPS of each film after the best gain and offset of each frame, so that tone does not count."""
    was_training = model.training
    model.eval()
    found = {}
    for film in films:
        state: State | None = None
        distances = []
        for index, (voxel, target) in enumerate(zip(film.voxels, film.frames, strict=True)):
            pyramid, state = model.encode(voxel.unsqueeze(0), state)
            if (len(film.voxels) - 1 - index) % score_every == 0:
                fitted = best_affine(model.decode(pyramid)[0].float(), target.unsqueeze(0)).clamp(0, 1)
                distances.append(float(lpips(fitted, target.unsqueeze(0))))
        found[film.name] = float(np.mean(distances))
    model.train(was_training)
    return found


def _renders(picture: np.ndarray, count: int, density: float, rng: np.random.Generator) -> Float32[np.ndarray, "t h w"]:
    """The picture on its way: shifted, turned and scaled by slow sines, faster for denser clips."""
    height, width = SIZE
    scale = 1.15 * max(height / picture.shape[0], width / picture.shape[1])
    speed = min(6.0, 2.0 * density**0.5) / RENDERS_A_WINDOW
    heading, phases = rng.uniform(0, 2 * np.pi), rng.uniform(0, 2 * np.pi, 4)
    reach = 0.06 * min(SIZE)
    centre = np.array(picture.shape[::-1]) / 2
    frames = np.empty((count, height, width), np.float32)
    for i in range(count):
        way = speed * i / reach
        shift = reach * np.array([np.sin(way + phases[0]), np.sin(0.7 * way + phases[1])])
        angle = np.degrees(heading + 0.08 * np.sin(0.5 * way + phases[2]))
        zoom = scale * 1.25 * (1 + 0.05 * np.sin(0.6 * way + phases[3]))
        matrix = cv2.getRotationMatrix2D((float(centre[0]), float(centre[1])), float(angle), float(zoom))
        matrix[:, 2] += np.array([width, height]) / 2 - centre + shift
        moved = cv2.warpAffine(
            picture, matrix, (width, height), flags=cv2.INTER_AREA, borderMode=cv2.BORDER_REFLECT_101
        )
        frames[i] = moved.astype(np.float32) / 255
    return frames


def _crossings(log: Float32[np.ndarray, "t h w"], threshold: float) -> np.ndarray:
    """Signed events of every pixel between one rendering and the next."""
    reference = log[0].copy()
    counts = np.empty((len(log) - 1, *log.shape[1:]), np.int16)
    for i, now in enumerate(log[1:]):
        counts[i] = np.trunc((now - reference) / threshold)
        reference += threshold * counts[i]
    return counts


def _events_of(counts: np.ndarray) -> Events:
    """Events spread evenly between the renderings that they lie between, in the order of time."""
    render, y, x = np.nonzero(counts)
    number = np.abs(counts[render, y, x]).astype(np.int64)
    which = np.repeat(np.arange(len(number)), number)
    order_in_pixel = np.arange(len(which)) - np.repeat(np.cumsum(number) - number, number)
    step = WINDOW_US / RENDERS_A_WINDOW
    t = ((render[which] + (order_in_pixel + 0.5) / number[which]) * step).astype(np.int64)
    order = np.argsort(t, kind="stable")
    picked = which[order]
    p = np.sign(counts[render, y, x])[picked].astype(np.int8)
    sensor = Sensor(width=counts.shape[2], height=counts.shape[1])
    return Events(x[picked].astype(np.uint16), y[picked].astype(np.uint16), t[order], p, sensor)

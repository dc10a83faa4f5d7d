"""The pictures on a scene's planes: crops of photos, cut-outs, random shapes, smooth shading. All in linear light."""

from __future__ import annotations

import cv2
import numpy as np
from jaxtyping import Float32

from etnet.simulation.config import SceneConfig
from etnet.simulation.draw import log_uniform
from etnet.simulation.pictures import PicturePool, linear_of

Image = Float32[np.ndarray, "h w"]

SUBPIXEL_BITS = 4
"""Shapes are drawn with corners to 1/16 px."""


def draw_photo(pool: PicturePool, size: tuple[int, int], blur: float, rng: np.random.Generator) -> Image:
    """A photo at a random scale at which a view of `size` (h, w) shows all or some of it, a texel a pixel."""
    photo = linear_of(pool.draw_photo(rng))
    whole = max(size[0] / photo.shape[0], size[1] / photo.shape[1])
    scale = log_uniform(rng, (min(1.05 * whole, 1.3), max(1.05 * whole, 1.1)))
    return blurred(resized(photo, scale), blur)


def draw_shading(size: tuple[int, int], rng: np.random.Generator) -> Image:
    """Smooth light and shade without texture: a few random tones, spread wide."""
    knots = rng.integers(2, 5, 2)
    tones = np.exp(rng.normal(0, rng.uniform(0.1, 0.6), (int(knots[0]), int(knots[1])))) * np.exp(rng.normal(-1.6, 0.7))
    spread = cv2.resize(tones.astype(np.float32), (size[1], size[0]), interpolation=cv2.INTER_CUBIC)
    return np.clip(spread, 0.002, 1.0)


def draw_object(
    pool: PicturePool, config: SceneConfig, diameter: float, blur: float, is_smooth: bool, rng: np.random.Generator
) -> tuple[Image, Image]:
    """An object's light and alpha, about `diameter` pixels across, and brighter or darker than it was found."""
    cutout = None if is_smooth or rng.random() >= config.cutout_share else pool.draw_cutout(rng)
    if cutout is not None:
        scale = diameter / max(cutout.picture.shape)
        light, alpha = resized(linear_of(cutout.picture), scale), resized(cutout.alpha.astype(np.float32) / 255, scale)
    else:
        side = max(6, round(diameter))
        alpha = draw_shape(side, rng)
        is_shaded = is_smooth or rng.random() < config.shaded_share
        light = draw_shading((side, side), rng) if is_shaded else _patch_of_photo(pool, side, rng)
    # A border of empty texels keeps the outline whole under blur and warp.
    margin = 2 + int(np.ceil(2 * blur))
    light = cv2.copyMakeBorder(light, *[margin] * 4, borderType=cv2.BORDER_REPLICATE)
    alpha = cv2.copyMakeBorder(alpha, *[margin] * 4, borderType=cv2.BORDER_CONSTANT, value=0)
    factor = np.float32(np.exp(rng.normal(0, 0.5)))
    return blurred(np.minimum(light * factor, 1.0), blur), blurred(alpha, blur)


def draw_shape(side: int, rng: np.random.Generator) -> Image:
    """The alpha of a random outline: a polygon, a rounded blob or a star of waves."""
    kind = rng.integers(3)
    if kind == 0:
        angle = np.sort(rng.uniform(0, 2 * np.pi, int(rng.integers(3, 8))))
        radius = rng.uniform(0.6, 1.0, len(angle))
    else:
        angle = np.linspace(0, 2 * np.pi, 96, endpoint=False)
        order = np.arange(1, 7)[:, None]
        waves = rng.normal(0, 0.25 if kind == 1 else 0.12, (6, 1)) / (order if kind == 1 else 1)
        radius = np.exp((waves * np.cos(order * angle + rng.uniform(0, 2 * np.pi, (6, 1)))).sum(0))
        radius /= radius.max()
    stretch = np.array([1.0, rng.uniform(0.4, 1.0)])
    points = (side - 1) / 2 * (1 + np.stack([np.cos(angle), np.sin(angle)], -1) * radius[:, None] * stretch)
    mask = np.zeros((side, side), np.uint8)
    fixed = np.rint(points * (1 << SUBPIXEL_BITS)).astype(np.int32)
    cv2.fillPoly(mask, [fixed], 255, lineType=cv2.LINE_AA, shift=SUBPIXEL_BITS)
    return mask.astype(np.float32) / 255


def resized(image: Image, scale: float) -> Float32[np.ndarray, "new_h new_w"]:
    """The image at `scale`, averaged where it shrinks; never below 4 pixels a side."""
    size = (max(4, round(image.shape[1] * scale)), max(4, round(image.shape[0] * scale)))
    return cv2.resize(image, size, interpolation=cv2.INTER_AREA if scale < 1 else cv2.INTER_LINEAR)


def blurred(image: Image, sigma: float) -> Image:
    """Gaussian blur of `sigma` pixels; nothing at 0."""
    return cv2.GaussianBlur(image, (0, 0), sigma) if sigma > 0 else image


def _patch_of_photo(pool: PicturePool, side: int, rng: np.random.Generator) -> Image:
    photo = linear_of(pool.draw_photo(rng))
    smallest = 1.02 * side / min(photo.shape)
    photo = resized(photo, max(smallest, log_uniform(rng, (0.25, 1.1))))
    y, x = (int(rng.integers(0, max(1, length - side + 1))) for length in photo.shape)
    return np.ascontiguousarray(photo[y : y + side, x : x + side])

"""Planes before a camera: their pictures, their rendering, and the exact flow between two moments."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from jaxtyping import Float32, Float64

from etnet.simulation.camera import Affine, Trajectory, compose, invert, largest_steps

Image = Float32[np.ndarray, "h w"]


@dataclass(frozen=True, eq=False)
class Plane:
    """A picture in linear light on a path. `alpha` None is a background without end (mirrored at its borders)."""

    light: Image
    alpha: Image | None
    path: Trajectory

    @property
    def texture_size(self) -> tuple[int, int]:
        """(h, w) of the picture."""
        return self.light.shape[0], self.light.shape[1]


@dataclass(frozen=True, eq=False)
class Scene:
    """A background and objects, the last one nearest; `size` is the image's (h, w)."""

    planes: tuple[Plane, ...]
    size: tuple[int, int]

    def __post_init__(self) -> None:
        if not self.planes or self.planes[0].alpha is not None or any(p.alpha is None for p in self.planes[1:]):
            raise ValueError("a scene is one background (no alpha) and then objects (with alpha)")

    def matrices(self, s: Float64[np.ndarray, " n"]) -> list[Affine]:
        """Each plane's maps from its texture to the image, at each distance."""
        return [plane.path.matrices(s, plane.texture_size) for plane in self.planes]

    def largest_steps(self, s: Float64[np.ndarray, " n"]) -> Float64[np.ndarray, " n_minus_1"]:
        """Pixels by which anything in view moves from each distance to the next."""
        return largest_steps(self.matrices(s), [plane.texture_size for plane in self.planes], self.size)


class Renderer:
    """Renders a scene at distances that are known beforehand. Holds premultiplied textures and their maps."""

    def __init__(self, scene: Scene, s: Float64[np.ndarray, " n"]) -> None:
        self._scene = scene
        self._matrices = scene.matrices(s)
        self._inverse = [invert(maps) for maps in self._matrices]
        self._textures = [
            plane.light if plane.alpha is None else cv2.merge([plane.light * plane.alpha, plane.alpha])
            for plane in scene.planes
        ]
        height, width = scene.size
        self._boxes = [np.tile([0, 0, width, height], (len(s), 1))]
        self._boxes += [
            _boxes(maps, plane.texture_size, scene.size)
            for maps, plane in zip(self._matrices[1:], scene.planes[1:], strict=True)
        ]

    def image(self, i: int) -> Image:
        """Linear light at the i-th distance."""
        height, width = self._scene.size
        image = cv2.warpAffine(
            self._textures[0],
            self._inverse[0][i],
            (width, height),
            flags=cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP,
            borderMode=cv2.BORDER_REFLECT_101,
        )
        for plane in range(1, len(self._textures)):
            box = self._boxes[plane][i]
            if box[2] > box[0] and box[3] > box[1]:
                patch = self._patch(plane, i)
                part = image[box[1] : box[3], box[0] : box[2]]
                part *= 1 - patch[:, :, 1]
                part += patch[:, :, 0]
        return image

    def flow(self, i: int, j: int) -> Float32[np.ndarray, "2 h w"]:
        """For each pixel at distance j: how far (x, y) the point seen there has come since distance i.

        So image_j(x, y) = image_i(x − flow_x, y − flow_y), except where the point was hidden or out of view.
        Where several planes show, the nearest one that covers at least half of the pixel counts.
        """
        height, width = self._scene.size
        flow = np.empty((2, height, width), np.float32)
        for plane, box in enumerate(self._boxes):
            x0, y0, x1, y1 = box[j]
            if x1 <= x0 or y1 <= y0:
                continue
            back = compose(self._matrices[plane][i : i + 1], self._inverse[plane][j : j + 1])[0]
            x, y = np.arange(x0, x1, dtype=np.float32), np.arange(y0, y1, dtype=np.float32)[:, None]
            moved = np.stack(
                [x - (back[0, 0] * x + back[0, 1] * y + back[0, 2]), y - (back[1, 0] * x + back[1, 1] * y + back[1, 2])]
            )
            part = flow[:, y0:y1, x0:x1]
            if plane == 0:
                part[:] = moved
            else:
                np.copyto(part, moved.astype(np.float32), where=self._patch(plane, j)[:, :, 1] >= 0.5)
        return flow

    def _patch(self, plane: int, i: int) -> Float32[np.ndarray, "h w 2"]:
        """Premultiplied light and alpha of an object, over its box only."""
        x0, y0, x1, y1 = self._boxes[plane][i]
        inverse = self._inverse[plane][i].copy()
        inverse[:, 2] += inverse[:, :2] @ (x0, y0)
        return cv2.warpAffine(
            self._textures[plane],
            inverse,
            (int(x1 - x0), int(y1 - y0)),
            flags=cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP,
            borderMode=cv2.BORDER_CONSTANT,
        )


def _boxes(maps: Affine, texture_size: tuple[int, int], size: tuple[int, int]) -> np.ndarray:
    """The part of the image (x0, y0, x1, y1; half open) that an object can touch, at each distance."""
    u, v = texture_size[1], texture_size[0]
    points = maps @ np.array([[-1, -1, 1], [u, -1, 1], [-1, v, 1], [u, v, 1]], np.float64).T
    limits = np.array([size[1], size[0]])
    low = np.clip(np.floor(points.min(-1)), 0, limits)
    high = np.clip(np.ceil(points.max(-1)) + 1, 0, limits)
    return np.concatenate([low, high], 1).astype(np.int64)

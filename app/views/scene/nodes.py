"""What stands in the scene beside the events: the picture at the newest moment, maps behind it, links before it.

A click on the picture is a click on a pixel of the sensor.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np
import viser
from jaxtyping import Float32, UInt8

from app.html.attention.links import LINK_COLOURS
from app.state import intents as ask
from app.views.scene.space import DEPTH, Space

if TYPE_CHECKING:
    from etnet.inspection.links import Link


GROUND = (22, 25, 30)
FIRST_STAYS = 1.2
"""Seconds in which a slow browser has decoded a picture."""


def add_plane(
    scene: viser.SceneApi, name: str, space: Space, picture: UInt8[np.ndarray, "h w 3"], z: float = 0.0
) -> viser.ImageHandle:
    """A picture as large as the sensor, `z` scene units behind the newest moment."""
    return scene.add_image(
        name,
        picture,
        space.width,
        space.height,
        format="jpeg",
        jpeg_quality=88,
        position=(0.0, 0.0, z),
        cast_shadow=False,
        receive_shadow=False,
    )


class FramePlane:
    """One textured plane at z = 0."""

    def __init__(self, scene: viser.SceneApi, dispatch: Callable[[ask.Intent], None]) -> None:
        self._scene = scene
        self._dispatch = dispatch
        self._space: Space | None = None
        self._image: viser.ImageHandle | None = None
        self._shown: object = None
        self._built_at = 0.0

    def show(
        self, space: Space, key: object, image: UInt8[np.ndarray, "h w 3"] | None, is_moving: bool = False
    ) -> None:
        """Put a picture on the plane; the same `key` is the same picture. `None` leaves the plane empty.

        `is_moving`: it is soon replaced. A new plane is white until its first picture is decoded, and a picture that is
        replaced before that never is: so the first one is left alone for a moment.
        """
        if space == self._space and key == self._shown:
            return
        if is_moving and space == self._space and time.monotonic() - self._built_at < FIRST_STAYS:
            return
        picture = np.full((9, 12, 3), GROUND, np.uint8) if image is None else image
        if space != self._space or self._image is None:
            self._build(space, picture)
        else:
            self._image.image = picture
        self._shown = key

    def _build(self, space: Space, picture: UInt8[np.ndarray, "h w 3"]) -> None:
        self._space, self._built_at = space, time.monotonic()
        self._image = add_plane(self._scene, "/plane", space, picture)

        @self._image.on_click
        async def _(event: viser.SceneNodePointerEvent[viser.ImageHandle]) -> None:
            if event.client is None or event.ray_origin is None or event.ray_direction is None:
                return
            pixel = space.pixel_hit(np.array(event.ray_origin), np.array(event.ray_direction))
            if pixel is not None:
                self._dispatch(ask.Query(*pixel))


Picture = UInt8[np.ndarray, "h w 3"]


class MapPlanes:
    """Made when they are first asked for; taken out of sight after that."""

    def __init__(self, scene: viser.SceneApi) -> None:
        self._scene = scene
        self._space: Space | None = None
        self._planes: list[viser.ImageHandle] = []
        self._shown: object = None
        self.is_shown = False
        """Whether any map stands there."""

    def show(self, space: Space, key: object, pictures: tuple[Picture, ...]) -> None:
        """Stand the pictures one behind the other through the window's depth; the same `key` is the same pictures."""
        if (space, key, len(pictures)) == self._shown:
            return
        if space != self._space:
            for plane in self._planes:
                plane.remove()
            self._space, self._planes = space, []
        for i, plane in enumerate(self._planes):
            plane.visible = i < len(pictures)
        for i, picture in enumerate(pictures):
            z = DEPTH * (i + 1) / len(pictures)
            if i < len(self._planes):
                self._planes[i].image, self._planes[i].position = picture, (0.0, 0.0, z)
            else:
                self._planes.append(add_plane(self._scene, f"/maps/{i}", space, picture, z))
        self._shown, self.is_shown = (space, key, len(pictures)), bool(pictures)


STEPS = 10
"""Straight pieces of an arc."""
RISE = 0.35
"""How far an arc stands out before the plane, as a share of its length."""


class LinksNode:
    """One set of lines a scale; made when it is first needed."""

    def __init__(self, scene: viser.SceneApi) -> None:
        self._scene = scene
        self._lines: dict[int, viser.LineSegmentsHandle] = {}
        self._shown: object = None
        self.is_shown = False
        """Whether any link is drawn."""

    def show(self, space: Space, query: tuple[int, int] | None, links: tuple[Link, ...]) -> None:
        """Draw the links of a query; none takes all away."""
        key = (space, query, links)
        if key == self._shown:
            return
        self._shown, self.is_shown = key, bool(links)
        scales = {link.scale for link in links}
        for scale, lines in self._lines.items():
            lines.visible = scale in scales
        if query is None:
            return
        for scale in scales:
            points = np.concatenate([arc(space, query, link.pixel) for link in links if link.scale == scale])
            if scale in self._lines:
                self._lines[scale].points = points
            else:
                self._lines[scale] = self._scene.add_line_segments(
                    f"/links/{scale}", points, colors=LINK_COLOURS[scale], thickness=2.5, thickness_units="screen"
                )


def arc(space: Space, start: tuple[int, int], stop: tuple[int, int]) -> Float32[np.ndarray, "pieces 2 3"]:
    """From one pixel's middle to another's, rising towards the viewer in between."""
    ends = np.array([[*start, 0], [*stop, 0]], np.float32) + np.array([0.5, 0.5, 0], np.float32)
    first, last = space.place(ends)
    share = np.linspace(0, 1, STEPS + 1, dtype=np.float32)[:, None]
    path = first + share * (last - first)
    path[:, 2] -= 4 * RISE * (share * (1 - share))[:, 0] * float(np.linalg.norm(last - first))
    path[:, 2] -= 0.01  # before the plane, not in it
    return np.stack([path[:-1], path[1:]], axis=1)

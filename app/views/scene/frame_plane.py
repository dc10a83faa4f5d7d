"""The picture that stands at the newest moment: a click on it is a click on a pixel of the sensor."""

from __future__ import annotations

import time
from collections.abc import Callable

import numpy as np
import viser
from jaxtyping import UInt8

from app.state import intents as ask
from app.views.scene.space import Space

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

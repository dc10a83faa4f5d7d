"""One layer's maps at every scale as planes behind the frame, the finest nearest to it."""

from __future__ import annotations

import numpy as np
import viser
from jaxtyping import UInt8

from app.views.scene.frame_plane import add_plane
from app.views.scene.space import DEPTH, Space

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

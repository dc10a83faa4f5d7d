"""The window's events as points: the newest at the viewer's end, where the frame plane stands, the past behind it."""

from __future__ import annotations

import numpy as np
import viser
from jaxtyping import Float32

from app.present import EventCloud
from app.scene.space import DEPTH, Space, box_corners

POINTS_AT_REST = 40_000
POINTS_IN_MOTION = 10_000
"""While a finger drags or a recording plays: what software graphics still draw at ten frames a second."""
EDGE = (96, 102, 112)
ARROW = (205, 211, 220)
TICKS = 4


class CloudNode:
    """Points, the box around them, and the time that its depth stands for."""

    def __init__(self, scene: viser.SceneApi) -> None:
        self._scene = scene
        self._space: Space | None = None
        self._points: viser.PointCloudHandle | None = None
        self._labels: list[viser.LabelHandle] = []
        self._depth_text = ""
        self._shown: EventCloud | None = None
        self._root = scene.add_frame("/window", show_axes=False)

    def show(self, space: Space, cloud: EventCloud) -> None:
        """Draw the events of one window. Call inside `client.atomic()`: points and colours must change together."""
        if cloud is self._shown and space == self._space:
            return
        if space != self._space:
            self._build(space)
        assert self._points is not None
        self._points.points = space.place(cloud.positions)
        self._points.colors = cloud.colours
        self._say_depth(cloud.duration_ms)
        self._shown = cloud

    def set_visible(self, is_visible: bool) -> None:
        """Show or hide cloud, box and ticks."""
        if self._root.visible != is_visible:
            self._root.visible = is_visible

    def _build(self, space: Space) -> None:
        self._space = space
        nothing = np.zeros((0, 3), np.float32)
        self._points = self._scene.add_point_cloud(
            "/window/events",
            nothing,
            nothing.astype(np.uint8),
            point_size=max(0.55 * space.unit, 0.008),
            point_shape="circle",
            point_shading="flat",
            precision="float16",
        )
        lines = self._scene.add_line_segments
        lines("/window/box", _edges(space), colors=EDGE, thickness=1.0, thickness_units="screen")
        lines("/window/arrow", _arrow(space), colors=ARROW, thickness=2.0, thickness_units="screen")
        self._labels = [
            self._scene.add_label(
                f"/window/tick{i}", "", position=_tick(space, i), anchor="top-center", font_screen_scale=0.75
            )
            for i in range(TICKS + 1)
        ]
        self._depth_text = ""

    def _say_depth(self, milliseconds: float) -> None:
        text = f"{milliseconds:.3g}"
        if text == self._depth_text:
            return
        self._depth_text = text
        for i, label in enumerate(self._labels):
            label.text = "now" if i == 0 else f"−{milliseconds * i / TICKS:.3g} ms"


def _edges(space: Space) -> Float32[np.ndarray, "n 2 3"]:
    corners = box_corners(space)
    pairs = [(a, b) for a in range(8) for b in range(a + 1, 8) if np.sum(np.abs(corners[a] - corners[b]) > 1e-6) == 1]
    return np.array([[corners[a], corners[b]] for a, b in pairs], np.float32)


def _arrow(space: Space) -> Float32[np.ndarray, "n 2 3"]:
    """From the oldest moment to the newest, along the lower edge, with ticks."""
    x, y = -space.width / 2, space.height / 2 + 0.12
    tip, tail = np.array([x, y, -0.25]), np.array([x, y, DEPTH])
    barbs = [[tip, tip + np.array([0.0, side, 0.16])] for side in (-0.07, 0.07)]
    ticks = [[[x, y - 0.05, z], [x, y + 0.05, z]] for z in np.linspace(0.0, DEPTH, TICKS + 1)]
    return np.array([[tail, tip], *barbs, *ticks], np.float32)


def _tick(space: Space, number: int) -> tuple[float, float, float]:
    return -space.width / 2, space.height / 2 + 0.2, DEPTH * number / TICKS

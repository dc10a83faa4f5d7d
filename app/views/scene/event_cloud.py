"""The window's events as points: the newest at the viewer's end, where the frame plane stands, the past behind it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import viser
from jaxtyping import Float32

from app.html.pictures import EventCloud
from app.views.scene.space import DEPTH, Space, box_corners
from etnet.render.timeline import nice_step

POINTS_AT_REST = 40_000
POINTS_IN_MOTION = 10_000
"""While a finger drags or a recording plays: what software graphics still draw at ten frames a second."""
EDGE = (96, 102, 112)
ARROW = (205, 211, 220)
MAX_TICKS = 5
OUT_OF_SIGHT = 1e6
"""Scene units beyond which no camera sees."""


class CloudNode:
    """Points, the box around them, and the time that its depth stands for."""

    def __init__(self, scene: viser.SceneApi) -> None:
        self._scene = scene
        self._space: Space | None = None
        self._points: viser.PointCloudHandle | None = None
        self._labels: list[viser.LabelHandle] = []
        self._ticks: viser.LineSegmentsHandle | None = None
        self._arrow: viser.LineSegmentsHandle | None = None
        self._depth: float | None = None
        self._has_scale = True
        self._shown: EventCloud | None = None
        self._root = scene.add_frame("/window", show_axes=False)

    def show(self, space: Space, cloud: EventCloud, has_scale: bool = True) -> None:
        """Draw the events of one window. Call inside `client.atomic()`: points and colours must change together.

        `has_scale`: with milliseconds along its depth.
        """
        if has_scale != self._has_scale:
            self._has_scale, self._depth = has_scale, None
            if self._ticks is not None and self._arrow is not None:
                self._ticks.visible = self._arrow.visible = has_scale
        if cloud is self._shown and space == self._space and self._depth is not None:
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
        self._keep_shader()
        lines = self._scene.add_line_segments
        lines("/window/box", _edges(space), colors=EDGE, thickness=1.0, thickness_units="screen")
        self._arrow = lines("/window/arrow", _arrow(space), colors=ARROW, thickness=2.0, thickness_units="screen")
        self._ticks = lines(
            "/window/ticks", _ticks(space, [0.0]), colors=ARROW, thickness=2.0, thickness_units="screen"
        )
        self._labels = [
            self._scene.add_label(f"/window/tick{i}", "", anchor="top-center", font_screen_scale=0.75)
            for i in range(MAX_TICKS)
        ]
        self._depth = None
        self._ticks.visible = self._arrow.visible = self._has_scale

    def _keep_shader(self) -> None:
        """Two points that nobody sees.

        viser's client makes a new material for each new set of colours and drops the former one. With it the shader
        goes, and is compiled once more for every push of a drag, which blocks the page for 100 ms where graphics are
        done in software. While another cloud with colours of its own is there, it stays.
        """
        self._scene.add_point_cloud(
            "/window/shader",
            np.full((2, 3), OUT_OF_SIGHT, np.float32),
            np.zeros((2, 3), np.uint8),
            point_size=0.01,
            point_shape="circle",
            point_shading="flat",
            precision="float32",
        )

    def _say_depth(self, milliseconds: float) -> None:
        """Ticks at round times before the newest moment."""
        if milliseconds == self._depth or self._space is None or self._ticks is None:
            return
        self._depth = milliseconds
        step = nice_step(milliseconds, MAX_TICKS - 1) if milliseconds > 0 else 1.0
        times = [i * step for i in range(MAX_TICKS) if i * step <= milliseconds]
        places = [DEPTH * time / max(milliseconds, 1e-9) for time in times]
        self._ticks.points = _ticks(self._space, places)
        for i, label in enumerate(self._labels):
            label.visible = self._has_scale and i < len(times)
            if label.visible:
                label.text = "now" if i == 0 else f"−{times[i]:g} ms"
                label.position = (-self._space.width / 2, self._space.height / 2 + 0.2, places[i])


def _edges(space: Space) -> Float32[np.ndarray, "n 2 3"]:
    corners = box_corners(space)
    pairs = [(a, b) for a in range(8) for b in range(a + 1, 8) if np.sum(np.abs(corners[a] - corners[b]) > 1e-6) == 1]
    return np.array([[corners[a], corners[b]] for a, b in pairs], np.float32)


def _arrow(space: Space) -> Float32[np.ndarray, "n 2 3"]:
    """From the oldest moment to the newest, along the lower edge."""
    x, y = -space.width / 2, space.height / 2 + 0.12
    tip, tail = np.array([x, y, -0.25]), np.array([x, y, DEPTH])
    barbs = [[tip, tip + np.array([0.0, side, 0.16])] for side in (-0.07, 0.07)]
    return np.array([[tail, tip], *barbs], np.float32)


def _ticks(space: Space, places: Sequence[float]) -> Float32[np.ndarray, "n 2 3"]:
    x, y = -space.width / 2, space.height / 2 + 0.12
    return np.array([[[x, y - 0.05, z], [x, y + 0.05, z]] for z in places], np.float32)

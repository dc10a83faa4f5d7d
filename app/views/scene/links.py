"""The strongest looks of the query as arcs before the frame plane, from the pixel to where they land."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import viser
from jaxtyping import Float32

from app.html.attention.links import LINK_COLOURS
from app.views.scene.space import Space

if TYPE_CHECKING:
    from etnet.inspection.links import Link

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

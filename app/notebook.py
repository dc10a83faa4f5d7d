"""The viewer inside a notebook: `app.view(recording)` starts one, shows it, and gives what it shows as arrays."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from jaxtyping import Float32

from app.config import ViewerConfig
from etnet.errors import EtnetError
from etnet.events.events import Events
from etnet.windows import Window

if TYPE_CHECKING:
    from app.main import Viewer
    from etnet.events.recording import Recording
    from etnet.nets.attention import Attention


class NotShownError(EtnetError):
    """The page has nothing to give yet."""


@dataclass(frozen=True, eq=False)
class Shown:
    """What the page shows at this moment. `frame` is the network's raw output; `None` until it has come.

    `camera` is the ordinary camera's nearest frame, 0 … 1; `attention` is there once a pixel was clicked.
    """

    window: Window
    events: Events
    voxel: Float32[np.ndarray, "bins h w"]
    frame: Float32[np.ndarray, "h w"] | None
    camera: Float32[np.ndarray, "h w"] | None
    attention: Attention | None
    query: tuple[int, int] | None
    """The pixel (x, y) that was clicked last."""


class NotebookViewer:
    """A running viewer that a notebook shows; `stop` ends it, and so does the end of the notebook's process."""

    def __init__(self, viewer: Viewer, height: int) -> None:
        self._viewer = viewer
        self._height = height

    @property
    def url(self) -> str:
        """Where it is reached from a browser on this machine."""
        return self._viewer.url

    @property
    def shown(self) -> Shown:
        """The moment on the page that was drawn last; an error before there is one."""
        page = self._viewer.newest_page()
        if page is None or page.moment is None:
            raise NotShownError("the page shows nothing yet; let the notebook show the viewer, and ask again")
        moment, ready = page.moment, page.ready
        is_there = ready is not None and ready.request.index == moment.index and not ready.is_approximate
        truth = moment.recording.ground_truth
        return Shown(
            moment.window,
            moment.events,
            moment.voxel,
            ready.frame if ready is not None and is_there else None,
            truth.read_frame(truth.nearest(moment.window.t_stop)) if truth is not None and len(truth) else None,
            ready.attention if ready is not None and is_there else None,
            page.state.query,
        )

    def stop(self) -> None:
        """End the viewer."""
        self._viewer.stop()

    def _repr_html_(self) -> str:
        """What a notebook shows of this."""
        style = f"width:100%;height:{self._height}px;border:0;border-radius:6px"
        return f'<iframe src="{escape(self.url)}" style="{style}" allow="clipboard-write"></iframe>'

    def __repr__(self) -> str:
        return f"viewer at {self.url}"


def view(
    recording: Recording | Path | str, height: int = 720, views: Sequence[Any] = (), **options: Any
) -> NotebookViewer:
    """Start a viewer on a recording, in this process, and let the notebook embed it.

    `options` are those of `etnet-view` (model, precision, threads, roi …). A recording that is open is looked at as the
    file it came from. `views` are views of your own: functions `show(moment)`, files, or `View`s (docs/own_view.md).
    """
    from app.main import Viewer

    path = recording if isinstance(recording, str | Path) else recording.path
    if path is None:
        raise EtnetError("this recording was made in memory; write it with etnet.events.write and view the file")
    config = ViewerConfig(file=Path(path), **{"port": 0, **options})
    return NotebookViewer(Viewer(config, views, is_embedded=True), height)

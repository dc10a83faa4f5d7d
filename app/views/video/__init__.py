"""A video as an event camera would have seen it: its settings, how far it is made, and how good the frames are."""

from __future__ import annotations

from typing import TYPE_CHECKING

from app.views.page import Page
from app.views.video.jobs import film_jobs
from app.views.video.state import VideoState
from app.views.view import View

if TYPE_CHECKING:
    import viser

    from app.catalogue.visitor import VisitorCatalogue
    from app.views.panel import Panel


def _panel(client: viser.ClientHandle) -> Panel:
    from app.views.video.panel import VideoPanel

    return VideoPanel()


def _is_video(page: Page) -> bool:
    return page.video is not None


def _is_film(catalogue: VisitorCatalogue, recording_id: str) -> bool:
    return catalogue.is_film(recording_id)


VIEW = View(
    "video",
    "Video",
    "MOVIE",
    VideoState(),
    _panel,
    settings_in=frozenset({"inspect", "recording"}),
    suits=_is_video,
    opens_for=_is_film,
    run_jobs=film_jobs,
)

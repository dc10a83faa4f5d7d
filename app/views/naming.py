"""By what names Python finds what a page shows: the recording's file and a network, or why it finds none."""

from __future__ import annotations

from app.catalogue.cut import CutRecording
from app.html.attention.python import Named
from app.views.page import Page


def named(page: Page, model_id: str) -> Named:
    """The names of the open recording's file, and of a network that the page lists."""
    listed = next((choice.source for choice in page.models if choice.id == model_id), "")
    return Named(page.file_name, listed or page.model.source)


def cannot_be_named(page: Page) -> str:
    """Why no lines of Python open what is shown, in a sentence; empty where they do."""
    if page.is_live or (page.moment is not None and isinstance(page.moment.recording, CutRecording)):
        return "These events come from a source and lie in no file. Record them, open the file, and copy its lines."
    if page.video is not None:
        return (
            "These events are simulated from a video, which Python opens as no recording. "
            "etnet simulate --video writes them to a file; open that, and copy its lines."
        )
    if not page.file_name:
        return "The file of this recording is gone, so no lines of Python open it."
    return ""


def title_of(page: Page, model_id: str) -> str:
    """What the page calls a network."""
    listed = next((choice.title for choice in page.models if choice.id == model_id), "")
    return listed or (page.model.title if model_id == page.state.model_id else model_id)

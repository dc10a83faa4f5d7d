"""The sensor's full size, how it is binned, and the choice of another binning."""

from __future__ import annotations

from dataclasses import replace

from app.catalogue.recording_id import seen_id
from app.html.elements import segmented
from app.views.page import Page
from etnet.events.opened_as import WHOLE_VIEW
from etnet.events.recording import Recording

FACTORS = (1, 2, 4)


def sensor_words(recording: Recording) -> str:
    """Its size in pixels; where pixels are binned, the full size and how."""
    view = WHOLE_VIEW if recording.opened_as is None else recording.opened_as.view
    if view.downsample == 1:
        return f"{recording.sensor} pixels"
    factor = view.downsample
    width, height = (side * factor for side in (recording.sensor.width, recording.sensor.height))
    return f"{width}×{height}, binned {factor}×{factor} to {recording.sensor}"


def binning_html(page: Page) -> str:
    """1×1, 2×2 or 4×4: the recording is opened again, at the same moment."""
    assert page.moment is not None
    opened = page.moment.recording.opened_as
    view = WHOLE_VIEW if opened is None else opened.view
    ids = {factor: seen_id(page.state.recording_id, replace(view, downsample=factor)) for factor in FACTORS}
    options = {f"reopen:{ids[factor]}": f"{factor}×{factor}" for factor in FACTORS}
    return segmented("Binning", options, f"reopen:{ids[view.downsample]}")

"""The reconstruction with its badge, and the choice of tone mapping."""

from __future__ import annotations

from app.html.card import segmented
from app.html.elements import empty, panel
from app.html.live import live_badge
from app.html.pictures import reconstruction_html
from app.views.page import Page
from app.views.reconstruction.state import ReconstructionState, tones_of
from etnet.render.tone import Tone

TONES: dict[Tone, str] = {
    "auto": "default",
    "raw": "linear",
    "robust": "1–99 %",
    "gamma": "gamma 2.2",
    "hdr": "auto HDR",
    "clahe": "CLAHE",
}
"""Tone mapping: of the network by default, or as a visitor chooses."""


def reconstruction_of(page: Page, marks_query: bool = True) -> str:
    """The reconstruction with its badge, and how far the wanted one is; or why nothing is open."""
    if page.moment is None and page.trouble:
        return panel("reconstruction", empty("No image", page.trouble))
    return reconstruction_html(
        page.ready,
        tones=tones_of(page),
        wanted=page.missed,
        query=page.state.query if marks_query else None,
        working=page.working,
        failed=page.failed,
        badge=_live_badge(page),
    )


def _live_badge(page: Page) -> str:
    if page.live is None or not page.is_live:
        return ""
    return live_badge(page.live, page.follows, None if page.moment is None else page.moment.seconds[1])


def tone_html(page: Page) -> str:
    """The choice of tone mapping."""
    options = {f"set:reconstruction.tone:{name}": words for name, words in TONES.items()}
    chosen = f"set:reconstruction.tone:{page.state.of(ReconstructionState).tone}"
    return segmented("Tone mapping", options, chosen)

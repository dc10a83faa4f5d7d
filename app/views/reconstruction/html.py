"""The reconstruction with its badge, and the choice of tone mapping."""

from __future__ import annotations

import numpy as np

from app.html.controls import under_way
from app.html.elements import empty, icon_button, panel, picture
from app.html.live import live_badge
from app.html.moment import PICTURES
from app.html.pictures import camera_picture, ramp_reads, reconstruction_html
from app.html.units import short
from app.views.page import Page
from app.views.reconstruction.jobs import SLOT, VarianceJob
from app.views.reconstruction.state import ReconstructionState, tones_of
from etnet.render.colours import css_gradient, sequential
from etnet.render.encode import data_url


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
        beside=_beside(page),
    )


def _live_badge(page: Page) -> str:
    if page.live is None or not page.is_live:
        return ""
    return live_badge(page.live, page.follows, None if page.moment is None else page.moment.seconds[1])


def _beside(page: Page) -> str:
    """The camera's frame to be swiped against, if that is wanted where the picture is large."""
    is_wanted = page.state.of(ReconstructionState).shows == "swipe" and page.areas.get("reconstruction") in ("a", "b")
    return camera_picture(page.moment, tones_of(page)) if is_wanted and page.moment is not None else ""


def shown_html(page: Page) -> str:
    """The picture of the card: the frame, or the network's own estimate of its variance."""
    shows = page.state.of(ReconstructionState).shows
    return variance_html(page) if shows == "variance" and page.model.estimates_variance else reconstruction_of(page)


def tools_html(page: Page) -> str:
    """What else the card can show: a swipe against the camera, and the variance where the network estimates one."""
    shows, tools = page.state.of(ReconstructionState).shows, ""
    if page.model.estimates_variance:
        tools += _switch("variance", "Variance, as the network estimates it", shows)
    if page.moment is not None and page.moment.recording.ground_truth:
        tools += _switch("swipe", "Swipe against the camera", shows)
    return tools + icon_button("tab:filter", "info", "Why is it bad here?")


def _switch(name: str, words: str, shows: str) -> str:
    key = f"set:reconstruction.shows:{'frame' if shows == name else name}"
    return icon_button(key, name, words, is_on=shows == name)


def variance_html(page: Page) -> str:
    """The variance map with its scale, or in words that there is none."""
    result = page.results.get(SLOT)
    if result is None or result.value is None:
        return panel(
            "variance", under_way(0.0, "estimating") if result is None else empty("No variance", result.trouble)
        )
    variance, job = result.value, result.job
    assert isinstance(job, VarianceJob)
    top = float(variance.max())
    if top <= 0:
        why = f"With these weights {page.model.title} estimates a variance of 0 for every pixel of this frame."
        return panel("variance", empty("Variance is 0 everywhere", why))
    url = PICTURES.text(
        ("variance", job.request),
        lambda: data_url(sequential()[np.rint(variance / top * 255).astype(np.uint8)], is_lossless=True),
    )
    height, width = variance.shape
    image = picture(url, "Variance", key="pixel", size=(width, height), reads=ramp_reads(sequential(), 0.0, top))
    lags = "" if job.request.index == page.state.index else "et-lags"
    scale = f'<i style="background:{css_gradient(sequential())}"></i><b>{short(top)}</b>'
    note = f'<div class="et-chips"><span class="et-scale">variance<b>0</b>{scale}</span></div>'
    return panel("variance", f'<div class="{lags}">{image}</div>', note)

"""What is like the chosen token, here and in another window or run; and a feature's tokens as colours."""

from __future__ import annotations

from typing import Any

import numpy as np
from jaxtyping import Float, UInt8

from app.engine.jobs import JobResult
from app.html.attention.keep import kept
from app.html.attention.look import Keep
from app.html.attention.maps import large_map
from app.html.controls import button
from app.html.elements import escape, panel, segmented
from app.html.units import count, of_whole
from app.views.attention.html.shelf import waits
from app.views.attention.html.shown import (
    Seen,
    lacks_attention,
    missing,
    not_button,
    recurrent_of,
    seen_of,
    shown_of,
)
from app.views.attention.jobs.site import Tokens, site_of_word
from app.views.attention.state import AttentionState, FeatureWord, other_moment
from app.views.naming import title_of
from app.views.page import Page
from etnet.render.colours import css_gradient, sequential

FEATURES: dict[FeatureWord, str] = {
    "tokens": "tokens after this layer", "query": "queries of this site", "key": "keys of this site",
    "value": "values of this site", "context": "aggregated context", "hidden 1": "ConvLSTM hidden, 1/2",
    "hidden 2": "ConvLSTM hidden, 1/4", "hidden 3": "ConvLSTM hidden, 1/8",
}  # fmt: skip

SHORT: dict[FeatureWord, str] = {
    "tokens": "after this layer", "query": "queries", "key": "keys", "value": "values", "context": "context",
    "hidden 1": "hidden, 1/2", "hidden 2": "hidden, 1/4", "hidden 3": "hidden, 1/8",
}  # fmt: skip
"""The same in the header of a small card."""


def tokens_html(page: Page) -> tuple[str, str, str, str]:
    """Title, note, tools and body of the card of tokens."""
    slice_ = page.state.of(AttentionState)
    options = {"set:attention.tokens:similarity": "similar", "set:attention.tokens:pca": "PCA"}
    tools = segmented("Tokens", options, f"set:attention.tokens:{slice_.tokens}")
    tools += not_button(slice_)
    title = "Token similarity" if slice_.tokens == "similarity" else "Tokens as colours"
    shown: Seen | None = shown_of(page)
    if lacks_attention(page) and _is_of_the_state(page):
        shown = seen_of(page)  # the state is there without attention
    if shown is None:
        return title, "", tools, panel("tokens", missing(page, is_brief=True), _state_instead(page))
    found = shown.feature("tokens")
    if found is None:
        rest = waits(shown.found("tokens"), "one pass of the network")
        return title, "", tools, panel("tokens", rest)
    if slice_.tokens == "similarity":
        whole = f"cosine to this token: {FEATURES[slice_.feature]}"
        note = f'<span title="{escape(whole)}">{escape(SHORT[slice_.feature])}</span>'
        return title, note, tools, panel("tokens", _similar(shown, found))
    basis = shown.feature("basis")
    if basis is None:
        rest = waits(shown.found("basis"), "fitting colours to the recording, once")
        return title, "", tools, panel("tokens", rest)
    held = " + ".join(of_whole(share) for share in basis.explained)
    return title, f"PCA, {held} of the variance", tools, panel("tokens", _colours(shown, found, basis))


def _is_of_the_state(page: Page) -> bool:
    """Whether the chosen vectors are the state of a level that the network has."""
    kind, _, level = page.state.of(AttentionState).feature.partition(" ")
    return kind == "hidden" and int(level) in recurrent_of(page)


def _state_instead(page: Page) -> str:
    """Of a network without attention: its state can be looked at."""
    levels = recurrent_of(page)
    if not lacks_attention(page) or not levels:
        return ""
    key = f"set:attention.feature:hidden {levels[0]}"
    return f'<div class="et-chips">{button("Show its recurrent state", key, classes="et-strong")}</div>'


def _similar(shown: Seen, found: Tokens) -> str:
    keep = shown.look.keep
    here = _picture(found, found.similarity(shown.look.query), keep, shown.look.query)
    readout = '<span class="et-chip" data-etv-readout>cosine</span>'
    if other_moment(shown.page.state, shown.ready.request) is None:
        return _staged(here, f"{_scale()}{readout}")
    result = found_elsewhere(shown)
    if result is None or result.value is None:
        return _pair(_staged(here, f"<span></span>{readout}"), waits(result, "the other window"))
    job, there = result.job, result.value
    try:
        values = there.similarity(shown.look.query, of=found)
    except ValueError as error:
        return _pair(_staged(here, readout), f'<div class="et-say" data-testid="lacks">{escape(str(error))}.</div>')
    words = f"window {count(job.request.index)}"
    if job.request.model_id != shown.ready.request.model_id:
        words = title_of(shown.page, job.request.model_id)
    now = f'<span class="et-chip">window {count(shown.ready.request.index)}</span>'
    then = f'<span class="et-chip" data-testid="also">{escape(words)} · max {float(values.max()):.2f}</span>'
    readout = '<span class="et-chip" data-etv-readout></span>'
    other = _picture(there, values, keep, None)
    return _pair(_staged(here, f"{now}{readout}"), _staged(other, f"{then}{readout}"))


def found_elsewhere(shown: Seen) -> JobResult | None:
    """The chosen feature in the other window, at the pin or in the run that is looked at, as far as it is known."""
    elsewhere = other_moment(shown.page.state, shown.ready.request)
    result = shown.page.results.get("attention.tokens_also")
    if elsewhere is None or result is None:
        return None
    job: Any = result.job
    asked = site_of_word(shown.slice_.feature, shown.slice_.site), shown.slice_.feature
    is_asked = (job.site, job.word) == asked and job.request.playback == elsewhere.playback
    return result if is_asked and job.request.frame == elsewhere.frame else None


def _scale() -> str:
    return f'<span class="et-scale">−1<i style="background:{css_gradient(sequential())}"></i>1</span>'


def _pair(left: str, right: str) -> str:
    return f'<div class="et-two-maps">{left}{right}</div>'


def _staged(image: str, badges: str) -> str:
    return f'<div class="et-stage-map" data-etv-focus="1">{image}<div class="et-badges">{badges}</div></div>'


def _picture(
    found: Tokens, values: Float[np.ndarray, "rows columns"], keep: Keep, query: tuple[int, int] | None
) -> str:
    """Those tokens that are kept: the most similar ones, or the fewest that hold so much of all similarity above 0."""
    level = np.rint((values.clip(-1, 1) + 1) * 127.5).astype(np.uint8)
    drawn = _opaque(sequential()[level])
    if keep != "all":
        drawn[~kept(values.clip(0).reshape(-1), keep).reshape(values.shape), 3] = 0
    return large_map(
        found.grid,
        drawn,
        values.reshape(-1),
        "",
        "cosine similarity",
        query=query,
        unit="cosine",
    )


def _colours(shown: Seen, found: Tokens, basis: Any) -> str:
    colours = np.rint(basis.colours(found.map) * 255).astype(np.uint8)
    first = basis.coordinates(found.map)[..., 0].reshape(-1)
    query = shown.look.query
    image = large_map(found.grid, _opaque(colours), first, "", "three components", query=query, unit="1st component")
    return f'<div class="et-stage-map" data-etv-focus="1">{image}</div>'


def _opaque(colours: UInt8[np.ndarray, "rows columns 3"]) -> UInt8[np.ndarray, "rows columns 4"]:
    return np.concatenate([colours, np.full((*colours.shape[:2], 1), 255, np.uint8)], axis=-1)

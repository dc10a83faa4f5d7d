"""Attention beyond one map: rolled out through the whole transformer, and followed through time."""

from __future__ import annotations

from typing import TYPE_CHECKING, get_args

import numpy as np

from app.engine.requests import Ready
from app.html.attention.maps import AttentionLook, map_html, map_legend, site_words, tokens_words
from app.html.controls import LINE, button, buttons, curves, plain_bar
from app.html.elements import escape, legend, panel, picture, segmented
from app.html.moment import PICTURES
from app.html.units import count, fraction, milliseconds, of_whole, resolution
from app.views.inspect.results import Followed, RolledOut
from app.views.inspect.state import Fusion, InspectState
from etnet.render.attention import HIGHEST, LOWEST, log_level
from etnet.render.colours import css_gradient, sequential
from etnet.render.encode import data_url

if TYPE_CHECKING:
    from app.views.inspect.jobs.pixel import ThroughTimeJob
    from etnet.inspection.anatomy import Anatomy

DISCARDS = (0, 50, 90)
"""Per cent of the smallest weights that can be left out."""


def rolled_html(rolled: RolledOut | None, ready: Ready, look: AttentionLook, slice_: InspectState, base: str) -> str:
    """How much of the pixel's token comes in through which scale and place; the choice alone before that."""
    choice = buttons(
        "Leave out",
        "".join(
            button(f"{share} %" if share else "nothing", f"set:inspect.discard:{share}", is_on=share == slice_.discard)
            for share in DISCARDS
        ),
        "the smallest weights of every row, before they are multiplied",
    )
    choice += buttons(
        "Head fusion",
        "".join(button(word, f"set:inspect.fusion:{word}", is_on=word == slice_.fusion) for word in get_args(Fusion)),
        "how one map is made of a site’s heads; each row of it is then scaled to sum to 1",
    )
    lead = (
        "One attention map shows one step. Rolled out, the steps of all layers are multiplied: which tokens, at which "
        "scale, have a part in what the transformer says of this pixel. Residuals count half; values are ignored."
    )
    head = f'<div class="et-note">{escape(lead)}</div>{choice}'
    if rolled is None or ready.attention is None:
        return panel("rolled", head)
    attention = ready.attention
    shares = rolled.weights.sum(1)
    cells: list[str] = []
    for scale, weights, share in zip(rolled.scales, rolled.weights, shares, strict=True):
        row = weights / max(float(share), 1e-20)
        map_ = map_html(attention, row, look, f"rollout of scale {scale}", "")
        cells.append(
            f'<figure class="et-thumb">{map_}<figcaption class="et-label"><b>{resolution(scale)}</b><br>'
            f"≈ {tokens_words(row)} tokens</figcaption></figure>"
        )
    total = rolled.weights.sum(0)
    whole = map_html(attention, total, look, "rollout of all scales", "")
    bars = "".join(
        f'<span class="et-note">comes in at {resolution(scale)}</span>'
        f'<span class="et-measure">{plain_bar(float(share), 1.0)}<b>{of_whole(share, 1)}</b></span>'
        for scale, share in zip(rolled.scales, shares, strict=True)
    )
    style = f"--n:{attention.grid.columns};--base:url({base})"
    return panel(
        "rolled",
        head,
        f'<div class="et-wide-map">{whole}</div>',
        f'<div class="et-caption"><span>all scales together, ≈ <b>{tokens_words(total)}</b> of '
        f"{count(len(total))} tokens</span><span>sums to {float(total.sum()):.4f}</span></div>",
        map_legend(look),
        f'<div class="et-table et-two" data-testid="by-scale">{bars}</div>',
        f'<div class="et-three et-pair">{"".join(cells)}</div>',
        style=style,
    )


def followed_html(followed: Followed, job: ThroughTimeJob, anatomy: Anatomy) -> str:
    """A kymograph of the pixel's token row, and two curves under it in the same measure of time."""
    num = len(followed.indices)
    site, head = anatomy.site(job.site), anatomy.head(job.head)
    who = "mean map of the heads" if head is None else f"head {head}"
    x, y = job.pixel
    span = milliseconds((followed.stamps[-1] - followed.stamps[0]) / 1000) if num > 1 else "one window"
    lead = (
        f"{site_words(site, anatomy.sites)}, {who}, for "
        f"{'the patch that is now at' if job.follows else 'pixel'} ({x}, {y})"
        f" in the last {num} windows ({span}). Time runs down: the newest line is the current window."
    )
    follows = segmented(
        "Follow",
        {"set:attention.follows:False": "pixel", "set:attention.follows:True": "patch, along its events"},
        f"set:attention.follows:{job.follows}",
    )
    url = PICTURES.text(("kymograph", job, num), lambda: _kymograph(followed))
    columns = followed.along_row.shape[1]
    image = picture(
        url, "attention along the row, over time", size=(columns, num), classes="et-sharp et-kymograph",
        style=f"--columns:{columns};--lines:{num}",
    )  # fmt: skip
    bits = float(np.log2(followed.num_tokens))
    share = float(followed.near[-1])
    values = (LOWEST, 1.0, 4.0, HIGHEST)
    powers = float(np.log2(HIGHEST / LOWEST))
    ticks = [
        (
            float(np.log2(value / LOWEST)) / powers,
            f"{'≥ ' if value == HIGHEST else '≤ ' if value == LOWEST else ''}{fraction(value)} ×",
        )
        for value in values
    ]
    return panel(
        "followed",
        f'<div class="et-note">{escape(lead)}</div><div class="et-chips">{follows}</div>',
        image,
        '<div class="et-caption"><span>left edge of the image</span><span>the pixel’s row of tokens</span>'
        "<span>right edge</span></div>",
        legend("attention, × uniform", css_gradient(sequential()), ticks),
        "<h4>Entropy</h4>",
        curves({LINE: followed.entropy}, bits, f"{bits:.2f} bits: uniform", "0: one token"),
        f'<div class="et-note" data-testid="entropy-now">now {float(followed.entropy[-1]):.2f} bits</div>',
        "<h4>Local mass (≤ 16 px)</h4>",
        curves({LINE: followed.near}, max(float(followed.near.max()), followed.even) * 1.15, "", "0 %", followed.even),
        f'<div class="et-note" data-testid="near-now">now {of_whole(share, 1)} within {followed.reach} pixels; '
        f"the dashed line, {of_whole(followed.even, 1)}, is what uniform attention gives</div>",
    )


def _kymograph(followed: Followed) -> str:
    level = log_level(followed.along_row)
    return data_url(sequential()[np.rint(level * 255).astype(np.uint8)], is_lossless=True)

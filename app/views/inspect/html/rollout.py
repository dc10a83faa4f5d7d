"""Attention beyond one map: rolled out through the whole transformer, and followed through time."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, get_args

import numpy as np

from app.engine.requests import Ready
from app.html.attention.keep import kept, kept_words
from app.html.attention.look import Keep
from app.html.attention.maps import AttentionLook, map_html, map_legend, site_words, tokens_words
from app.html.chart import Line, chart
from app.html.controls import button, buttons, plain_bar
from app.html.elements import ON_PICK, escape, legend, panel, picture, segmented
from app.html.moment import PICTURES, Moment
from app.html.units import count, fraction, of_whole, resolution
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
    attention, look = ready.attention, replace(look, direction="attends to")  # it is made of rows, whatever is chosen
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


def followed_html(
    followed: Followed, job: ThroughTimeJob, anatomy: Anatomy, moment: Moment, look: AttentionLook
) -> str:
    """A kymograph of the pixel's token row, and two curves in the same windows; a click goes to its moment."""
    num = len(followed.indices)
    site, head = anatomy.site(job.site), anatomy.head(job.head)
    who = "mean map of the heads" if head is None else f"head {head}"
    x, y = job.pixel
    whose = f"pixel ({x}, {y})"
    if job.anchor is not None:
        whose = f"the patch that lies at ({x}, {y}) in window {count(job.anchor)}"
    lead = (
        f"{site_words(site, anatomy.sites)}, {who}, for {whose} in windows {count(followed.indices[0])} to "
        f"{count(followed.indices[-1])}. Time runs down; the marked line is the current window."
    )
    follows = segmented(
        "Follow",
        {"set:attention.follows:False": "pixel", "set:attention.follows:True": "patch, along its events"},
        f"set:attention.follows:{job.anchor is not None}",
    )
    index, start = moment.index, moment.recording.span.start
    place = followed.indices.index(index) if index in followed.indices else None
    times = [(stamp - start) / 1e6 for stamp in followed.stamps]
    bits = float(np.log2(followed.num_tokens))
    values = (LOWEST, 1.0, 4.0, HIGHEST)
    powers = float(np.log2(HIGHEST / LOWEST))
    ticks = [
        (
            float(np.log2(value / LOWEST)) / powers,
            f"{'≥ ' if value == HIGHEST else '≤ ' if value == LOWEST else ''}{fraction(value)} ×",
        )
        for value in values
    ]
    entropy, near = followed.entropy.tolist(), followed.near.tolist()
    most = max(max(near), followed.even) * 1.15
    sharp = "" if place is None else f"now {entropy[place]:.2f} bits"
    local = "" if place is None else f"now {of_whole(near[place], 1)}"
    return panel(
        "followed",
        f'<div class="et-note">{escape(lead)}</div><div class="et-chips">{follows}</div>',
        _kymograph(followed, (job, num, look.keep), times, place, look.keep),
        '<div class="et-caption"><span>left edge</span><span>the pixel’s row of tokens</span>'
        "<span>right edge</span></div>",
        legend("attention, × uniform", css_gradient(sequential()), ticks),
        _kept(followed, look.keep),
        "<h4>Entropy</h4>",
        chart(times, [Line(entropy, is_loud=True)], (0.0, bits), f"{bits:.2f} bits: uniform", index=place, said=sharp,
              testid="entropy-over-time"),
        f"<h4>Local mass (≤ {followed.reach} px)</h4>",
        chart(times, [Line(near, is_loud=True)], (0.0, most), of_whole(most, 1), index=place, said=local,
              even=followed.even, testid="mass-over-time"),
        f'<div class="et-note">the share within {followed.reach} pixels; the dashed line, '
        f"{of_whole(followed.even, 1)}, is what uniform attention gives</div>",
    )  # fmt: skip


def _kymograph(followed: Followed, key: object, times: list[float], place: int | None, keep: Keep) -> str:
    """A line for each window, which can be clicked; that of the current one is marked."""
    num, columns = followed.along_row.shape

    def make() -> str:
        level = log_level(followed.along_row)
        drawn = np.full((num, columns, 4), 255, np.uint8)
        drawn[..., :3] = sequential()[np.rint(level * 255).astype(np.uint8)]
        drawn[~kept(followed.along_row.ravel(), keep).reshape(num, columns), 3] = 0
        return data_url(drawn, is_lossless=True)

    image = picture(
        PICTURES.text(("kymograph", key), make), "attention along the row, over time", size=(columns, num),
        classes="et-sharp et-kymograph", style=f"--columns:{columns};--lines:{num}",
    )  # fmt: skip
    lines = "".join(
        f'<i data-k="goto:{seconds:.6f}" {ON_PICK} title="window {count(index)}"'
        f"{' class=et-now-line' if each == place else ''}></i>"
        for each, (index, seconds) in enumerate(zip(followed.indices, times, strict=True))
    )
    return f'<div class="et-lines" data-testid="kymograph">{image}<div>{lines}</div></div>'


def _kept(followed: Followed, keep: Keep) -> str:
    """How many of the kymograph's cells are drawn, where not all are."""
    words = kept_words(followed.along_row.ravel(), keep)
    return f'<div class="et-note">{words} of what is shown</div>' if words else ""

"""What a visitor changes in the network or its events, and what that does to the image."""

from __future__ import annotations

from typing import TYPE_CHECKING

from app.engine.network_parts import NetworkParts
from app.html.attention.changed import change_words, since_words
from app.html.attention.maps import site_words
from app.html.controls import (
    button,
    buttons,
    grey_picture,
    percent,
    signed_legend,
    signed_limit,
    signed_picture,
    under_way,
)
from app.html.elements import escape, panel, segmented
from app.html.pictures import Tones
from app.html.units import count, milliseconds, resolution, short
from app.views.inspect.html.overview import level_words
from app.views.inspect.results import Outcome
from app.views.inspect.state import JITTERS, Change, is_switched
from etnet.nets.intervention import Intervention
from etnet.render.tone import tone_map

if TYPE_CHECKING:
    from etnet.inspection.anatomy import Anatomy

SHARES = (0.0, 0.1, 0.25, 0.5, 0.9)


def change_html(
    parts: NetworkParts,
    change: Change,
    *,
    index: int,
    site: str,
    outcome: Outcome | None,
    key: object,
    tones: Tones,
    is_whole: bool,
) -> str:
    """What is changed and what it does first, then everything that can be switched."""
    body = [_state(change, index)]
    if not change.is_nothing:
        if not change.at(index).is_nothing and outcome is not None:
            body.append(_outcome(outcome, key, tones, is_whole))
        elif not change.at(index).is_nothing:
            body.append(under_way(0.0, "computing the image with the change"))
    body.append(_scope(change, index))
    lacks = parts.lacks.get("intervention", "") or parts.lacks.get("attention", "")
    body += _switches(parts.anatomy, change.intervention, site, lacks)
    body.append(_events(change))
    return panel("change", *body)


def _state(change: Change, index: int) -> str:
    if change.is_nothing:
        return (
            '<div class="et-note">Switch something off below: the image is made again and stands here beside the '
            "original. Nothing is changed now.</div>"
        )
    ahead = ""
    if change.at(index).is_nothing:
        since = change.since or 0
        when = f"It begins at window {count(since)}" if index < since else f"It held in window {count(since)} alone"
        ahead = f'<div class="et-note">{when}: here the image is original.</div>'
    words = f"{change_words(change.intervention, change.edit)} · {since_words(change.since, change.once)}"
    return (
        f'<div class="et-changed" data-testid="changed"><span>{escape(words)}</span>'
        f"{button('Reset all', 'inspect:reset', classes='et-strong')}</div>{ahead}"
    )


def _outcome(outcome: Outcome, key: object, tones: Tones, is_whole: bool) -> str:
    difference = outcome.changed - outcome.original
    limit = signed_limit(difference)
    figures = [
        ("original", grey_picture(_grey(outcome.original, tones), "original", (key, "original", tones))),
        ("changed", grey_picture(_grey(outcome.changed, tones), "changed", (key, "changed", tones))),
        ("changed − original", signed_picture(difference, limit, "changed − original", (key, "difference"))),
    ]
    cells = "".join(
        f'<figure class="et-thumb">{image}<figcaption class="et-label">{words}</figcaption></figure>'
        for words, image in figures
    )
    lpips = "too small for it" if is_whole else "…"
    if outcome.lpips is not None:
        lpips = f"{outcome.lpips:.4f}"
    mean = percent(float(abs(difference).mean()), is_signed=False)
    numbers = (
        f'<div class="et-caption" data-testid="outcome"><span>mean change <b>{mean}</b></span>'
        f"<span>MSE <b>{short(outcome.mse)}</b></span><span>LPIPS <b>{lpips}</b></span></div>"
    )
    return (
        f'<div class="et-three">{cells}</div>{numbers}{signed_legend("the changed image is", limit)}'
        '<div class="et-note">LPIPS: how different two images look, 0 for equal ones.</div>'
    )


def _grey(frame, tones: Tones):
    return tone_map(frame, tones.tone, tones.is_linear_light)


def _scope(change: Change, index: int) -> str:
    start = count(index if change.since is None else change.since)
    options = {
        "inspect:scope:window": "this window only",
        "inspect:scope:on": f"from window {start} on",
        "inspect:scope:once": f"once, in window {start}",
    }
    why = "Persistent: state and events carry the change into later windows. Once: the state recovers from it."
    if change.scope != "window" and not (change.intervention.changes_memory or not change.edit.changes_nothing):
        later = "later windows are as they were" if change.once else "each later window is changed by itself"
        why = f"What changes the decoding alone leaves no trace in the state: {later}."
    choice = segmented("Scope", options, f"inspect:scope:{change.scope}")
    return f'<div class="et-set"><b>Scope</b>{choice}<div class="et-note">{why}</div></div>'


def _switches(anatomy: Anatomy, intervention: Intervention, site: str, lacks: str) -> list[str]:
    def switch(text: str, part: str, hint: str = "") -> str:
        return button(text, f"inspect:switch:{part}", is_on=is_switched(intervention, part), hint=hint)

    rows: list[str] = []
    if anatomy.scales:
        parts = [switch("TPA", "tpa", "Its output is zero; only the skips are left")]
        if anatomy.has_decoders:
            parts.append(switch("decoders", "decoders"))
        if len(anatomy.scales) > 1:
            parts += [switch(f"scale {resolution(scale)}", f"scale {scale}") for scale in anatomy.scales]
        rows.append(buttons("Ablate", "".join(parts)))
    if anatomy.skips:
        skips = "".join(switch(resolution(level) if level else "head", f"skip {level}") for level in anatomy.skips)
        rows.append(buttons("Remove skip", skips))
    if anatomy.sites:
        name = site if site in anatomy.sites else anatomy.sites[0]
        even = switch("uniform, all sites", "uniform", "Every token is attended to alike, at every site")
        own = switch("ablate site", f"site {name}") + switch("uniform attention", f"alike {name}")
        rows.append(buttons("Attention", even))
        heads = "".join(switch(str(head), f"head {name} {head}") for head in range(anatomy.num_heads))
        words = f"{site_words(name, anatomy.sites)}. For another, choose its map in Attention."
        rows.append(buttons("This site", f'{own}<span class="et-note">mask head</span>{heads}', words))
    if anatomy.levels:
        levels = sorted(anatomy.levels, reverse=True)
        empty = "".join(switch(level_words(anatomy, level), f"zero {level}") for level in levels)
        freeze = "".join(switch(level_words(anatomy, level), f"freeze {level}") for level in levels)
        rows.append(buttons("Zero state", empty))
        rows.append(buttons("Freeze state", freeze))
    if lacks:
        rows.append(f'<div class="et-note" data-testid="lacks">{escape(lacks)}.</div>')
    return rows


def _events(change: Change) -> str:
    edit = change.edit
    rows: list[str] = []
    for name, words in (("drop", "Drop events"), ("invert", "Flip polarity"), ("jitter", "Jitter timestamps")):
        held = getattr(edit, name)
        content = "".join(
            button("none" if not share else f"{share * 100:.0f} %", f"inspect:edit:{name}:{share}", is_on=held == share)
            for share in SHARES
        )
        if name == "jitter":
            content += '<span class="et-note">by up to</span>' + "".join(
                button(milliseconds(far / 1000), f"inspect:edit:jitter_by:{far}", is_on=edit.jitter_by == far)
                for far in JITTERS
            )
        rows.append(buttons(words, content))
    return "".join(rows)

"""What a visitor changes in the network or its events, and what that does to the image."""

from __future__ import annotations

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
from app.html.elements import escape, panel
from app.html.tones import Tones
from app.html.units import count, milliseconds, resolution, short
from app.views.inspect.results import Anatomy, Outcome
from app.views.inspect.state import JITTERS, Change, is_switched
from etnet.nets.intervention import Intervention
from etnet.render.tone import tone_map

SHARES = (0.0, 0.1, 0.25, 0.5, 0.9)


def change_html(
    anatomy: Anatomy,
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
    body.append(_reach(change, index))
    body += _switches(anatomy, change.intervention, site)
    body.append(_events(change))
    return panel("change", *body)


def change_words(change: Change) -> str:
    """All that is changed, in a line."""
    intervention, edit = change.intervention, change.edit
    said = [
        words
        for flag, words in (
            (intervention.without_context, "no transformer"),
            (intervention.uniform_attention, "attention even everywhere"),
            (intervention.without_decoders, "no decoders"),
        )
        if flag
    ]
    said += [f"no scale {resolution(scale)}" for scale in sorted(intervention.removed_scales)]
    said += [f"no skip {resolution(level)}" for level in sorted(intervention.removed_skips)]
    said += [f"memory {resolution(level)} emptied" for level in sorted(intervention.zeroed_levels)]
    said += [f"memory {resolution(level)} frozen" for level in sorted(intervention.frozen_levels)]
    for words, members in (
        ("attention taken out", intervention.removed_sites),
        ("attention made even", intervention.uniform_sites),
        ("head muted", intervention.masked_heads),
    ):
        if members:
            said.append(f"{len(members)} × {words}")
    for share, words in ((edit.drop, "left out"), (edit.invert, "turned"), (edit.jitter, "moved in time")):
        if share:
            said.append(f"{share * 100:.0f} % of the events {words}")
    return " · ".join(said)


def _state(change: Change, index: int) -> str:
    if change.is_nothing:
        return (
            '<div class="et-note">Switch something off below: the image is made again and stands here beside the '
            "original. Nothing is changed now.</div>"
        )
    ahead = ""
    if change.at(index).is_nothing:
        ahead = (
            f'<div class="et-note">It begins at window {count(change.since or 0)}: here the image is original.</div>'
        )
    return (
        f'<div class="et-changed" data-testid="changed"><span>{escape(change_words(change))}</span>'
        f"{button('Put everything back', 'inspect:reset', classes='et-strong')}</div>{ahead}"
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


def _reach(change: Change, index: int) -> str:
    is_carried = change.since is not None
    start = change.since if change.since is not None else index
    content = button("in each window by itself", "inspect:carry:off", is_on=not is_carried) + button(
        f"from window {count(start)} on", "inspect:carry:on", is_on=is_carried
    )
    why = "From a window on: what memory and events were changed to is carried into all later windows."
    return buttons("Reach", content, why)


def _switches(anatomy: Anatomy, intervention: Intervention, site: str) -> list[str]:
    def switch(text: str, part: str, hint: str = "") -> str:
        return button(text, f"inspect:switch:{part}", is_on=is_switched(intervention, part), hint=hint)

    rows: list[str] = []
    if anatomy.scales:
        parts = [switch("transformer (TPA)", "tpa", "Its output is zero; only the skips are left")]
        if anatomy.has_decoders:
            parts.append(switch("decoders", "decoders"))
        if len(anatomy.scales) > 1:
            parts += [switch(f"scale {resolution(scale)}", f"scale {scale}") for scale in anatomy.scales]
        rows.append(buttons("Take away", "".join(parts)))
    if anatomy.skips:
        skips = "".join(switch(resolution(level), f"skip {level}") for level in anatomy.skips)
        rows.append(buttons("Take skip away", skips))
    if anatomy.sites:
        name = site if site in anatomy.sites else anatomy.sites[0]
        even = switch("even everywhere", "uniform", "Every place is read alike, everywhere")
        own = switch("this one out", f"site {name}") + switch("this one even", f"alike {name}")
        rows.append(buttons("All attention", even))
        heads = "".join(switch(str(head + 1), f"head {name} {head}") for head in range(anatomy.num_heads))
        words = f"{site_words(name, anatomy.sites)}. For another, click its map under Attention."
        rows.append(buttons("One attention", f'{own}<span class="et-note">mute head</span>{heads}', words))
    if anatomy.num_levels:
        levels = range(anatomy.num_levels, 0, -1)
        empty = "".join(switch(resolution(level), f"zero {level}") for level in levels)
        freeze = "".join(switch(resolution(level), f"freeze {level}") for level in levels)
        rows.append(buttons("Empty memory", empty))
        rows.append(buttons("Freeze memory", freeze))
    if not anatomy.sites:
        said = f"{anatomy.name} has no attention" + ("" if anatomy.num_levels else " and no ConvLSTM memory to change")
        rows.append(f'<div class="et-note" data-testid="lacks">{escape(said)}.</div>')
    return rows


def _events(change: Change) -> str:
    edit = change.edit
    rows: list[str] = []
    for name, words in (("drop", "Drop events"), ("invert", "Invert them"), ("jitter", "Move in time")):
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

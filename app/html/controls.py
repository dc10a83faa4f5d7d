"""What all inspectors share: buttons, bars, signed pictures, and how far an answer has come."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float32, UInt8

from app.html.elements import ON_PICK, bar, empty, escape, legend, picture
from app.html.moment import PICTURES
from app.html.pictures import ramp_reads
from app.html.units import count, resolution
from etnet.render.colours import OFF, ON, css_gradient, diverge, diverging, hexadecimal
from etnet.render.encode import data_url

VISIBLE = 0.005
"""Of full brightness: a smaller change of a raw frame cannot be seen (1 of 255 grey levels is 0.004)."""
_WIDTH, _HEIGHT = 1000, 120
PERCENTILE = 99.5
"""Of the magnitudes: where the colours of a signed picture end."""


def button(text: str, key: str, *, is_on: bool = False, hint: str = "", classes: str = "") -> str:
    """A button of our own; a click sends `key`."""
    title = f' title="{escape(hint)}"' if hint else ""
    on = " et-on" if is_on else ""
    return (
        f'<button class="et-button{on} {classes}" data-k="{escape(key)}" {ON_PICK}'
        f' aria-pressed="{"true" if is_on else "false"}"{title}>{escape(text)}</button>'
    )


def buttons(title: str, content: str, explanation: str = "") -> str:
    """A row of buttons under its name."""
    note = f'<div class="et-note">{escape(explanation)}</div>' if explanation else ""
    return f'<div class="et-set"><b>{escape(title)}</b><div class="et-chips">{content}</div>{note}</div>'


def percent(value: float, is_signed: bool = True) -> str:
    """Of full brightness: +1.4 %, −0.02 %, 0 %."""
    scaled = 100 * value
    if abs(scaled) < 0.0005:
        return "0 %"
    digits = 0 if abs(scaled) >= 100 else 1 if abs(scaled) >= 1 else 2 if abs(scaled) >= 0.1 else 3
    sign = "" if not is_signed else "+" if scaled > 0 else "−"
    return f"{sign}{abs(scaled):.{digits}f} %"


def part_words(name: str) -> tuple[str, str]:
    """A part of the network, and what was done to it, in words."""
    kind, _, number = name.partition(" ")
    match kind:
        case "TPA":
            return "TPA", "TPA’s output is set to zero"
        case "attention":
            return "Uniform attention", "every token is attended to alike, at every site"
        case "decoders":
            return "Decoders", "the decoders are left out of TPA’s mean"
        case "scale":
            return f"Scale {resolution(int(number))}", "this scale is left out of TPA’s mean"
        case "skip":
            at = "head" if number == "0" else resolution(int(number))
            return f"Skip, {at}", "this skip connection carries nothing"
    return name, ""


def signed_bar(value: float, limit: float) -> str:
    """A bar from the middle to the right (orange, brighter) or to the left (blue, darker)."""
    share = 50 * min(abs(value) / limit, 1.0) if limit > 0 else 0.0
    colour = hexadecimal(ON if value > 0 else OFF)
    left = 50 if value > 0 else 50 - share
    return (
        f'<span class="et-meter"><i style="left:{left:.1f}%;width:{share:.1f}%;background:{colour}"></i><u></u></span>'
    )


def plain_bar(value: float, limit: float) -> str:
    """A bar from the left."""
    share = 100 * min(value / limit, 1.0) if limit > 0 else 0.0
    return f'<span class="et-meter"><i style="left:0;width:{share:.1f}%;background:#d5dae0"></i></span>'


def signed_limit(values: Float32[np.ndarray, "h w"], least: float = VISIBLE) -> float:
    """Where the colours of a signed picture end."""
    return max(float(np.percentile(np.abs(values), PERCENTILE)), least)


def signed_picture(values: Float32[np.ndarray, "h w"], limit: float, alt: str, key: object, marks: str = "") -> str:
    """A signed picture; `key` tells it from all others."""
    url = PICTURES.text(("signed", key, limit), lambda: data_url(diverge(values, limit), is_lossless=True))
    height, width = values.shape
    reads = ramp_reads(diverging(), -100 * limit, 100 * limit, "%")
    return picture(url, alt, key="pixel", size=(width, height), marks=[marks] if marks else [], reads=reads)


def signed_legend(title: str, limit: float, low: str = "darker", high: str = "brighter") -> str:
    """The scale of a signed picture, in percent of full brightness."""
    ends = percent(limit, is_signed=False)
    return legend(title, css_gradient(diverging()), [(0.0, f"≥ {ends} {low}"), (0.5, "0"), (1.0, f"≥ {ends} {high}")])


def grey_picture(grey: UInt8[np.ndarray, "h w"], alt: str, key: object, marks: str = "") -> str:
    """A grey picture; `key` tells it from all others."""
    url = PICTURES.text(("grey picture", key), lambda: data_url(grey, is_lossless=False))
    height, width = grey.shape
    return picture(url, alt, key="pixel", size=(width, height), marks=[marks] if marks else [])


def under_way(share: float, what: str) -> str:
    """How far an answer has come."""
    return f'<div class="et-lag" data-testid="under-way"><span>{escape(what)}</span>{bar(share, waits=not share)}</div>'


def stale_line(shown: int, wanted: int) -> str:
    """Said of an answer that belongs to another window than the current one.

    It does not name the current one: in a drag the inspector would be sent again, pictures and all, for each window.
    """
    if shown == wanted:
        return ""
    return f'<div class="et-lag"><span>shows window {count(shown)}; the current one follows</span></div>'


def choose_pixel(why: str) -> str:
    """What an inspector says that needs a pixel."""
    return empty("Choose a pixel", f"Click into the reconstruction. {why}")


def curves(
    lines: dict[str, Float32[np.ndarray, " windows"]], top: float, above: str, below: str, even: float | None = None
) -> str:
    """Values from 0 to `top` over the windows, oldest left; one line a colour, and a dashed one at `even`."""
    drawn = ""
    if even is not None:
        y = _HEIGHT * (1 - even / top)
        drawn = (
            f'<line x1="0" x2="{_WIDTH}" y1="{y:.1f}" y2="{y:.1f}" stroke="#ffffff99" stroke-dasharray="6 6"'
            ' vector-effect="non-scaling-stroke"></line>'
        )
    for colour, values in lines.items():
        step = _WIDTH / max(len(values) - 1, 1)
        points = " ".join(f"{i * step:.1f},{_HEIGHT * (1 - float(v) / top):.1f}" for i, v in enumerate(values))
        drawn += (
            f'<polyline points="{points}" fill="none" stroke="{colour}" stroke-width="2"'
            ' vector-effect="non-scaling-stroke"></polyline>'
        )
    return (
        f'<div class="et-curve"><span>{escape(above)}</span><svg viewBox="0 0 {_WIDTH} {_HEIGHT}"'
        f' preserveAspectRatio="none">{drawn}</svg><span>{escape(below)}</span></div>'
    )

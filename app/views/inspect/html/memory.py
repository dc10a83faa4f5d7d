"""The recurrent memory: channels of one level, and how far back each pixel remembers, measured."""

from __future__ import annotations

from typing import TYPE_CHECKING, get_args

import numpy as np

from app.html.attention.links import LINK_COLOURS
from app.html.controls import button, buttons, curves, percent, plain_bar
from app.html.elements import escape, legend, marker, panel, picture, swatch
from app.html.moment import PICTURES
from app.html.units import count, of_whole, resolution, short
from app.views.inspect.results import Channels, Norms, Remembered
from app.views.inspect.state import Plane
from etnet.render.colours import counting, css_gradient, diverge, diverging, hexadecimal, sequential
from etnet.render.encode import data_url

if TYPE_CHECKING:
    from etnet.inspection.anatomy import Anatomy

PLANES: dict[Plane, tuple[str, str]] = {
    "hidden": ("hidden", "hidden state: output gate · tanh(cell)"),
    "cell": ("cell", "cell: forget · cell before + input · candidate"),
    "enter": ("input gate", "0 … 1: how much of the candidate comes in"),
    "forget": ("forget gate", "0 … 1: how much of the cell before is kept; alone it does not say what is remembered"),
    "out": ("output gate", "0 … 1: how much of the cell becomes the hidden state"),
    "candidate": ("candidate", "−1 … 1: what could come in"),
}
_GATES = ("enter", "forget", "out")
_WIDTH = 120
_UNKNOWN = (185, 181, 255)
"""Needs more than was tried."""


def channels_html(
    anatomy: Anatomy,
    channels: Channels | None,
    key: object,
    *,
    level: int,
    plane: Plane,
    chosen: int,
    query: tuple[int, int] | None,
) -> str:
    """Which level and which of its planes; one channel large; the others by energy."""
    levels = "".join(
        button(f"{resolution(each)}", f"set:inspect.level:{each}", is_on=each == level)
        for each in sorted(anatomy.levels, reverse=True)
    )
    planes = "".join(
        button(PLANES[word][0], f"set:inspect.plane:{word}", is_on=word == plane) for word in get_args(Plane)
    )
    head = buttons("Level at", levels) + buttons("Show", planes, PLANES[plane][1])
    if channels is None:
        return panel("channels", head)
    chosen = min(chosen, len(channels.values) - 1)
    limit = _limit(channels)
    large = PICTURES.text(("channel", key, chosen), lambda: _url(channels, chosen, limit, None))
    rows, columns = channels.values.shape[1:]
    marks = []
    if query is not None:
        unit = 2**channels.level
        # The padded map: what is left and above of the sensor is at most half a token, too little to tell here.
        marks = [marker((query[0] + 0.5) / (columns * unit), (query[1] + 0.5) / (rows * unit))]
    image = picture(large, f"channel {channels.order[chosen]}", size=(columns, rows), marks=marks, classes="et-sharp")
    what = (
        f'<div class="et-caption" data-testid="channel"><span>channel <b>{channels.order[chosen]}</b> of '
        f"{count(channels.num_channels)}, no. {chosen + 1} by energy</span>"
        f"<span>energy <b>{short(float(channels.energy[chosen]))}</b></span></div>"
    )
    cells = []
    for number in range(len(channels.values)):
        url = PICTURES.text(("channel tile", key, number), lambda number=number: _url(channels, number, limit, _WIDTH))
        on = " et-chosen" if number == chosen else ""
        tile = picture(
            url, f"channel {channels.order[number]}", key=f"set:inspect.channel:{number}",
            size=(columns, rows),
        )  # fmt: skip
        cells.append(f'<div class="et-thumb{on}">{tile}<span class="et-label">{channels.order[number]}</span></div>')
    grid = f'<div class="et-four">{"".join(cells)}</div>'
    note = f"the {len(cells)} channels of most energy (mean square), of {count(channels.num_channels)}; click one"
    return panel("channels", head, image, what, _scale(channels, limit), grid, f'<div class="et-note">{note}</div>')


def norms_html(norms: Norms) -> str:
    """How strong each level's memory was after each of the last windows."""
    hues = [hexadecimal(LINK_COLOURS[level + 1]) for level in range(norms.hidden.shape[1])]
    parts = [f"<h4>State norms over the last {len(norms.indices)} windows</h4>"]
    keys = "".join(
        swatch(hue, f"{resolution(level + 1)}: now {short(float(norms.cell[-1, level]))} cell, "
        f"{short(float(norms.hidden[-1, level]))} hidden") for level, hue in enumerate(hues)
    )  # fmt: skip
    for words, values in (("cell", norms.cell), ("hidden", norms.hidden)):
        top = max(float(values.max()) * 1.1, 1e-6)
        lines = {hue: values[:, level] for level, hue in enumerate(hues)}
        parts.append(curves(lines, top, f"{words}, root mean square: up to {short(top)}", "0"))
    return panel("norms", *parts, f'<div class="et-swatches" data-testid="norms-now">{keys}</div>')


def remembered_html(found: Remembered, key: object, query: tuple[int, int] | None) -> str:
    """A map of how many windows each pixel needs, and the mean error of each depth."""
    height, width = found.needed.shape
    deepest = found.depths[-1]

    def make() -> str:
        level = np.log2(1 + found.needed.clip(0)) / np.log2(1 + max(deepest, 1))
        colours = sequential()[np.rint(level.clip(0, 1) * 255).astype(np.uint8)]
        colours[found.needed < 0] = _UNKNOWN
        return data_url(colours, is_lossless=True)

    marks = [marker((query[0] + 0.5) / width, (query[1] + 0.5) / height)] if query else []
    url = PICTURES.text(("remembered", key, found.depths), make)
    image = picture(url, "windows of memory each pixel needs", key="pixel", size=(width, height), marks=marks)
    ticks = [(float(np.log2(1 + depth) / np.log2(1 + max(deepest, 1))), f"{depth}") for depth in found.depths]
    scale = legend("windows of memory that are needed", css_gradient(sequential()), ticks)
    more = float((found.needed < 0).mean())
    here = ""
    if query is not None:
        needs = int(found.needed[query[1], query[0]])
        words = f"more than {deepest} windows" if needs < 0 else "no window" if needs == 0 else f"{needs} windows"
        here = f"Pixel ({query[0]}, {query[1]}) needs {words.replace('1 windows', '1 window')} before this one."
    lead = (
        "Measured, not read off the gates: the network is started cold so many windows earlier, and a pixel counts as "
        f"remembered once it stays within {percent(found.tolerance, is_signed=False)} of the image with all memory."
    )
    largest = max(found.mean_absolute)
    rows = "".join(
        f'<span class="et-note">{depth} window{"" if depth == 1 else "s"} before</span>'
        f'<span class="et-measure">{plain_bar(apart, largest)}<b>{percent(apart, is_signed=False)}</b></span>'
        for depth, apart in zip(found.depths, found.mean_absolute, strict=True)
    )
    return panel(
        "remembered",
        f'<div class="et-note">{escape(lead)}</div>',
        image,
        scale,
        f'<div class="et-say" data-testid="needs">{here}</div>' if here else "",
        f'<div class="et-note">violet: {of_whole(more)} of the image needs more than {deepest}</div>',
        "<h4>Mean error with so little memory</h4>",
        f'<div class="et-table et-two">{rows}</div>',
    )


def _limit(channels: Channels) -> float:
    """Where the colours of all channels of the plane end; gates run from 0 to 1."""
    if channels.plane in _GATES:
        return 1.0
    return max(float(np.percentile(np.abs(channels.values), 99.5)), 1e-6)


def _url(channels: Channels, number: int, limit: float, width: int | None) -> str:
    values = channels.values[number]
    if width is not None and values.shape[1] > width:
        step = -(-values.shape[1] // width)
        values = values[::step, ::step]
    if channels.plane in _GATES:
        return data_url(counting()[np.rint(values.clip(0, 1) * 255).astype(np.uint8)], is_lossless=True)
    return data_url(diverge(values, limit), is_lossless=True)


def _scale(channels: Channels, limit: float) -> str:
    words = PLANES[channels.plane][0]  # pyright: ignore[reportArgumentType]  a word of `Plane`
    if channels.plane in _GATES:
        return legend(words, css_gradient(counting()), [(0.0, "0"), (0.5, "1/2"), (1.0, "1")])
    ends = short(limit)
    return legend(words, css_gradient(diverging()), [(0.0, f"≤ −{ends}"), (0.5, "0"), (1.0, f"≥ +{ends}")])

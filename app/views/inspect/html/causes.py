"""Where a pixel comes from, since when, what a change does from there on, and how sure the frame is."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from app.html.attention.changed import change_words, since_words
from app.html.chart import Line, chart
from app.html.controls import (
    button,
    buttons,
    choose_pixel,
    grey_picture,
    percent,
    signed_limit,
    signed_picture,
)
from app.html.elements import escape, legend, marker, panel, picture
from app.html.moment import PICTURES, Moment
from app.html.pictures import Tones, event_picture
from app.html.units import count, seconds
from app.views.inspect.html.overview import level_words, stage_words
from app.views.inspect.results import CauseFound, SpreadFound, TwinFound
from app.views.inspect.state import Change, InspectState
from etnet.render.colours import css_gradient, sequential
from etnet.render.encode import data_url
from etnet.render.events import EventStyle
from etnet.render.tone import tone_map

if TYPE_CHECKING:
    from etnet.inspection.anatomy import Anatomy
    from etnet.inspection.sources import Sources

STAGES = {"events": "events now", "bins": "voxel bins", "memory": "state before", "scales": "TPA", "skips": "skips"}
WIDEST = 16.0
"""Pixels of the widest line."""
TOLERANCES = (10, 20, 50, 100)
"""Thousandths of full brightness that are offered for a causal search."""
RECOVERED = 0.02
_ROW, _WIDTH = 19, 320


def sources_html(figure: Sources | None, anatomy: Anatomy | None = None) -> str:
    """A line from each part to the pixel, as wide as what the pixel loses without it."""
    lead = (
        "Each part is ablated alone and the step is made again: a line is as wide as the pixel moves. Parts can stand "
        "in for each other, so widths do not add up."
    )
    head = f'<div class="et-note">{lead}</div>'
    if figure is None or not figure.parts:
        return panel("sources", head)
    largest = max(max(abs(part.at_pixel) for part in figure.parts), 1e-6)
    rows: list[tuple[float, str, float]] = []
    y, labels = 14.0, ""
    for stage, words in STAGES.items():
        parts = figure.of(stage)  # pyright: ignore[reportArgumentType]  a word of `Stage`
        if not parts:
            continue
        labels += f'<text x="8" y="{y:.0f}" style="fill:var(--text);font-weight:600">{words}</text>'
        y += _ROW
        for part in parts:
            rows.append((y, part.name, part.at_pixel))
            y += _ROW
        y += 6
    middle = y / 2
    drawn = ""
    for at, name, value in rows:
        width = WIDEST * abs(value) / largest
        signed, words = percent(value), escape(stage_words(name, anatomy))
        drawn += (
            f'<g><title>{words}: {signed}</title><path fill="none"'
            f' d="M150 {at - 4:.0f} C 220 {at - 4:.0f}, 230 {middle:.0f}, 292 {middle:.0f}"'
            f' stroke="var(--accent)" stroke-opacity="0.55" stroke-width="{max(width, 0.3):.2f}"'
            f' data-testid="source"/></g>'
            f'<text x="16" y="{at:.0f}">{words}</text>'
            f'<text x="146" y="{at:.0f}" text-anchor="end">{signed}</text>'
        )
    pixel = (
        f'<circle cx="298" cy="{middle:.0f}" r="6" fill="#fff"></circle>'
        f'<text x="298" y="{middle + 22:.0f}" text-anchor="middle">{percent(figure.value, is_signed=False)}</text>'
    )
    svg = f'<svg viewBox="0 0 {_WIDTH} {y:.0f}" role="img" aria-label="pixel sources">{drawn}{labels}{pixel}</svg>'
    note = "without − with, of full brightness; state before counts what earlier windows gave"
    return panel("sources", head, f'<div class="et-sources">{svg}</div><div class="et-note">{note}</div>')


def search_html(
    found: CauseFound | None,
    is_whole: bool,
    slice_: InspectState,
    moment: Moment,
    anatomy: Anatomy | None,
    style: EventStyle,
) -> str:
    """The window that the pixel rests on, its time and events, and the twin that shows it."""
    lead = (
        "The state is zeroed once, before one window. Zeroed late, it changes the pixel; zeroed early enough, the "
        "network recovers. Between the two lies a window whose events the pixel rests on."
    )
    body = f'<div class="et-note">{lead}</div>{_asked(slice_, anatomy)}'
    if found is None or not found.search.trials:
        return panel("search", body)
    search = found.search
    tried = " · ".join(
        f"{trial.at} {'changed' if trial.changes else 'unchanged'}"
        for trial in sorted(search.trials, key=lambda trial: trial.at)
    )
    body += f'<div class="et-say" data-testid="cause">{escape(_found(found, is_whole))}</div>'
    if search.changes_at is not None and is_whole:
        levels = ",".join(map(str, sorted(search.levels)))
        entered, shown = search.entered_at, ""
        if entered is not None:
            window = moment.windows[entered]
            at = (window.t_stop - moment.recording.span.start) / 1e6
            shown = button(f"Go to window {count(entered)}", f"goto:{at:.6f}")
            body += _entered(replace(moment, index=entered), search.pixel, style)
        twin = button("Effect over time of that reset", f"inspect:twin:{search.changes_at}:{levels}")
        body += f'<div class="et-chips">{shown}{twin}</div>'
    return panel("search", body, f'<div class="et-note">The pixel after a reset before window {tried}</div>')


def _asked(slice_: InspectState, anatomy: Anatomy | None) -> str:
    """Which state is zeroed, what the pixel should be, and by how much it has to change."""
    choices = ""
    if anatomy is not None and len(anatomy.levels) > 1:
        words = {"all": "all levels"} | {str(level): level_words(anatomy, level) for level in anatomy.levels}
        choices += buttons(
            "Zero the state of",
            "".join(
                button(said, f"set:inspect.zeroes:{which}", is_on=which == slice_.zeroes)
                for which, said in words.items()
            ),
        )
    towards = {"any": "anything else", "camera": "as the camera saw it", "value": f"{slice_.wanted} %"}
    content = "".join(
        button(said, f"set:inspect.towards:{which}", is_on=which == slice_.towards) for which, said in towards.items()
    )
    if slice_.towards == "value":
        content += (
            f'<input type="range" min="0" max="100" step="5" value="{slice_.wanted}" data-set="set:inspect.wanted"'
            ' aria-label="Brightness that the pixel should have, per cent">'
        )
    choices += buttons("The pixel should be", content)
    by = "".join(
        button(f"{each / 10:g} %", f"set:inspect.tolerance:{each}", is_on=each == slice_.tolerance)
        for each in TOLERANCES
    )
    why = "of full brightness: from there on the pixel counts as changed"
    if slice_.towards != "any":
        why = "of full brightness nearer to that: from there on the pixel counts as changed"
    return choices + buttons("Changed by", by, why)


def _entered(moment: Moment, pixel: tuple[int, int], style: EventStyle) -> str:
    """The events of the window that was found, as a picture with the pixel."""
    image, _ = event_picture(moment, style)
    height, width = image.level.shape
    url = PICTURES.text(("entered", moment.key, style), lambda: data_url(image, is_lossless=True))
    marks = [marker((pixel[0] + 0.5) / width, (pixel[1] + 0.5) / height)]
    shown = picture(url, f"events of window {moment.index}", key="pixel", size=(width, height), marks=marks)
    stop = moment.seconds[1]
    words = f"window {count(moment.index)}: {count(moment.window.num_events)} events, until {seconds(stop)}"
    return f'<div data-testid="entered">{shown}</div><div class="et-note">{words}</div>'


def _found(found: CauseFound, is_whole: bool) -> str:
    search = found.search
    if not is_whole:
        return f"{len(search.trials)} reset{'' if len(search.trials) == 1 else 's'} tried so far."
    so = "changes it" if found.towards is None else f"brings it nearer to {percent(found.towards, is_signed=False)}"
    if search.changes_at is None:
        rest = "it does not rest on the memory." if found.towards is None else "its memory is not what is wrong."
        return f"No reset of the state {so} by so much: {rest}"
    if search.entered_at is None:
        return f"Even a reset {search.index - search.first} windows earlier {so}: it rests on something older."
    ago = search.index - search.entered_at
    return f"It rests on window {count(search.entered_at)}, {ago} window{'' if ago == 1 else 's'} earlier."


def twin_html(
    found: TwinFound | None,
    key: object,
    change: Change,
    moment: Moment,
    query: tuple[int, int] | None,
    tones: Tones,
    anatomy: Anatomy | None,
) -> str:
    """The curve of the difference, which can be clicked, and both frames of the current window side by side."""
    if change.is_nothing:
        return panel("twin", _nothing_changed(moment, anatomy))
    since = change.since if found is None else found.indices[0]  # what holds in each window by itself is run on, too
    words = f"{change_words(change.intervention, change.edit)} · {since_words(since, change.once)}"
    head = (
        f'<div class="et-changed" data-testid="changed"><span>{escape(words)}</span>'
        f"{button('Reset all', 'inspect:reset', classes='et-strong')}</div>"
    )
    if found is None:
        return panel("twin", head)
    image = found.on_image
    here = np.abs(found.at(query)) if query is not None else None
    pair = _pair(found, (key, moment.index), moment, tones)
    return panel("twin", head, _curve(found, image, here, moment), pair, _recovered(found))


def _nothing_changed(moment: Moment, anatomy: Anatomy | None) -> str:
    """What can be changed: events of every network, and the state of each level that this one has."""
    if anatomy is None:
        return '<div class="et-note">Nothing is changed.</div>'
    levels = anatomy.levels
    if not levels:
        lead = "Nothing is changed. Change its events under Intervention: this network names no state to be zeroed."
        return f'<div class="et-note">{lead}</div>'
    words = {",".join(map(str, levels)): "all levels"} if len(levels) > 1 else {}
    words |= {str(level): level_words(anatomy, level) for level in levels}
    zero = "".join(button(said, f"inspect:twin:{moment.index}:{which}") for which, said in words.items())
    lead = "Nothing is changed. Change something under Intervention or in Attention, or zero the state once, here:"
    return f'<div class="et-note">{lead}</div>{buttons("Zero state", zero)}'


def _curve(found: TwinFound, image: np.ndarray, here: np.ndarray | None, moment: Moment) -> str:
    start = moment.recording.span.start
    times = [(stamp - start) / 1e6 for stamp in found.stamps]
    top = max(float(image.max()), 0.0 if here is None else float(here.max()), 1e-6)
    lines = [Line(image.tolist())] + ([] if here is None else [Line(here.tolist(), is_loud=True)])
    place = found.indices.index(moment.index) if moment.index in found.indices else None
    words = "mean |difference| of the image" + (", and of this pixel (violet)" if here is not None else "")
    drawn = chart(times, lines, (0.0, top), percent(top, is_signed=False), index=place, testid="twin-curve")
    return f'{drawn}<div class="et-note">{words}</div>'


def _pair(found: TwinFound, key: object, moment: Moment, tones: Tones) -> str:
    index = moment.index
    if index not in found.indices:
        first, last = found.indices[0], found.indices[-1]
        at = (found.stamps[0] - moment.recording.span.start) / 1e6
        goes = button(f"Go to window {count(first)}", f"goto:{at:.6f}")
        words = f"Both runs are compared in windows {count(first)} to {count(last)}."
        return f'<div class="et-note">{words}</div><div class="et-chips">{goes}</div>'
    place = found.indices.index(index)
    original, changed = found.original[place], found.changed[place]
    apart = changed - original
    limit = signed_limit(apart)
    pictures = (
        (
            "original",
            grey_picture(tone_map(original, tones.tone, tones.is_linear_light), "original", (key, "o", tones)),
        ),
        ("changed", grey_picture(tone_map(changed, tones.tone, tones.is_linear_light), "changed", (key, "c", tones))),
        ("difference", signed_picture(apart, limit, "changed − original", (key, "d"))),
    )
    cells = "".join(
        f'<figure class="et-thumb">{image}<figcaption class="et-label">{words}</figcaption></figure>'
        for words, image in pictures
    )
    return f'<div class="et-three" data-testid="twin-pair">{cells}</div>'


def _recovered(found: TwinFound) -> str:
    at = found.recovered_at(RECOVERED)
    if at is None:
        return f'<div class="et-say" data-testid="recovered">Not recovered by window {found.indices[-1]}.</div>'
    if at == found.indices[0]:
        said = f"No pixel is ever further off than {percent(RECOVERED, is_signed=False)}."
    else:
        said = f"Recovered from window {at} on: no pixel further off than {percent(RECOVERED, is_signed=False)}."
    return f'<div class="et-say" data-testid="recovered">{said}</div>'


def spread_html(found: SpreadFound | None, key: object, query: tuple[int, int] | None) -> str:
    """The standard deviation over draws as a map, and what the camera says to it."""
    lead = (
        "A fifth of the recent events is left out at random, several times. Where frames differ, they rest on single "
        "events."
    )
    head = f'<div class="et-note">{lead}</div>'
    if found is None or found.num_done < 2:
        return panel("spread", head)
    image = _deviation(found.deviation, ("spread", key, found.num_done), "standard deviation", query)
    told = _told(found.pearson, found.spearman) if found.num_done == found.num_seeds else ""
    draws = f"{found.num_done} draws, from window {count(found.since)} on."
    said = f"{_here(found.deviation, query)}{draws} {told}"
    parts = [head, image, f'<div class="et-say" data-testid="spread-said">{escape(said)}</div>']
    if found.own is not None:
        parts += _own(found, key, query)
    return panel("spread", *parts)


def _own(found: SpreadFound, key: object, query: tuple[int, int] | None) -> tuple[str, ...]:
    """What the network itself says of each pixel's uncertainty."""
    own = found.own
    assert own is not None
    told = _told(own.pearson, own.spearman) if found.num_done == found.num_seeds else ""
    lead = "This network estimates a variance with each frame; shown is its square root."
    return (
        f'<h4>The network’s own estimate</h4><div class="et-note">{lead}</div>',
        _deviation(own.deviation, ("own spread", key), "standard deviation, the network’s own", query),
        f'<div class="et-say" data-testid="own-said">{escape(_here(own.deviation, query) + told)}</div>',
    )


def _deviation(values: np.ndarray, key: object, name: str, query: tuple[int, int] | None) -> str:
    """A picture from 0 to the 99.5th percentile, and its legend."""
    height, width = values.shape
    limit = max(float(np.percentile(values, 99.5)), 1e-4)

    def make() -> str:
        level = np.rint((values / limit).clip(0, 1) * 255).astype(np.uint8)
        return data_url(sequential()[level], is_lossless=True)

    marks = [marker((query[0] + 0.5) / width, (query[1] + 0.5) / height)] if query else []
    image = picture(PICTURES.text(key, make), name, key="pixel", size=(width, height), marks=marks)
    return image + legend(name, css_gradient(sequential()), [(0.0, "0"), (1.0, f"≥ {percent(limit, is_signed=False)}")])


def _here(values: np.ndarray, query: tuple[int, int] | None) -> str:
    return "" if query is None else f"This pixel: {percent(float(values[query[1], query[0]]), is_signed=False)}. "


def _told(pearson: float | None, spearman: float | None) -> str:
    if pearson is None or spearman is None:
        return "No camera frame at this moment, so its error is not known."
    return f"Correlation with the error: Pearson {pearson:.2f}, Spearman {spearman:.2f}."


def pixel_first(opened: str) -> str:
    """What an inspector of one pixel says before one is chosen."""
    words = {
        "sources": "Every part of the network is then ablated alone, for that pixel.",
        "search": "The window that it rests on is then found by bisection.",
    }
    return panel(opened, choose_pixel(words[opened]))

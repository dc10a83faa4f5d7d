"""The few pieces of HTML that all panels are built of. Every text that comes from outside passes `escape`."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from html import escape

ON_PICK = 'data-pick="1"'
"""The attribute that makes an element of `data-k` clickable."""
__all__ = [
    "ON_PICK", "bar", "card", "chip", "empty", "escape", "icon", "icon_button", "legend", "marker", "number_field",
    "panel", "picture", "segmented", "select", "swatch",
]  # fmt: skip


def panel(name: str, *parts: str, style: str = "") -> str:
    """One panel's content. `name` is its test id and class."""
    css = f' style="{style}"' if style else ""
    return f'<div class="et et-{name}" data-testid="{name}"{css}>{"".join(parts)}</div>'


def picture(
    url: str,
    alt: str,
    *,
    key: str = "",
    marks: Iterable[str] = (),
    classes: str = "",
    size: tuple[int, int] | None = None,
    area: tuple[int, int, int, int] | None = None,
    style: str = "",
    reads: str = "",
) -> str:
    """An image in a frame. A click on it sends `key` (`data-k`), if there is one.

    `size` (width, height) keeps its place before it is decoded; `marks` lie over it and never take a click. `area` (x,
    y, width, height) is what it shows of the sensor, where its own pixels are not the sensor's. `reads` says what a
    colour stands for (`app.html.pictures`): the browser then tells the value under the pointer.
    """
    measures = f' width="{size[0]}" height="{size[1]}"' if size else ""
    shown = f' data-area="{",".join(map(str, area))}"' if area else ""
    picking = f' data-k="{escape(key)}" {ON_PICK}' if key else ""
    ratio = f"--ratio:{size[0] / size[1]:.4f};" if size else ""
    css = f' style="{ratio}{style}"' if ratio or style else ""
    pickable = " et-pick" if key else ""
    values = f' data-reads="{escape(reads)}"' if reads else ""
    return (
        f'<span class="et-picture{pickable} {classes}"{css}{values}>'
        f'<img src="{url}" alt="{escape(alt)}"{measures}{shown}{picking} draggable="false">{"".join(marks)}</span>'
    )


def marker(x: float, y: float) -> str:
    """A cross at fractions (x, y) of the picture."""
    return f'<i class="et-cross" data-testid="query" style="--u:{x:.4f};--v:{y:.4f}"></i>'


def legend(title: str, gradient: str, ticks: Sequence[tuple[float, str]]) -> str:
    """A colour scale with numbers under it: ticks are (fraction, text)."""
    labels = "".join(f'<span class="{_side(at)}" style="left:{at:.2%}">{escape(text)}</span>' for at, text in ticks)
    return (
        f'<div class="et-legend"><div class="et-legend-title">{escape(title)}</div>'
        f'<div class="et-legend-bar" style="background:{gradient}"></div>'
        f'<div class="et-legend-ticks">{labels}</div></div>'
    )


def _side(at: float) -> str:
    return "et-tick-first" if at <= 0.02 else "et-tick-last" if at >= 0.98 else "et-tick"


def swatch(colour: str, text: str) -> str:
    """A dot of one colour and what it means."""
    return f'<span class="et-swatch"><i style="background:{colour}"></i>{escape(text)}</span>'


def chip(text: str, kind: str, title: str = "") -> str:
    """A small badge; `kind` is exact, warning, problem or plain."""
    hint = f' title="{escape(title)}"' if title else ""
    return f'<span class="et-chip et-{kind}" data-testid="chip-{kind}"{hint}>{escape(text)}</span>'


def bar(share: float, waits: bool = False) -> str:
    """How far something is, 0 … 1. One that `waits` wanders: nobody knows how far it is."""
    return f'<div class="et-bar{" et-bar-wait" if waits else ""}"><i style="width:{share:.0%}"></i></div>'


def empty(headline: str, explanation: str) -> str:
    """What a panel says when it has nothing to show, and why."""
    return (
        f'<div class="et-empty" data-testid="empty"><strong>{escape(headline)}</strong>'
        f"<span>{escape(explanation)}</span></div>"
    )


def card(
    name: str, title: str, body: str, areas: Mapping[str, str], *, note: str = "", tools: str = "", classes: str = ""
) -> str:
    """`body` in a frame that stands where `areas` says; nothing where it says nothing. `note` may be HTML."""
    area = areas.get(name, "")
    if not area:
        return f'<section class="etv-card" data-card="{escape(name)}" hidden></section>'
    stage = "" if area in ("a", "b", "stage") else icon_button(f"stage:{name}", "expand", "Show large on the stage")
    return (
        f'<section class="etv-card etv-{"shelf" if stage else "staged"} {classes}" data-card="{escape(name)}"'
        f' style="grid-area:{area}"><header><h3>{escape(title)}</h3><span class="etv-note">{note}</span>'
        f'<span class="etv-tools">{tools}{stage}</span></header><div class="etv-body">{body}</div></section>'
    )


def icon_button(key: str, name: str, title: str, *, is_on: bool = False) -> str:
    """A button that is an icon; its words are for those who point at it, or hear the page."""
    on = " etv-on" if is_on else ""
    return (
        f'<button class="etv-icon{on}" data-k="{escape(key)}" {ON_PICK} title="{escape(title)}"'
        f' aria-label="{escape(title)}" aria-pressed="{"true" if is_on else "false"}">{icon(name)}</button>'
    )


def segmented(label: str, options: Mapping[str, str], chosen: str) -> str:
    """One choice of a few: `options` are words by the key that a click sends; `chosen` is the key that holds."""
    buttons = "".join(
        f'<button data-k="{escape(key)}" {ON_PICK} aria-pressed="{"true" if key == chosen else "false"}"'
        f"{' class=etv-on' if key == chosen else ''}>{escape(words)}</button>"
        for key, words in options.items()
    )
    return f'<span class="etv-segmented" role="group" aria-label="{escape(label)}">{buttons}</span>'


def select(label: str, key: str, options: Mapping[str, str], chosen: str, *, classes: str = "", off: str = "") -> str:
    """One choice of many: `options` are words by value; a choice sends `key:value`. `off` cannot be chosen."""
    rows = "".join(
        f'<option value="{escape(value)}"{" selected" if value == chosen else ""}'
        f"{' disabled' if value == off else ''}>{escape(words)}</option>"
        for value, words in options.items()
    )
    return (
        f'<select class="etv-select {classes}" data-set="{escape(key)}" aria-label="{escape(label)}"'
        f' title="{escape(label)}">{rows}</select>'
    )


def number_field(label: str, key: str, value: float, step: float) -> str:
    """A number above 0 that is typed; Enter or leaving it sends `key:value`."""
    return (
        f'<input type="number" class="etv-number" data-set="{escape(key)}" value="{value:g}" min="0" step="{step:g}"'
        f' aria-label="{escape(label)}" title="{escape(label)}">'
    )


_ICONS = {
    "search": '<circle cx="7" cy="7" r="4.2"/><path d="M10.3 10.3 14 14"/>',
    "link": (
        '<path d="M6.6 9.4 9.4 6.6M7.2 4.6l.9-.9a2.9 2.9 0 0 1 4.2 4.2l-.9.9"/>'
        '<path d="M8.8 11.4l-.9.9a2.9 2.9 0 0 1-4.2-4.2l.9-.9"/>'
    ),
    "download": '<path d="M8 2.500v7.500M4.8 7 8 10.2 11.2 7M3 13.500h10"/>',
    "help": ('<circle cx="8" cy="8" r="6"/><path d="M6.3 6.3a1.8 1.8 0 1 1 2.5 1.7c-.6.3-.8.6-.8 1.2M8 11.3v.1"/>'),
    "expand": '<path d="M2.5 6V2.500H6M10 2.500h3.500V6M13.5 10v3.500H10M6 13.500H2.500V10"/>',
    "first": '<path d="M4 3v10M13 3 6.5 8l6.5 5z"/>',
    "previous": '<path d="M11.5 3 5 8l6.5 5z"/>',
    "next": '<path d="M4.5 3 11 8l-6.5 5z"/>',
    "last": '<path d="M12 3v10M3 3l6.5 5L3 13z"/>',
    "play": '<path d="M5 3v10l8-5z" fill="currentColor"/>',
    "pause": '<path d="M5 3v10M11 3v10" stroke-width="3"/>',
    "loop": '<path d="M3 8a4 4 0 0 1 4-4h5M10 2l2 2-2 2M13 8a4 4 0 0 1-4 4H4M6 14l-2-2 2-2"/>',
    "swipe": '<path d="M8 2v12M2.5 4.500H6v7H2.500zM10 4.500h3.500v7H10z"/>',
    "cube": '<path d="M8 2 13.5 5v6L8 14 2.5 11V5zM2.5 5 8 8l5.5-3M8 8v6"/>',
    "front": '<rect x="3" y="4" width="10" height="8" rx="1"/>',
    "side": '<path d="M5 3v10M11 3v10M5 8h6"/>',
    "info": '<circle cx="8" cy="8" r="6"/><path d="M8 7.3v4M8 4.800v.1"/>',
    "close": '<path d="M4 4l8 8M12 4l-8 8"/>',
    "code": '<path d="M5.5 4.5 2.5 8l3 3.500M10.5 4.500l3 3.5-3 3.5"/>',
    "variance": '<path d="M8 2.500v6M5 5.500h6M4 13h8"/>',
    "dots": (
        '<circle cx="4" cy="11.500" r="1.500"/><circle cx="8.500" cy="7" r="2.200"/>'
        '<circle cx="12.500" cy="3.500" r="1"/><circle cx="12" cy="11.500" r="1.200"/>'
    ),
    "table": '<path d="M2.5 3.500h11v9h-11zM2.5 6.500h11M2.5 9.500h11M6 3.500v9"/>',
    "pin": '<path d="M8 9.500V14M5 9.500h6L10 6V2.500H6V6z"/>',
}


def icon(name: str) -> str:
    """An icon as SVG."""
    return (
        '<svg viewBox="0 0 16 16" aria-hidden="true" fill="none" stroke="currentColor" stroke-width="1.5"'
        f' stroke-linecap="round" stroke-linejoin="round">{_ICONS[name]}</svg>'
    )

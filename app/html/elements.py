"""The few pieces of HTML that all panels are built of. Every text that comes from outside passes `escape`."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from html import escape

ON_PICK = 'data-pick="1"'
"""The attribute that makes an element of `data-k` clickable."""
__all__ = ["ON_PICK", "bar", "chip", "empty", "escape", "legend", "marker", "panel", "picture", "swatch"]


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
    style: str = "",
    reads: str = "",
) -> str:
    """An image in a frame. A click on it sends `key` (`data-k`), if there is one.

    `size` (width, height) keeps its place before it is decoded; `marks` lie over it and never take a click. `reads`
    says what a colour stands for (`app.html.reads`): the browser then tells the value under the pointer.
    """
    measures = f' width="{size[0]}" height="{size[1]}"' if size else ""
    picking = f' data-k="{escape(key)}" {ON_PICK}' if key else ""
    ratio = f"--ratio:{size[0] / size[1]:.4f};" if size else ""
    css = f' style="{ratio}{style}"' if ratio or style else ""
    pickable = " et-pick" if key else ""
    values = f' data-reads="{escape(reads)}"' if reads else ""
    return (
        f'<span class="et-picture{pickable} {classes}"{css}{values}>'
        f'<img src="{url}" alt="{escape(alt)}"{measures}{picking} draggable="false">{"".join(marks)}</span>'
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

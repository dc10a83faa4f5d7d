"""A card: one picture of the page with its name, a note and small buttons."""

from __future__ import annotations

from collections.abc import Mapping

from app.html.elements import ON_PICK, escape
from app.html.icons import icon


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

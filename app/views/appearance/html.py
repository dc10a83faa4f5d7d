"""The bar: brand, recording, workspaces, provenance, help; and how pictures are drawn."""

from __future__ import annotations

from app.catalogue.recording_id import listed_id
from app.html.attention.changed import change_words, since_words
from app.html.elements import ON_PICK, escape, icon, icon_button, segmented
from app.html.provenance import all_facts_html, provenance_html
from app.state.view_state import Workspace
from app.views.demo.state import DemoState
from app.views.events.state import EventsState
from app.views.inspect.state import NO_CHANGE, InspectState
from app.views.page import Page
from app.views.reconstruction.state import ReconstructionState
from etnet.render.events import EventStyle
from etnet.render.tone import Tone

WORKSPACES: dict[Workspace, str] = {
    "inspect": "Inspect",
    "attention": "Attention",
    "compare": "Compare",
    "recording": "Recording",
    "demo": "Demo",
}
"""In the order of the keys 1 … 5."""
TONES: dict[Tone, str] = {
    "auto": "default",
    "raw": "linear",
    "robust": "1–99 %",
    "gamma": "gamma 2.2",
    "hdr": "auto HDR",
    "clahe": "CLAHE",
}
"""Tone mapping: of the network by default, or as a visitor chooses."""
STYLES: dict[EventStyle, str] = {
    "polarity": "polarity",
    "count": "count",
    "time surface": "time surface",
    "decay": "decay",
}
_BRAND = '<span class="etv-brand"><img src="/static/icon.svg" alt="" width="24" height="24">ET-Net</span>'
_COPY = (
    '<button class="etv-icon" data-etv-copy title="Copy a link to this moment (C)" aria-label="Copy link">{}</button>'
)


def bar_html(page: Page) -> str:
    """What stands above every page; it also carries the marks by which style sheet and script know the page."""
    state = page.state
    mark = f'<i data-etv-workspace="{state.workspace}" data-etv-moment="{page.link}"></i>'
    if state.is_public:
        act = state.of(DemoState).act
        return f'<header class="etv-bar">{mark}<i data-etv-public="{act}"></i></header>'
    keys = {f"workspace:{name}": words for name, words in WORKSPACES.items()}
    switch = segmented("Workspace", keys, f"workspace:{state.workspace}")
    facts = f'<span class="et-note">{escape(page.trouble)}</span>' if page.trouble else ""
    more = ""
    if page.moment is not None:
        known = page.moment, page.model, page.ready, page.step_milliseconds
        facts = provenance_html(*known)
        info = f'<button class="etv-icon" title="All of it" aria-label="Facts of this frame">{icon("info")}</button>'
        more = f'<span class="etv-all" data-testid="all-facts">{info}<dl>{all_facts_html(*known)}</dl></span>'
    changed = change_chip(page)
    if page.presenting:
        changed += f'<span class="et-chip et-exact" data-testid="presenting">{escape(page.presenting)}</span>'
    if page.refused:
        facts = f'<span class="et-failed" role="alert" data-testid="refused">{escape(page.refused)}</span>'
    tools = (
        _COPY.format(icon("link"))
        + icon_button("tab:export", "download", "Export")
        + icon_button("help", "help", "Shortcuts and glossary (?)")
    )
    return (
        f'<header class="etv-bar">{mark}{_BRAND}{recordings_html(page)}{switch}{changed}'
        f'{more}<span class="etv-facts">{facts}</span><span class="etv-right">{tools}</span></header>'
    )


def change_chip(page: Page) -> str:
    """What is changed on purpose, by name and since which window; a click shows it. Nothing while nothing is."""
    inspected = page.state.of(InspectState)
    change = inspected.change
    if change is NO_CHANGE or change.is_nothing:
        return ""
    words = f"{change_words(change.intervention, change.edit)} · {since_words(change.since, change.once)}"
    if inspected.shows_original:
        said = "original, while x is held"
        return f'<span class="et-chip et-exact" data-etv-original="1" title="{escape(words)}">{said}</span>'
    return (
        f'<button class="et-chip et-warning etv-changed" data-k="set:inspect.opened:change" {ON_PICK}'
        f' data-testid="change-in-bar" title="{escape(words)}"><span>{escape(words)}</span></button>'
    )


def recordings_html(page: Page) -> str:
    """The open recording; a click shows all that can be opened, with a field to search in."""
    chosen = listed_id(page.state.recording_id)
    title = next((choice.title for choice in page.recordings if choice.id == chosen), "Choose a recording")
    rows = "".join(
        f'<button data-k="open:{escape(choice.id)}" {ON_PICK}'
        f"{' class=etv-on' if choice.id == chosen else ''}><b>{escape(choice.title)}</b>"
        f"<span>{escape(' · '.join(filter(None, (choice.facts, choice.subtitle))))}</span></button>"
        for choice in page.recordings
    )
    return (
        f'<details class="etv-recordings"><summary title="Choose a recording"><span>{escape(title)}</span></summary>'
        f'<div class="etv-list"><input type="search" placeholder="Search recordings" aria-label="Search recordings">'
        f"{rows}</div></details>"
    )


def display_html(page: Page) -> str:
    """How grey values and events are drawn."""
    rows = (("Tone mapping", tone_html(page)), ("Event image", style_html(page)))
    body = "".join(f'<div class="etv-row"><label>{label}</label>{content}</div>' for label, content in rows)
    return f'<div class="et etv-settings" data-testid="display">{body}</div>'


def tone_html(page: Page) -> str:
    """The choice of tone mapping."""
    options = {f"set:reconstruction.tone:{name}": words for name, words in TONES.items()}
    chosen = f"set:reconstruction.tone:{page.state.of(ReconstructionState).tone}"
    return segmented("Tone mapping", options, chosen)


def style_html(page: Page) -> str:
    """The choice of event image."""
    options = {f"set:events.event_image:{name}": words for name, words in STYLES.items()}
    return segmented("Event image", options, f"set:events.event_image:{page.state.of(EventsState).event_image}")

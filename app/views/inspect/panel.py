"""Look inside: one inspector at a time, over the results of its jobs."""

from __future__ import annotations

from typing import Any

import viser

from app.engine.jobs import JobResult
from app.engine.requests import FrameRequest
from app.html.attention.maps import base_url
from app.html.controls import choose_pixel, stale_line, under_way
from app.html.elements import empty, escape, panel
from app.html.moment import Moment
from app.state import intents as ask
from app.views.attention.state import AttentionState, look_of
from app.views.inspect.html.attribution import traced_html
from app.views.inspect.html.change import change_html
from app.views.inspect.html.importance import attended_html, matters_html
from app.views.inspect.html.memory import channels_html, norms_html, remembered_html
from app.views.inspect.html.network_input import given_html
from app.views.inspect.html.rollout import followed_html, rolled_html
from app.views.inspect.results import Anatomy
from app.views.inspect.state import Inspector, InspectState
from app.views.page import Page
from app.views.panel import Dispatch, Html, Panel, assign, on_visitor
from app.views.reconstruction.state import tones_of

INSPECTORS: dict[Inspector, str] = {
    "none": "none",
    "matters": "What matters here",
    "change": "Change something",
    "events": "Which events made this pixel",
    "input": "What the network is given",
    "state": "Its memory, channel by channel",
    "memory": "How far back it remembers",
    "rollout": "All attention rolled into one map",
    "time": "Its attention through time",
}
_OF_THE_ORIGINAL = ("matters", "events", "memory", "time")
"""Inspectors that look at the unchanged network, whatever is changed."""
_CLOSED = empty(
    "Look inside the network",
    "Choose above what to look at. While nothing is open here, nothing is computed for it.",
)


class InspectPanel(Panel):
    """A list of inspectors, and the one that is open."""

    def build_settings(self, gui: viser.GuiApi, dispatch: Dispatch) -> None:
        """The list, then one element for whatever is open."""
        self._choice = gui.add_dropdown("Look at", tuple(INSPECTORS.values()))
        self._body = Html(gui)
        words: dict[str, Inspector] = {text: name for name, text in INSPECTORS.items()}
        on_visitor(
            self._choice, lambda text: ask.Set("inspect", "opened", words[text]) if text in words else None, dispatch
        )

    def show_settings(self, page: Page) -> None:
        """Draw the inspector that is open."""
        opened = page.state.of(InspectState).opened
        assign(self._choice, INSPECTORS[opened])
        self._body.show(f'<div data-testid="inside">{inspector_html(page)}</div>')


def inspector_html(page: Page) -> str:
    """The open inspector, or what to do."""
    inside = page.state.of(InspectState)
    if page.moment is None:
        return panel("inside-empty", empty("No recording", page.trouble or "Choose one under Recording."))
    if inside.opened in _OF_THE_ORIGINAL and not inside.change.at(page.state.index).is_nothing:
        said = "This is about the network as it is, without your change."
        return panel("of-the-original", f'<div class="et-changed">{said}</div>') + _opened(page, page.moment)
    return _opened(page, page.moment)


def _opened(page: Page, moment: Moment) -> str:
    match page.state.of(InspectState).opened:
        case "matters":
            return _matters(page)
        case "change":
            return _change(page)
        case "events":
            return _events(page)
        case "input":
            return _input(page, moment)
        case "state":
            return _state(page)
        case "memory":
            return _memory(page)
        case "rollout" | "time":
            return _paths(page)
    return panel("inside-empty", _CLOSED)


def _matters(page: Page) -> str:
    found = page.results.get("inspect.matters")
    body = _awaited(found, "making the image without each part", page)
    if found is not None and found.is_whole and found.value is None:
        body += matters_html((), found.job)
    elif found is not None and found.value is not None:
        body += matters_html(
            found.value,
            found.job,
            chosen=page.state.of(InspectState).part,
            query=page.state.query,
            is_whole=found.is_whole,
        )
    return body + _attended(page)


def _attended(page: Page) -> str:
    found = page.results.get("inspect.attended")
    if (look := look_of(page)) is None or found is None or (found.is_whole and found.value is None):
        return ""
    body = _awaited(found, "looking for sinks", page)
    ready = page.ready
    if found.value is None or ready is None or ready.attention is None:
        return body
    base = base_url(ready, ready.attention, look.tones)
    return body + attended_html(found.value, page.state.of(AttentionState).site, look, found.job, base=base)


def _change(page: Page) -> str:
    anatomy = page.results.get("inspect.anatomy")
    if anatomy is None or anatomy.value is None:
        return panel("change", _awaited(anatomy, "looking at the network", page))
    assert isinstance(anatomy.value, Anatomy)
    change = page.state.of(InspectState).change.at(page.state.index)
    found = page.results.get("inspect.outcome")
    if found is not None and _request(found).change != (change.intervention, change.edit, change.since):
        found = None  # what another change did
    body = "" if found is None else _awaited(found, "measuring the difference", page)
    return body + change_html(
        anatomy.value,
        page.state.of(InspectState).change,
        index=page.state.index,
        site=page.state.of(AttentionState).site,
        outcome=None if found is None else found.value,
        key=None if found is None else found.job,
        tones=tones_of(page),
        is_whole=found is not None and found.is_whole,
    )


def _events(page: Page) -> str:
    num_back = page.state.of(InspectState).num_back
    found = _about(page.results.get("inspect.traced"), pixel=page.state.query, num_back=num_back)
    if page.state.query is None:
        why = "Its gradient is then followed back to every event that had a part in it."
        return panel("traced", choose_pixel(why)) + traced_html(None, None, num_back)
    body = _awaited(found, "following the gradient back", page)
    value = None if found is None else found.value
    return body + traced_html(value, None if found is None else found.job, num_back)


def _input(page: Page, moment: Moment) -> str:
    found = page.results.get("inspect.given")
    body = _awaited(found, "reading the events", page)
    if found is None or found.value is None:
        return body
    if _request(found).index != page.state.index:
        return body  # its pixel's events would be another window's
    is_edited = not page.state.of(InspectState).change.at(page.state.index).edit.changes_nothing
    return body + given_html(found.value, found.job, moment, page.state.query, is_edited)


def _state(page: Page) -> str:
    inside, anatomy = page.state.of(InspectState), page.results.get("inspect.anatomy")
    found = _about(page.results.get("inspect.channels"), level=inside.level, plane=inside.plane)
    if anatomy is None or anatomy.value is None:
        return _awaited(anatomy, "looking at the network", page)
    if not anatomy.value.num_levels:
        said = f"{anatomy.value.name} has no ConvLSTM levels, so there are no gates and cells to show."
        return panel("channels", empty("No such memory", said))
    norms = page.results.get("inspect.norms")
    strong = norms_html(norms.value) if norms is not None and norms.value is not None else ""
    shown = _awaited(found, "recomputing the gates", page) + channels_html(
        anatomy.value,
        None if found is None else found.value,
        None if found is None else found.job,
        level=inside.level,
        plane=inside.plane,
        chosen=inside.channel,
        query=page.state.query,
    )
    return shown + strong


def _paths(page: Page) -> str:
    anatomy, inside, query = page.results.get("inspect.anatomy"), page.state.of(InspectState), page.state.query
    if anatomy is not None and anatomy.value is not None and not anatomy.value.sites:
        return panel("rolled", empty("No attention", f"{anatomy.value.name} is made of convolutions alone."))
    if (look := look_of(page)) is None or query is None:
        return panel("rolled", choose_pixel("Its attention is then followed through the network."))
    if inside.opened == "time":
        found = _about(page.results.get("inspect.followed"), pixel=query, site=page.state.of(AttentionState).site)
        body = _awaited(found, "following it, window by window", page)
        if found is None or found.value is None or anatomy is None or anatomy.value is None:
            return body
        job: Any = found.job
        return body + followed_html(found.value, job, job.site, anatomy.value.sites, job.pixel)
    found = _about(page.results.get("inspect.rolled"), pixel=query, discard=inside.discard / 100)
    body = _awaited(found, "multiplying the maps of all layers", page)
    if page.ready is None or page.ready.attention is None:
        return body
    value = None if found is None else found.value
    base = base_url(page.ready, page.ready.attention, look.tones)
    return body + rolled_html(value, page.ready, look, inside.discard, base)


def _memory(page: Page) -> str:
    found = page.results.get("inspect.remembered")
    body = _awaited(found, "starting cold, one depth after the other", page)
    if found is None or found.value is None:
        return body
    return body + remembered_html(found.value, found.job, page.state.query)


def _awaited(found: JobResult | None, what: str, page: Page) -> str:
    """How far an answer has come, which window it is about, or why there will be none."""
    if found is None:
        return panel("awaited", under_way(0.0, what))
    if found.trouble:
        return panel("awaited", f'<div class="et-say" data-testid="lacks">{escape(found.trouble)}</div>')
    lag = stale_line(_request(found).index, page.state.index)
    waits = "" if found.is_whole else under_way(found.share, what)
    return panel("awaited", lag or waits) if lag or waits else ""


def _about(found: JobResult | None, **asked: object) -> JobResult | None:
    """A result, if it answers what is asked now; the answer to a former question is none."""
    return found if found is not None and all(getattr(found.job, key) == held for key, held in asked.items()) else None


def _request(found: JobResult) -> FrameRequest:
    return found.job.request  # pyright: ignore[reportAttributeAccessIssue]  every job has one

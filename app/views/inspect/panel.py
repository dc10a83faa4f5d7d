"""The inspector: ablation at the chosen pixel and a list, or the one that is open, over the results of its jobs."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import viser

from app.engine.jobs import JobResult
from app.engine.network_parts import NetworkParts
from app.engine.requests import FrameRequest
from app.html.attention.maps import base_url
from app.html.attention.not_maps import explained_html, not_icon
from app.html.controls import choose_pixel, stale_line, under_way
from app.html.elements import empty, escape, icon_button, panel
from app.html.moment import Moment
from app.views.attention.state import AttentionState, look_of
from app.views.events.state import EventsState
from app.views.inspect.html.attribution import traced_html
from app.views.inspect.html.causes import pixel_first, search_html, sources_html, spread_html, twin_html
from app.views.inspect.html.change import change_html
from app.views.inspect.html.importance import attended_html, matters_html
from app.views.inspect.html.memory import channels_html, norms_html, remembered_html
from app.views.inspect.html.network_input import given_html
from app.views.inspect.html.overview import INSPECTORS, NEEDS, ablation_html, list_html
from app.views.inspect.html.python import code_of
from app.views.inspect.html.rollout import followed_html, rolled_html
from app.views.inspect.state import Change, InspectState
from app.views.page import Page
from app.views.panel import Dispatch, Html, Panel
from app.views.reconstruction.state import tones_of

if TYPE_CHECKING:
    from etnet.inspection.anatomy import Anatomy

_OF_THE_ORIGINAL = ("none", "matters", "events", "memory", "time", "sources", "search", "spread")
"""Inspectors that look at the unchanged network, whatever is changed."""


class InspectPanel(Panel):
    """The list of inspectors, or the one that is open; above it, what is said while it stands still in a drag."""

    def build_settings(self, gui: viser.GuiApi, dispatch: Dispatch) -> None:
        """All of it is our own HTML."""
        self._lag = Html(gui)
        self._body = Html(gui)
        self._drawn: object = None
        self._drawn_at = 0

    def show_settings(self, page: Page) -> None:
        """Draw what is open. While time runs and nothing else changes it stays as it is: a drag is not held up."""
        drawn = _asked(page)
        if page.is_moving and drawn == self._drawn:
            # Without a pixel, or an answer about it, the list alone is drawn, which is of no window.
            has_answer = page.state.query is not None and not page.follows
            shows_list = not has_answer and page.state.of(InspectState).opened == "none"
            line = "" if shows_list else stale_line(self._drawn_at, page.state.index)
            self._lag.show(panel("lag-line", line) if line else "")
            return
        self._drawn, self._drawn_at = drawn, page.state.index
        self._lag.show("")
        self._body.show(f'<div data-testid="inside">{inspector_html(page)}</div>')


def _asked(page: Page) -> tuple[object, ...]:
    """All that an inspector is drawn from, but the moment; a twin's pictures go along with that, too."""
    inside = page.state.of(InspectState)
    found = tuple(result for slot, result in page.results.items() if slot.startswith("inspect."))
    moment = page.state.index if inside.opened == "twin" else page.moment is None
    state = page.state
    return inside, state.of(AttentionState), state.query, state.recording_id, state.model_id, moment, found


def inspector_html(page: Page) -> str:
    """The open inspector with its lines of Python, or what to do; a sentence where a network has nothing for it."""
    inside, moment = page.state.of(InspectState), page.moment
    if moment is None:
        return panel("inside-empty", empty("No recording", page.trouble or "Choose one in the bar."))
    # An answer stays until the next one has come; that of a former network would stand under the new one's name.
    page = replace(page, results={slot: held for slot, held in page.results.items() if page.is_about(held.job.request)})
    lacks = _lacks(page)
    change = inside.change.at(page.state.index)
    note = ""
    if inside.opened in _OF_THE_ORIGINAL and not change.is_nothing:
        note = panel("of-the-original", '<div class="et-changed">Of the original network, without your change.</div>')
    if inside.opened == "none":
        found = page.results.get("inspect.ablated")
        waits = "" if page.state.query is None else _awaited(found, "ablating one part after the other", page)
        bars = ablation_html(page.state.query, None if found is None else found.value, waits)
        return note + bars + code_of(page) + list_html(lacks)
    title, _ = INSPECTORS[inside.opened]
    back = icon_button("set:inspect.opened:none", "previous", "All inspectors")
    has_maps = inside.opened in ("matters", "rollout", "time")
    about = not_icon(f"set:inspect.shows_not:{not inside.shows_not}", inside.shows_not) if has_maps else ""
    head = panel("inspector-title", f'<div class="et-inspector-head">{back}<h4>{title}</h4>{about}</div>')
    if has_maps and inside.shows_not:
        head += panel("not-maps", explained_html())
    if said := lacks.get(NEEDS.get(inside.opened, ""), ""):
        return head + panel("lacking", empty("Nothing to show", f"{said}."))
    return head + note + _opened(page, moment) + code_of(page)


def _lacks(page: Page) -> dict[str, str]:
    found = page.results.get("inspect.network")
    return dict(found.value.lacks) if found is not None and isinstance(found.value, NetworkParts) else {}


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
            return _paths(page, moment)
    return _causes(page, moment)


def _causes(page: Page, moment: Moment) -> str:
    inside, query = page.state.of(InspectState), page.state.query
    match inside.opened:
        case "sources" | "search" if query is None:
            return pixel_first(inside.opened)
        case "sources":
            found = _about(page.results.get("inspect.sources"), pixel=query)
            waits = _awaited(found, "ablating one part after the other", page)
            return waits + sources_html(_value(found), _anatomy(page))
        case "search":
            return _search(page, moment)
        case "spread":
            found = page.results.get("inspect.spread")
            waits = _awaited(found, "leaving events out at random", page)
            return waits + spread_html(_value(found), None if found is None else found.job, query)
    found = page.results.get("inspect.twin")
    change = inside.change
    value = _value(found) if found is not None and _is_of(_request(found), change) else None
    waits = ""
    if not change.is_nothing and (found is None or not found.is_whole):
        waits = panel("awaited", under_way(0.0 if found is None else found.share, "both runs, window by window"))
    if found is not None and found.trouble:
        waits = _awaited(found, "", page)
    key = None if found is None else found.job
    return twin_html(value, key, change, moment, query, tones_of(page), _anatomy(page)) + waits


def _is_of(made: FrameRequest, change: Change) -> bool:
    """Whether a twin is of this change; one of what holds in each window by itself began at a window of its own."""
    is_same = (made.intervention, made.edit, made.once) == (change.intervention, change.edit, change.once)
    return is_same and change.since in (None, made.since)


def _anatomy(page: Page) -> Anatomy | None:
    """The network's parts, once they are known."""
    parts = page.results.get("inspect.network")
    return None if parts is None or parts.value is None else parts.value.anatomy


def _search(page: Page, moment: Moment) -> str:
    inside, query, found = page.state.of(InspectState), page.state.query, page.results.get("inspect.search")
    level = None if inside.zeroes == "all" else int(inside.zeroes)
    towards = {"any": None, "camera": "camera", "value": inside.wanted / 100}[inside.towards]
    asked = {"pixel": query, "tolerance": inside.tolerance / 1000, "level": level, "towards": towards}
    found = _about(found, **asked)
    waits = _awaited(found, "zeroing the state at one window after the other", page)
    is_whole, style = found is not None and found.is_whole, page.state.of(EventsState).event_image
    return waits + search_html(_value(found), is_whole, inside, moment, _anatomy(page), style)


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
    parts = page.results.get("inspect.network")
    if parts is None or parts.value is None:
        return panel("change", _awaited(parts, "looking at the network", page))
    change = page.state.of(InspectState).change.at(page.state.index)
    found = page.results.get("inspect.outcome")
    if found is not None:
        made = _request(found)
        if (made.intervention, made.edit, made.since, made.once) != (
            change.intervention,
            change.edit,
            change.since,
            change.once,
        ):
            found = None  # what another change did
    body = "" if found is None else _awaited(found, "measuring the difference", page)
    return body + change_html(
        parts.value,
        page.state.of(InspectState).change,
        index=page.state.index,
        site=page.state.of(AttentionState).site,
        outcome=_value(found),
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
    return body + traced_html(_value(found), None if found is None else found.job, num_back)


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
    inside, parts = page.state.of(InspectState), page.results.get("inspect.network")
    found = _about(page.results.get("inspect.channels"), level=inside.level, plane=inside.plane)
    if parts is None or parts.value is None:
        return _awaited(parts, "looking at the network", page)
    norms = page.results.get("inspect.norms")
    strong = norms_html(norms.value) if norms is not None and norms.value is not None else ""
    shown = _awaited(found, "recomputing the gates", page) + channels_html(
        parts.value.anatomy,
        _value(found),
        None if found is None else found.job,
        level=inside.level,
        plane=inside.plane,
        chosen=inside.channel,
        query=page.state.query,
    )
    return shown + strong


def _paths(page: Page, moment: Moment) -> str:
    parts, inside, query = page.results.get("inspect.network"), page.state.of(InspectState), page.state.query
    if (look := look_of(page)) is None or query is None:
        return panel("rolled", choose_pixel("Its attention is then followed through the network."))
    attention = page.state.of(AttentionState)
    if inside.opened == "time":
        asked = {"pixel": query, "site": attention.site, "head": attention.head}
        asked["anchor"] = attention.anchored(page.state.index)
        found = _about(page.results.get("inspect.followed"), **asked)
        body = ""
        if found is None or not found.is_whole or found.trouble:
            body = _under_way(found, "following it, window by window")
        if found is None or found.value is None or parts is None or parts.value is None:
            return body
        job: Any = found.job
        return body + followed_html(found.value, job, parts.value.anatomy, moment, look)
    found = _about(page.results.get("inspect.rolled"), pixel=query, discard=inside.discard / 100, fusion=inside.fusion)
    body = _awaited(found, "multiplying the maps of all layers", page)
    if page.ready is None or page.ready.attention is None:
        return body
    base = base_url(page.ready, page.ready.attention, look.tones)
    return body + rolled_html(_value(found), page.ready, look, inside, base)


def _memory(page: Page) -> str:
    found = page.results.get("inspect.remembered")
    body = _awaited(found, "starting cold, one depth after the other", page)
    if found is None or found.value is None:
        return body
    return body + remembered_html(found.value, found.job, page.state.query)


def _under_way(found: JobResult | None, what: str) -> str:
    """How far an answer has come, or why there will be none."""
    if found is not None and found.trouble:
        return panel("awaited", f'<div class="et-say" data-testid="lacks">{escape(found.trouble)}</div>')
    return panel("awaited", under_way(0.0 if found is None else found.share, what))


_OF_ONE_WINDOW = (
    '<div class="et-note" data-testid="of-one-window">Of one window, and they pass: pause (space), or go back.</div>'
)
"""Where a source is followed nothing is computed that the next window would undo."""


def _awaited(found: JobResult | None, what: str, page: Page) -> str:
    """How far an answer has come, which window it is about, or why there will be none."""
    if page.follows and (found is None or not found.is_whole):
        return panel("awaited", _OF_ONE_WINDOW)
    if found is None or found.trouble:
        return _under_way(found, what)
    lag = stale_line(_request(found).index, page.state.index)
    waits = "" if found.is_whole else under_way(found.share, what)
    return panel("awaited", lag or waits) if lag or waits else ""


def _value(found: JobResult | None) -> Any:
    return None if found is None else found.value


def _about(found: JobResult | None, **asked: object) -> JobResult | None:
    """A result, if it answers what is asked now; the answer to a former question is none."""
    return found if found is not None and all(getattr(found.job, key) == held for key, held in asked.items()) else None


def _request(found: JobResult) -> FrameRequest:
    return found.job.request

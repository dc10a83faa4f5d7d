"""What the open inspector shows, as a question that the lines of Python answer."""

from __future__ import annotations

from typing import TYPE_CHECKING

from app.engine.jobs import JobResult
from app.html.attention.python import Named, code_html, described, python_of
from app.views.attention.state import AttentionState
from app.views.inspect.jobs.causes import BACK, DROP, FURTHEST, SEEDS
from app.views.inspect.state import InspectState
from app.views.page import Page
from etnet.errors import EtnetError

if TYPE_CHECKING:
    from etnet.inspection.asked import Asked

SLOTS = {
    "none": "ablated", "matters": "matters", "change": "outcome", "sources": "sources", "events": "traced",
    "search": "search", "twin": "twin", "input": "given", "state": "channels", "memory": "remembered",
    "rollout": "rolled", "time": "followed", "spread": "spread",
}  # fmt: skip
"""The job whose answer the lines give, by inspector."""


def code_of(page: Page) -> str:
    """The button, and the lines where it was pressed; nothing before there is something to give."""
    slice_ = page.state.of(InspectState)
    found = page.results.get(f"inspect.{SLOTS[slice_.opened]}")
    if found is None or found.value is None or page.ready is None:
        return ""
    text = snippet(page, found) if slice_.shows_code else ""
    return (
        f'<div class="et" data-testid="as-python">{code_html(text, slice_.shows_code, "set:inspect.shows_code")}</div>'
    )


def snippet(page: Page, found: JobResult) -> str:
    """The lines that give what `found` holds."""
    asked = asked_of(page, found)
    assert page.moment is not None
    assert page.ready is not None
    request = found.job.request
    named = Named(page.file_name or "recording", page.model.source)
    try:
        return python_of(described(page.moment, page.ready, named, request), asked)
    except EtnetError as error:
        return f"# {error}"


def asked_of(page: Page, found: JobResult) -> Asked:
    """The library's question behind an answer."""
    from etnet.inspection.asked import Asked

    slice_, query, job, value = page.state.of(InspectState), page.state.query, found.job, found.value
    match slice_.opened:
        case "none":
            part = next(iter(value.differences))
            return Asked("effect", part=part) if part != "events now" else Asked("sources", pixel=query)
        case "matters":
            names = [effect.name for effect in value]
            return Asked("effect", part=slice_.part if slice_.part in names else names[0])
        case "sources":
            return Asked("sources", pixel=query)
        case "events":
            return Asked("attribution", pixel=query, num_back=slice_.num_back)
        case "search":
            return Asked("cause", pixel=query, tolerance=slice_.tolerance / 1000, furthest=FURTHEST)
        case "twin":
            return Asked("curve", pixel=query, windows=(value.indices[0], value.indices[-1]))
        case "input":
            return Asked("voxel")
        case "state":
            return Asked("gates", level=slice_.level, quantity=slice_.plane)
        case "memory":
            return Asked("memory_depth", depths=value.depths)
        case "spread":
            return Asked("spread", drop=DROP, num_seeds=SEEDS, num_back=BACK)
        case "rollout" | "time":
            return _of_attention(page, job, value)
    return Asked("frame")


def _of_attention(page: Page, job, value) -> Asked:
    from etnet.inspection.asked import Asked
    from etnet.nets.padding import TokenGrid

    assert page.moment is not None
    assert page.state.query is not None
    if page.state.of(InspectState).opened == "rollout":
        sensor = page.moment.recording.sensor
        token = TokenGrid(sensor.height, sensor.width).token_at(*page.state.query)
        return Asked("rollout", token=token, discard=job.discard, head=None if job.fusion == "mean" else job.fusion)
    site, head = job.site, page.state.of(AttentionState).head
    parts = page.results.get("inspect.network")
    if parts is not None and parts.value is not None:
        site, head = parts.value.anatomy.site(site), parts.value.anatomy.head(head)
    stretch = (value.indices[0], value.indices[-1])
    return Asked(
        "track",
        pixel=page.state.query,
        site=site,
        windows=stretch,
        quantity="entropy",
        head="mean" if head is None else head,
        until=stretch[0] if job.follows else None,
    )

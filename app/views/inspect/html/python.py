"""What the open inspector shows, as questions that lines of Python answer."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING, Any, NamedTuple

from app.engine.jobs import JobResult
from app.engine.requests import FrameRequest
from app.html.attention.python import code_html, described, python_of
from app.html.elements import select
from app.views.attention.state import AttentionState
from app.views.inspect.jobs.causes import BACK, DROP, FURTHEST, SEEDS
from app.views.inspect.state import InspectState
from app.views.naming import cannot_be_named, named
from app.views.page import Page
from app.views.stretch import NEAR
from etnet.errors import EtnetError
from etnet.events.edit import EventEdit
from etnet.nets.intervention import Intervention

if TYPE_CHECKING:
    from etnet.inspection.asked import Asked

SLOTS = {
    "none": "ablated", "matters": "matters", "change": "outcome", "sources": "sources", "events": "traced",
    "search": "search", "twin": "twin", "input": "given", "state": "channels", "memory": "remembered",
    "rollout": "rolled", "time": "followed", "spread": "spread",
}  # fmt: skip
"""The job whose answer the lines give, by inspector."""


class Question(NamedTuple):
    """What is asked of the library, and of which moment."""

    asked: Asked
    request: FrameRequest


def code_of(page: Page) -> str:
    """The button, and the lines where it was pressed; nothing before there is something to give."""
    slice_ = page.state.of(InspectState)
    found = page.results.get(f"inspect.{SLOTS[slice_.opened]}")
    if found is None or found.value is None or page.ready is None or not page.is_about(page.ready.request):
        return ""
    text = choice = ""
    refused = cannot_be_named(page)
    if slice_.shows_code and not refused:
        questions = asked_of(page, found)
        chosen = _chosen(page, questions)
        if len(questions) > 1:
            choice = select("Lines for", "set:inspect.lines", {name: name for name in questions}, chosen)
        text = snippet(page, found)
    code = code_html(text, slice_.shows_code, "set:inspect.shows_code", choice, refused)
    return f'<div class="et" data-testid="as-python">{code}</div>'


def snippet(page: Page, found: JobResult, name: str = "") -> str:
    """The lines that give what `found` holds; `name` chooses another of its numbers than the page's."""
    questions = asked_of(page, found)
    asked, request = questions[name or _chosen(page, questions)]
    assert page.moment is not None
    assert page.ready is not None
    try:
        return python_of(described(page.moment, request, page.ready.contract, named(page, request.model_id)), asked)
    except EtnetError as error:
        return f"# {error}"


def _chosen(page: Page, questions: dict[str, Question]) -> str:
    wanted = page.state.of(InspectState).lines
    return wanted if wanted in questions else next(iter(questions))


def asked_of(page: Page, found: JobResult) -> dict[str, Question]:
    """The library's questions behind an answer, by what they give."""
    opened, request = page.state.of(InspectState).opened, found.job.request
    if opened == "none":
        return {name: _part(name, request, found.value.levels) for name in found.value.differences}
    if opened == "time" and (anchor := getattr(found.job, "anchor", None)) is not None:
        request = replace(request, index=anchor)  # the patch is followed from there
    made = _MADE[opened](page, found)
    return {name: Question(asked, request) for name, asked in made.items()} | _beside(page)


def _part(name: str, request: FrameRequest, levels: tuple[int, ...]) -> Question:
    """One bar of the ablation at the pixel: a part of the network, or what is done to state or events."""
    from etnet.inspection.asked import Asked

    if name == "events now":
        return Question(Asked("apart", quantity="difference"), replace(request, edit=EventEdit(drop=1.0)))
    if name == "state before":
        zeroed = Intervention(zeroed_levels=frozenset(levels))
        return Question(Asked("apart", quantity="difference"), replace(request, intervention=zeroed))
    return Question(Asked("effect", part=name), request)


def _matters(page: Page, found: JobResult) -> dict[str, Asked]:
    from etnet.inspection.asked import Asked

    names, part = [effect.name for effect in found.value], page.state.of(InspectState).part
    return {"this part": Asked("effect", part=part if part in names else names[0])}


def _beside(page: Page) -> dict[str, Question]:
    """What stands below: attention against what it hands over, and the norms of the state."""
    from etnet.inspection.asked import Asked

    opened = page.state.of(InspectState).opened
    attended, norms = (page.results.get(f"inspect.{slot}") for slot in ("attended", "norms"))
    if opened == "matters" and attended is not None and attended.value is not None and page.state.query is not None:
        attention, token = attended.value.attention, attended.value.attention.grid.token_at(*page.state.query)
        wanted = page.state.of(AttentionState).site
        site = wanted if wanted in attention.sites else attention.sites[0]
        asked = {
            "attention": Asked("map", site, token, head="mean"),
            "contribution": Asked("value_weighted", site, token, head="mean"),
            "sinks": Asked("sinks", site),
            "on sinks": Asked("sinks", site, token),
            "on padding": Asked("padding", site, token),
        }
        return {name: Question(each, attended.job.request) for name, each in asked.items()}
    if opened == "state" and norms is not None and norms.value is not None:
        stretch = norms.value.indices[0], norms.value.indices[-1]
        return {
            f"norms, {name}": Question(Asked("norms", windows=stretch, quantity=name), norms.job.request)
            for name in ("hidden", "cell")
        }
    return {}


def _change(page: Page, found: JobResult) -> dict[str, Asked]:
    from etnet.inspection.asked import Asked

    asked = {
        "changed frame": Asked("frame"),
        "difference": Asked("apart", quantity="difference"),
        "MSE": Asked("apart", quantity="mse"),
    }
    return asked if found.value.lpips is None else {**asked, "LPIPS": Asked("apart", quantity="lpips")}


def _events(page: Page, found: JobResult) -> dict[str, Asked]:
    from etnet.inspection.asked import Asked

    job: Any = found.job
    names = ["this window", *(f"{age} back" for age in range(1, len(found.value.windows)))]
    return {
        name: Asked("attribution", pixel=job.pixel, num_back=job.num_back, age=age or None)
        for age, name in enumerate(names)
    }


def _twin(page: Page, found: JobResult) -> dict[str, Asked]:
    from etnet.inspection.asked import Asked

    stretch = found.value.indices[0], found.value.indices[-1]
    query = page.state.query
    of_pixel = {} if query is None else {"this pixel": Asked("curve", pixel=query, windows=stretch)}
    return {**of_pixel, "image": Asked("curve", windows=stretch)}


def _search(page: Page, found: JobResult) -> dict[str, Asked]:
    from etnet.inspection.asked import Asked

    job: Any = found.job
    levels = None if job.level is None else frozenset({job.level})
    asked = Asked(
        "cause", pixel=job.pixel, levels=levels, tolerance=job.tolerance, towards=found.value.towards, furthest=FURTHEST
    )
    return {"trials": asked}


def _rollout(page: Page, found: JobResult) -> dict[str, Asked]:
    from etnet.inspection.asked import Asked
    from etnet.nets.padding import TokenGrid

    assert page.moment is not None
    job: Any = found.job
    sensor = page.moment.recording.sensor
    token = TokenGrid(sensor.height, sensor.width).token_at(*job.pixel)
    head = None if job.fusion == "mean" else job.fusion
    return {"rollout": Asked("rollout", token=token, discard=job.discard, head=head)}


def _time(page: Page, found: JobResult) -> dict[str, Asked]:
    from etnet.inspection.asked import Asked

    job: Any = found.job
    site, head = job.site, job.head
    parts = page.results.get("inspect.network")
    if parts is not None and parts.value is not None:
        site, head = parts.value.anatomy.site(site), parts.value.anatomy.head(head)
    stretch = found.value.indices[0], found.value.indices[-1]

    def track(quantity: str, near: int | None = None) -> Asked:
        return Asked(
            "track", site, pixel=job.pixel, windows=stretch, quantity=quantity, near=near,
            head="mean" if head is None else head, until=None if job.anchor is None else stretch[1],
        )  # fmt: skip

    return {
        "entropy": track("entropy"),
        "kymograph": track("along_row"),
        "local mass": track("mass", NEAR),
    }


def _one(name: str, make: Callable[[Page, Any], dict[str, Any]]) -> Callable[[Page, JobResult], dict[str, Asked]]:
    """An inspector with one question."""

    def made(page: Page, found: JobResult) -> dict[str, Asked]:
        from etnet.inspection.asked import Asked

        return {name: Asked(**make(page, found.value))}

    return made


_MADE: dict[str, Callable[[Page, JobResult], dict[str, Asked]]] = {
    "matters": _matters,
    "change": _change,
    "events": _events,
    "twin": _twin,
    "search": _search,
    "rollout": _rollout,
    "time": _time,
    "sources": _one("sources", lambda page, value: {"what": "sources", "pixel": value.pixel}),
    "input": _one("voxel", lambda page, value: {"what": "voxel"}),
    "state": _one(
        "channels",
        lambda page, value: {"what": "gates", "level": value.level, "quantity": value.plane},
    ),
    "memory": _one("memory depth", lambda page, value: {"what": "memory_depth", "depths": value.depths}),
    "spread": _one(
        "spread",
        lambda page, value: {"what": "spread", "drop": DROP, "num_seeds": SEEDS, "num_back": BACK},
    ),
}

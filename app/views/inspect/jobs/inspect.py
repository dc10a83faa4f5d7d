"""Which jobs the inspector that is open asks for; while none is, what moves the chosen pixel."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from app.engine.jobs import Job
from app.engine.network_parts import NetworkPartsJob
from app.engine.requests import FrameRequest
from app.state.view_state import ViewState
from app.views.attention.state import AttentionState
from app.views.inspect.jobs.causes import CauseJob, SourcesJob, SpreadJob, TwinJob
from app.views.inspect.jobs.memory import ChannelsJob, MemoryDepthJob, NetworkInputJob, NormsJob
from app.views.inspect.jobs.parts import AblatedPartsJob, AttendedJob, ImportanceJob, OutcomeJob
from app.views.inspect.jobs.pixel import AttributionJob, RolloutJob, ThroughTimeJob
from app.views.inspect.state import InspectState
from app.views.stretch import stretch_of


def inspect_jobs(state: ViewState, request: FrameRequest) -> Mapping[str, Job]:
    """What the inspector that is open wants to know of the moment."""
    slice_, query = state.of(InspectState), state.query
    plain, asked = request.plain, replace(request, wants_attention=False)
    if slice_.opened == "none" and query is None:
        return {}
    wanted: dict[str, Job] = {"inspect.network": NetworkPartsJob(replace(plain, index=0))}
    match slice_.opened:
        case "none":
            wanted["inspect.ablated"] = AblatedPartsJob(plain)
        case "matters":
            wanted["inspect.matters"] = ImportanceJob(plain)
            if query is not None:
                wanted["inspect.attended"] = AttendedJob(plain)
        case "change" if not request.is_original:
            wanted["inspect.outcome"] = OutcomeJob(asked)
        case "twin" if not slice_.change.is_nothing:
            wanted["inspect.twin"] = TwinJob(twin_request(slice_, request))
        case "input":
            wanted["inspect.given"] = NetworkInputJob(asked)
        case "state":
            wanted["inspect.channels"] = ChannelsJob(asked, slice_.level, slice_.plane)
            wanted["inspect.norms"] = NormsJob(asked)
        case "memory":
            wanted["inspect.remembered"] = MemoryDepthJob(plain)
        case "spread":
            wanted["inspect.spread"] = SpreadJob(plain)
        case _:
            pass
    return {**wanted, **_pixel_study(state, asked)}


def twin_request(slice_: InspectState, request: FrameRequest) -> FrameRequest:
    """The first window of a twin, and the change that holds from there on."""
    change = slice_.change
    at = request.index if change.since is None else change.since
    return replace(
        request.plain,
        index=at,
        intervention=change.intervention,
        edit=change.edit,
        since=at,
        once=change.once,
    )


def cause_job(slice_: InspectState, request: FrameRequest, query: tuple[int, int]) -> CauseJob:
    """The causal search as it is set."""
    level = None if slice_.zeroes == "all" else int(slice_.zeroes)
    towards = {"any": None, "camera": "camera", "value": slice_.wanted / 100}[slice_.towards]
    return CauseJob(request, query, slice_.tolerance / 1000, level, towards)  # pyright: ignore[reportArgumentType]


def _pixel_study(state: ViewState, asked: FrameRequest) -> Mapping[str, Job]:
    """What is asked about the clicked pixel alone."""
    slice_, query, attention = state.of(InspectState), state.query, state.of(AttentionState)
    if query is None:
        return {}
    match slice_.opened:
        case "events":
            return {"inspect.traced": AttributionJob(asked.plain, query, slice_.num_back)}
        case "sources":
            return {"inspect.sources": SourcesJob(asked.plain, query)}
        case "search":
            return {"inspect.search": cause_job(slice_, asked.plain, query)}
        case "rollout":
            return {"inspect.rolled": RolloutJob(asked, query, slice_.discard / 100, slice_.fusion)}
        case "time":
            asked_of = attention.site, attention.head, attention.anchored(asked.index)
            first = replace(asked.plain, index=stretch_of(asked.index)[0])
            return {"inspect.followed": ThroughTimeJob(first, query, *asked_of)}
    return {}

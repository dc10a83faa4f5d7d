"""Which jobs the inspector that is open asks for; the law is that closed ones ask for nothing."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from app.engine.jobs import Job
from app.engine.requests import FrameRequest
from app.state.view_state import ViewState
from app.views.attention.state import AttentionState
from app.views.inspect.jobs.memory import ChannelsJob, MemoryDepthJob, NetworkInputJob, NormsJob
from app.views.inspect.jobs.parts import AttendedJob, ImportanceJob, OutcomeJob, PartsJob
from app.views.inspect.jobs.pixel import AttributionJob, RolloutJob, ThroughTimeJob
from app.views.inspect.state import InspectState


def inspect_jobs(state: ViewState, request: FrameRequest) -> Mapping[str, Job]:
    """What the inspector that is open wants to know of the moment; nothing while all are closed."""
    slice_, query = state.of(InspectState), state.query
    plain, asked = request.plain, replace(request, wants_attention=False)
    if slice_.opened == "none":
        return {}
    wanted: dict[str, Job] = {"inspect.anatomy": PartsJob(replace(plain, index=0))}
    match slice_.opened:
        case "matters":
            wanted["inspect.matters"] = ImportanceJob(plain)
            if query is not None:
                wanted["inspect.attended"] = AttendedJob(plain)
        case "change" if not request.is_original:
            wanted["inspect.outcome"] = OutcomeJob(asked)
        case "input":
            wanted["inspect.given"] = NetworkInputJob(asked)
        case "state":
            wanted["inspect.channels"] = ChannelsJob(asked, slice_.level, slice_.plane)
            wanted["inspect.norms"] = NormsJob(asked)
        case "memory":
            wanted["inspect.remembered"] = MemoryDepthJob(plain)
        case _:
            pass
    return {**wanted, **_pixel_study(state, asked)}


def _pixel_study(state: ViewState, asked: FrameRequest) -> Mapping[str, Job]:
    """What is asked about the clicked pixel alone."""
    slice_, query = state.of(InspectState), state.query
    if query is None:
        return {}
    match slice_.opened:
        case "events":
            return {"inspect.traced": AttributionJob(asked.plain, query, slice_.num_back)}
        case "rollout":
            return {"inspect.rolled": RolloutJob(asked, query, slice_.discard / 100)}
        case "time":
            return {"inspect.followed": ThroughTimeJob(asked.plain, query, state.of(AttentionState).site)}
    return {}

"""Which jobs the inspector that is open asks for; the law is that closed ones ask for nothing."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from app.engine.jobs import Job
from app.engine.requests import FrameRequest
from app.state.view_state import ViewState
from app.views.inspect.jobs.memory import ChannelsJob, MemoryDepthJob, NetworkInputJob, NormsJob
from app.views.inspect.jobs.parts import AttendedJob, ImportanceJob, OutcomeJob, PartsJob
from app.views.inspect.jobs.pixel import AttributionJob, RolloutJob, ThroughTimeJob


def inspect_jobs(state: ViewState, request: FrameRequest) -> Mapping[str, Job]:
    """What the inspector that is open wants to know of the moment; nothing while all are closed."""
    inside, query = state.inside, state.query
    plain, asked = request.plain, replace(request, wants_attention=False)
    if inside.opened == "none":
        return {}
    wanted: dict[str, Job] = {"inside.anatomy": PartsJob(replace(plain, index=0))}
    match inside.opened:
        case "matters":
            wanted["inside.matters"] = ImportanceJob(plain)
            if query is not None:
                wanted["inside.attended"] = AttendedJob(plain)
        case "change" if not request.is_original:
            wanted["inside.outcome"] = OutcomeJob(asked)
        case "input":
            wanted["inside.given"] = NetworkInputJob(asked)
        case "state":
            wanted["inside.channels"] = ChannelsJob(asked, inside.level, inside.plane)
            wanted["inside.norms"] = NormsJob(asked)
        case "memory":
            wanted["inside.remembered"] = MemoryDepthJob(plain)
        case _:
            pass
    return {**wanted, **_pixel_study(state, asked)}


def _pixel_study(state: ViewState, asked: FrameRequest) -> Mapping[str, Job]:
    """What is asked about the clicked pixel alone."""
    inside, query = state.inside, state.query
    if query is None:
        return {}
    match inside.opened:
        case "events":
            return {"inside.traced": AttributionJob(asked.plain, query, inside.num_back)}
        case "rollout":
            return {"inside.rolled": RolloutJob(asked, query, inside.discard / 100)}
        case "time":
            return {"inside.followed": ThroughTimeJob(asked.plain, query, state.site)}
    return {}

"""Which scores the runs of a page want, and which run an answer belongs to."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

from app.engine.jobs import Job, JobResult
from app.engine.requests import FrameRequest
from app.html.moment import Moment
from app.state.view_state import ViewState
from app.views.compare.html.lane import LaneShown, truth_of
from app.views.compare.jobs.scores import MOST_WINDOWS, MomentScore, ProtocolRun, Strip
from app.views.compare.state import CompareState
from app.views.page import LaneFrame


def lane_jobs(
    state: ViewState, moment: Moment, lanes: Sequence[LaneFrame], num_seen: Callable[[FrameRequest], int]
) -> dict[str, Job]:
    """The jobs of all runs, by slot. `num_seen`: how many frames of a request's playback exist."""
    compare = state.of(CompareState)
    asked = [(lane, lane.request) for lane in lanes if lane.request is not None]
    match compare.inspector, compare.replays:
        case "lanes", _:
            truths = [truth_of(moment, lane.window, compare.offset) for lane, _ in asked]
            return {
                slot_of("moment", lane): MomentScore(request, compare.rule, truth.index if truth else None)
                for (lane, request), truth in zip(asked, truths, strict=True)
            }
        case "scores", False:
            return {
                slot_of("strip", lane): Strip(
                    replace(request.plain, index=0),
                    compare.rule,
                    compare.offset,
                    num_seen(request) if lane.num_windows > MOST_WINDOWS else -1,
                )
                for lane, request in asked
            }
        case "scores", True:
            return {
                slot_of("protocol", lane): ProtocolRun(
                    replace(request.plain, index=0, cold_at=0, precision="fp32"), compare.rule
                )
                for lane, request in asked
            }
    return {}


def slot_of(subject: str, lane: LaneShown | LaneFrame) -> str:
    """Where a run's job stands."""
    return f"compare.{subject}.{lane.number}"


def scored(lane: LaneShown, result: JobResult | None) -> LaneShown:
    """The run with its values, if they are those of the frame that is wanted now."""
    job = None if result is None else result.job
    if result is None or not isinstance(job, MomentScore) or job.request != lane.request or not result.is_whole:
        return lane
    return lane.with_values(result.value)

"""Which scores the runs of a page want, and which run an answer belongs to."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

from app.engine.jobs import Job, JobResult
from app.engine.requests import FrameRequest
from app.html.moment import Moment
from app.state.view_state import ViewState
from app.views.compare.html.run import RunShown, truth_of
from app.views.compare.jobs.scores import MOST_WINDOWS, MomentScore, ProtocolRun, Strip
from app.views.compare.state import CompareState
from app.views.page import RunFrame


def run_jobs(
    state: ViewState, moment: Moment, runs: Sequence[RunFrame], num_seen: Callable[[FrameRequest], int]
) -> dict[str, Job]:
    """The jobs of all runs, by slot. `num_seen`: how many frames of a request's playback exist."""
    compare = state.of(CompareState)
    asked = [(run, run.request) for run in runs if run.request is not None]
    match compare.inspector, compare.replays:
        case "runs", _:
            truths = [truth_of(moment, run.window, compare.offset) for run, _ in asked]
            return {
                slot_of("moment", run): MomentScore(request, compare.rule, truth.index if truth else None)
                for (run, request), truth in zip(asked, truths, strict=True)
            }
        case "scores", False:
            return {
                slot_of("strip", run): Strip(
                    replace(request.plain, index=0),
                    compare.rule,
                    compare.offset,
                    num_seen(request) if run.num_windows > MOST_WINDOWS else -1,
                )
                for run, request in asked
            }
        case "scores", True:
            return {
                slot_of("protocol", run): ProtocolRun(
                    replace(request.plain, index=0, cold_at=0, precision="fp32"), compare.rule
                )
                for run, request in asked
            }
    return {}


def slot_of(subject: str, run: RunShown | RunFrame) -> str:
    """Where a run's job stands."""
    return f"compare.{subject}.{run.number}"


def scored(run: RunShown, result: JobResult | None) -> RunShown:
    """The run with its values, if they are those of the frame that is wanted now."""
    job = None if result is None else result.job
    if result is None or not isinstance(job, MomentScore) or job.request != run.request or not result.is_whole:
        return run
    return run.with_values(result.value)

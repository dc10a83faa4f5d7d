"""Which scores the runs of a page want, and which run an answer belongs to."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

from app.catalogue.amount import amount_of
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
    """The jobs of all runs, by slot: the current frame's values first, then those over time.

    `num_seen`: how many frames of a request's playback exist.
    """
    compare = state.of(CompareState)
    jobs: dict[str, Job] = {}
    over_time: dict[str, Job] = {}
    for run in runs:
        if run.request is None:
            continue
        truth = truth_of(moment, run.window, compare.offset)
        jobs[slot_of("moment", run)] = MomentScore(run.request, compare.rule, truth.index if truth else None)
        plain = replace(run.request.plain, index=0)
        if run.run.replays:
            over_time[slot_of("time", run)] = ProtocolRun(plain, run.run.replays)
        else:
            seen = num_seen(run.request) if run.num_windows > MOST_WINDOWS else -1
            amount = amount_of(moment.recording)
            over_time[slot_of("time", run)] = Strip(plain, compare.rule, compare.offset, seen, amount)
    return jobs | over_time


def result_over_time(run: RunShown, compare: CompareState, results: Mapping[str, JobResult]) -> JobResult | None:
    """What is known of a run over time; nothing of what another network, rule or plan of windows gave."""
    result = results.get(slot_of("time", run))
    if result is None or run.request is None:
        return None
    plain = replace(run.request.plain, index=0)
    match result.job:
        case ProtocolRun(request, rule) if run.run.replays == rule and request == plain:
            return result
        case Strip(request, rule, offset) if not run.run.replays:
            return result if (request, rule, offset) == (plain, compare.rule, compare.offset) else None
    return None


def slot_of(subject: str, run: RunShown | RunFrame) -> str:
    """Where a run's job stands."""
    return f"compare.{subject}.{run.number}"


def scored(run: RunShown, result: JobResult | None) -> RunShown:
    """The run with its values, if they are those of the frame that is wanted now."""
    job = None if result is None else result.job
    if result is None or not isinstance(job, MomentScore) or job.request != run.request or not result.is_whole:
        return run
    return run.with_values(result.value)

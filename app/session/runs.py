"""One visitor's further runs: their windows are planned beside the page, each has its own request at the engine."""

from __future__ import annotations

import bisect
from collections import OrderedDict
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Protocol

from app.catalogue.cut import is_live, windows_of
from app.catalogue.threads import THREADS
from app.catalogue.visitor import VisitorCatalogue
from app.engine.denoised import CleanedRecordings
from app.engine.failures import in_words
from app.engine.playbacks import WARM_UP
from app.engine.queue import Deliver
from app.engine.replayed import FIRST, replayed_windows
from app.engine.requests import FrameRequest, Reply
from app.html.moment import Moment
from app.html.provenance import ModelFacts
from app.session.facts import facts_of
from app.session.frames import NewestFrames
from app.state.run import Rule, Run
from app.state.view_state import Limits, ViewState
from app.views.page import RunFrame
from etnet.errors import EtnetError, WindowError
from etnet.events.cleaning import UNCLEANED, Cleaning
from etnet.events.denoise import uncleaned
from etnet.events.recording import Recording
from etnet.windows import BetweenFrames, Policy, Window, from_window

MOST_RUNS = 3
"""Runs beside the main one that are computed."""
KEPT_PLANS = 4
"""Plans that are held; one of cleaned events holds four bytes an event."""


@dataclass(frozen=True, slots=True)
class RunPlan:
    """How a run cuts a recording, and from which stamp (µs) on it sees it; or the protocol that it replays."""

    recording_id: str
    policy: Policy
    cleaning: Cleaning = UNCLEANED
    cold_from: int | None = None
    replays: Rule | None = None


@dataclass(frozen=True, slots=True, eq=False)
class RunPlanned:
    """A letter: a run's windows, and the number of the first one in its policy's plan; or why there are none."""

    plan: RunPlan
    policy: Policy
    windows: Sequence[Window] = ()
    cold_at: int = 0
    trouble: str = ""
    recording: Recording | None = None
    """What was planned, before anything is filtered out of it: a recording that grows becomes another object."""

    def is_outgrown(self, recording: Recording) -> bool:
        """Whether more of the recording is there now. A protocol is about all of it, so it waits for the end."""
        if recording is self.recording or is_live(recording):
            return False
        return self.plan.replays is None or recording.latest is None


@dataclass(frozen=True, slots=True, eq=False)
class RunReply:
    """A letter: the engine's reply to the request of run `number` (1 is the first beside the main one)."""

    number: int
    reply: Reply


class RequestSink(Protocol):
    """The engine, as far as requests go."""

    def request(self, visitor: str, request: FrameRequest, deliver: Deliver) -> None:
        """Ask for something."""
        ...

    def drop(self, visitor: str) -> None:
        """Forget all requests and jobs of a visitor."""
        ...


class VisitorRuns:
    """Keeps what is asked of the engine equal to the runs of the view. Used by the visitor's thread alone."""

    def __init__(
        self,
        engine: RequestSink,
        catalogue: VisitorCatalogue,
        cleaned: CleanedRecordings,
        visitor: str,
        post: Callable[[RunPlanned | RunReply], None],
    ) -> None:
        self._engine = engine
        self._catalogue, self._cleaned = catalogue, cleaned
        self._visitor = visitor
        self._post = post
        self._answers = [NewestFrames() for _ in range(MOST_RUNS + 1)]
        self._asked: set[int] = set()
        self._plans: OrderedDict[RunPlan, RunPlanned] = OrderedDict()
        self._planning: set[RunPlan] = set()

    def take(self, letter: RunPlanned | RunReply) -> bool:
        """Fold one letter; whether it is news."""
        if isinstance(letter, RunReply):
            return letter.number in self._asked and self._answers[letter.number].take(letter.reply)
        self._planning.discard(letter.plan)
        self._plans[letter.plan] = letter
        while len(self._plans) > KEPT_PLANS:
            self._plans.popitem(last=False)
        return True

    def runs(
        self, state: ViewState, runs: Sequence[Run] | None, moment: Moment | None, main: NewestFrames
    ) -> tuple[RunFrame, ...]:
        """All runs at this moment, the main one first; none while `runs` is `None`. Plans what is not planned.

        The frames of the page itself are the main run's, unless that replays a protocol.
        """
        if runs is None or moment is None:
            self._plans.clear()
            return ()
        return tuple(
            self._shown(number, run, state, moment, main if _is_main(number, run) else self._answers[number])
            for number, run in enumerate(runs[: MOST_RUNS + 1])
        )

    def ask(self, runs: Sequence[RunFrame]) -> None:
        """Request every run's current frame; what is not shown any more is dropped."""
        wanted = {run.number: run.request for run in runs if run.request and not _is_main(run.number, run.run)}
        for number in self._asked - set(wanted):
            self.drop(number)
        for number, request in wanted.items():
            self._asked.add(number)
            if self._answers[number].ask(request):
                self._engine.request(self._run(number), request, self._reply_to(number))

    def drop(self, number: int) -> None:
        """Nothing more is computed for this run."""
        self._asked.discard(number)
        self._answers[number] = NewestFrames()
        self._engine.drop(self._run(number))

    def close(self) -> None:
        """The visitor has gone."""
        for number in list(self._asked):
            self.drop(number)

    def _run(self, number: int) -> str:
        return f"{self._visitor}/run{number}"

    def _reply_to(self, number: int) -> Deliver:
        return lambda reply: self._post(RunReply(number, reply))

    def _shown(self, number: int, run: Run, state: ViewState, moment: Moment, answers: NewestFrames) -> RunFrame:
        try:
            entry = self._catalogue.model(run.model_id or state.model_id)
        except EtnetError as error:
            return RunFrame(number, run, None, None, 0, ModelFacts(""), WARM_UP, trouble=str(error))
        facts, warm_up = facts_of(entry), entry.warm_up or WARM_UP
        # A protocol takes the events as they are, whatever the main run leaves out.
        as_main = UNCLEANED if run.replays else state.cleaning
        cleaning = as_main if run.cleaning is None else run.cleaning
        plan = RunPlan(state.recording_id, run.policy or moment.policy, cleaning, run.cold_from, run.replays)
        planned = self._planned(plan, moment)
        if planned is None or planned.trouble:
            trouble = planned.trouble if planned else ""
            return RunFrame(number, run, None, None, 0, facts, warm_up, trouble=trouble)
        # Windows may end at one stamp: in the main run's own plan the window is known.
        is_same_plan = planned.windows is moment.windows
        index = moment.index if is_same_plan else Limits(windows=planned.windows).index_at(moment.window.t_stop)
        request = FrameRequest(
            state.recording_id,
            entry.id,
            run.precision or state.precision,
            planned.policy,
            index,
            cleaning=cleaning,
            cold_at=planned.cold_at,
        )
        if _is_main(number, run) and answers.request is not None and answers.request.index == index:
            # The main run shows what was changed inside the network, and is scored so.
            intervention, edit, since, once = answers.request.change
            request = replace(request, intervention=intervention, edit=edit, since=since, once=once)
        ready = answers.ready
        if ready is not None and ready.request.playback != request.playback:
            ready = None  # what another network made would stand under this one's name
        window, num_windows = planned.windows[index], len(planned.windows)
        progress = ready, answers.working, answers.failed
        return RunFrame(number, run, request, window, num_windows, facts, warm_up, *progress)

    def _planned(self, plan: RunPlan, moment: Moment) -> RunPlanned | None:
        """The newest windows of a plan that are there; those that are not are planned beside the page."""
        if plan == RunPlan(moment.recording_id, moment.policy, moment.cleaning):
            return RunPlanned(plan, moment.policy, moment.windows)
        planned, recording = self._plans.get(plan), uncleaned(moment.recording)
        if planned is not None:
            self._plans.move_to_end(plan)
        if plan not in self._planning and (planned is None or planned.is_outgrown(recording)):
            self._planning.add(plan)
            THREADS.start(partial(self._plan, plan, recording, planned), "planning")
        return planned

    def _plan(self, plan: RunPlan, recording: Recording, former: RunPlanned | None = None) -> None:
        """`former`: the same plan when the recording was shorter."""
        try:
            planned = _planned_windows(plan, self._cleaned.of(recording, plan.cleaning), former)
        except Exception as error:  # whatever it was, a page that waits is told
            planned = RunPlanned(plan, plan.policy, trouble=in_words(error, self))
        self._post(replace(planned, recording=recording))


def _is_main(number: int, run: Run) -> bool:
    """Whether a run is what the rest of the page shows."""
    return number == 0 and run == Run()


def _planned_windows(plan: RunPlan, recording: Recording, former: RunPlanned | None) -> RunPlanned:
    """The windows of a plan. Raises EtnetError, in words for the page, where there are none."""
    needs_frames = plan.replays is not None or isinstance(plan.policy, BetweenFrames)
    if needs_frames and not recording.ground_truth:
        what = "no protocol can score it" if plan.replays else "its events cannot be cut between them"
        raise WindowError(f"This recording has no camera frames, so {what}.")
    if (plan.cold_from is not None or plan.replays) and is_live(recording):
        raise WindowError("A run from a cold start needs a whole recording: record, and open the file.")
    if plan.replays is not None:
        policy = replayed_windows(recording, plan.replays)
        return RunPlanned(plan, policy, from_window(windows_of(recording, policy), FIRST), FIRST)
    windows, cold_at = windows_of(recording, plan.policy, _taken_over(former)), 0
    if plan.cold_from is not None:
        cold_at = bisect.bisect_left(windows, plan.cold_from, key=lambda window: window.t_start)
    if cold_at >= len(windows):
        raise WindowError("No window begins after this moment; start cold earlier.")
    return RunPlanned(plan, plan.policy, from_window(windows, cold_at), cold_at)


def _taken_over(former: RunPlanned | None) -> Sequence[Window]:
    """The windows of a former plan that stay as they are: from the first one on, and made while more was to come."""
    if former is None or former.cold_at or former.recording is None or former.recording.latest is None:
        return ()
    return former.windows

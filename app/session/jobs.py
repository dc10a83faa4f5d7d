"""One visitor's jobs: which are asked, and what is known of each."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Protocol

from app.engine.jobs import Job, JobResult, Tell, is_ordered
from app.state.view_state import ViewState


@dataclass(frozen=True, slots=True, eq=False)
class JobNews:
    """A letter to the visitor's thread: news of the job in a slot."""

    slot: str
    result: JobResult


class JobSink(Protocol):
    """The engine, as far as jobs go."""

    def job(self, visitor: str, slot: str, job: Job, tell: Tell) -> None:
        """Ask; replaces what stood in the slot."""
        ...

    def drop_job(self, visitor: str, slot: str) -> None:
        """Forget what stands in the slot."""
        ...


class VisitorJobs:
    """Keeps what is asked equal to what is wanted. Used by the visitor's thread alone."""

    def __init__(self, engine: JobSink, visitor: str, post: Callable[[JobNews], None]) -> None:
        self._engine = engine
        self._visitor = visitor
        self._post = post
        self._asked: dict[str, Job] = {}
        self._basis: ViewState | None = None
        self._passing: tuple[int | None, Mapping[str, Job]] = None, {}
        """The window of the last look at a source that is followed, and what was wanted there."""
        self.results: dict[str, JobResult] = {}
        """The newest news by slot. While a changed question is worked on, the answer to the last one stays: compare
        `result.job` with what is shown to tell."""

    def ask(self, state: ViewState, is_moving: bool, jobs: Callable[[], Mapping[str, Job]]) -> None:
        """Ask what a page wants, which `jobs` tells. While windows pass, nothing new is asked, and what is no longer
        wanted is looked for only where more than the window has changed."""
        basis = replace(state, index=0)
        if is_moving and basis == self._basis:
            return
        self._basis = basis
        (self.keep if is_moving else self.want)(jobs())

    def want(self, jobs: Mapping[str, Job]) -> None:
        """Ask what is new, drop what is no longer wanted."""
        for slot in [slot for slot in self._asked if slot not in jobs]:
            del self._asked[slot]
            self.results.pop(slot, None)
            self._engine.drop_job(self._visitor, slot)
        for slot, job in jobs.items():
            if self._asked.get(slot) != job:
                self._asked[slot] = job
                self._engine.job(self._visitor, slot, job, lambda slot, result: self._post(JobNews(slot, result)))

    def keep(self, jobs: Mapping[str, Job]) -> None:
        """Drop what is no longer wanted; ask nothing new but for files that were ordered."""
        asked = {slot: job for slot, job in self._asked.items() if slot in jobs}
        self.want(asked | {slot: job for slot, job in jobs.items() if is_ordered(job)})

    def follow(self, jobs: Mapping[str, Job], index: int) -> None:
        """The same while a source is followed, which never comes to rest: what is wanted at one window (`index`) and at
        the next one all the same, a pin or an ordered file, is asked."""
        before, last = self._passing
        if index != before:
            self._passing = index, jobs
        stays = {slot: job for slot, job in jobs.items() if index != before and last.get(slot) == job}
        self.want({**{slot: job for slot, job in self._asked.items() if slot in jobs}, **stays})

    def take(self, found: JobNews) -> bool:
        """Fold one letter; whether it is about what is asked now."""
        if self._asked.get(found.slot) != found.result.job:
            return False
        self.results[found.slot] = found.result
        return True

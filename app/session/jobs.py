"""One visitor's jobs: which are asked, and what is known of each."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Protocol

from app.engine.jobs import Job, JobResult, Tell, is_ordered


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
        self.results: dict[str, JobResult] = {}
        """The newest news by slot. While a changed question is worked on, the answer to the last one stays: compare
        `result.job` with what is shown to tell."""

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

    def take(self, found: JobNews) -> bool:
        """Fold one letter; whether it is about what is asked now."""
        if self._asked.get(found.slot) != found.result.job:
            return False
        self.results[found.slot] = found.result
        return True

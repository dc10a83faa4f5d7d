"""Many recordings over many processes: who does which, what is done already, how long the rest takes.

The processes are started by torchrun, by SLURM or by hand; they agree because each deals the same list in the same way.
Names and totals alone pass between them, through the output folder.
"""

from __future__ import annotations

import contextlib
import hashlib
import json
import os
import re
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from etnet.cli.progress import SAYS_EVERY, console
from etnet.errors import EtnetError
from etnet.files import claimed, printable, write_atomically
from etnet.plain_values import bounded_json

Work = Callable[[Path, Path, Callable[[float], None]], int]
"""(recording, its output folder, told the fraction done) → how many frames, or what else there is, were written. Raises
where it fails."""

DONE, FAILED, CLAIM = "done.json", "failed.txt", ".claim"
_LONGEST_NOTE = 1 << 20
"""Bytes of what is noted of a finished recording."""


@dataclass(frozen=True, slots=True)
class Share:
    """This process among those that do the work: `rank` of `size`."""

    rank: int = 0
    size: int = 1


def this_share(environment: Mapping[str, str] = os.environ) -> Share:
    """Who this process is: by torchrun's RANK and WORLD_SIZE, SLURM's tasks, or SLURM's job array; else alone."""
    for rank, size, first in (
        ("RANK", "WORLD_SIZE", ""),
        ("SLURM_ARRAY_TASK_ID", "SLURM_ARRAY_TASK_COUNT", "SLURM_ARRAY_TASK_MIN"),
        ("SLURM_PROCID", "SLURM_NTASKS", ""),
    ):
        if rank not in environment or size not in environment:
            continue
        try:
            share = Share(int(environment[rank]) - int(environment.get(first, "0")), int(environment[size]))
        except ValueError:
            share = Share(-1, 0)
        if not 0 <= share.rank < share.size:
            raise EtnetError(
                f"{rank} is {environment[rank]} and {size} {environment[size]}; wanted a number from 0 and how many "
                "there are: a job array counts without gaps (--array=0-7)"
            )
        if share.size > 1 or first == "":
            return share
    return Share()


@dataclass(frozen=True, slots=True)
class Job:
    """One recording or video, the folder that its output goes to, and its size, by which work is dealt."""

    path: Path
    folder: Path
    nbytes: int
    mtime_ns: int = 0
    """When it was changed last."""


def jobs_of(recordings: Sequence[Path], out: Path) -> tuple[Job, ...]:
    """One job a recording. Where two have one name, a part of the hash of their paths tells their folders apart."""
    stems = [path.stem if path.is_file() else re.sub(r"[*?\[\]]+", "_", path.name) for path in recordings]
    jobs = []
    for path, stem in zip(recordings, stems, strict=True):
        mark = "" if stems.count(stem) == 1 else f"-{hashlib.sha256(str(path.resolve()).encode()).hexdigest()[:6]}"
        statuses = [file.stat() for file in files_of(path, out)]
        newest = max((status.st_mtime_ns for status in statuses), default=0)
        jobs.append(Job(path, out / f"{stem}{mark}", sum(status.st_size for status in statuses), newest))
    return tuple(jobs)


def files_of(path: Path, out: Path) -> list[Path]:
    """A file, the files below a folder, or those of a pattern, without what a command writes into `out` below it."""
    if path.is_file():
        return [path]
    found = [each for each in (path.rglob("*") if path.is_dir() else path.parent.glob(path.name)) if each.is_file()]
    folder, out = path.resolve(), out.resolve()
    if out == folder or not out.is_relative_to(folder):
        return found
    return [each for each in found if not each.resolve().is_relative_to(out)]


def dealt(jobs: Sequence[Job], share: Share) -> tuple[Job, ...]:
    """This process's jobs, the largest first: each goes to whom the fewest bytes were dealt so far."""
    loads, mine = [0] * share.size, []
    for job in sorted(jobs, key=lambda job: (-job.nbytes, str(job.folder))):
        rank = loads.index(min(loads))
        loads[rank] += max(job.nbytes, 1)
        if rank == share.rank:
            mine.append(job)
    return tuple(mine)


@dataclass
class Remaining:
    """How long the rest takes, from what was done so far: bytes at the mean speed since the start.

    What another process is at, and what it had finished meanwhile, is taken off the total.
    """

    total: int
    clock: Callable[[], float] = time.monotonic
    done: float = 0.0
    started: float = field(default=0.0, init=False)

    def __post_init__(self) -> None:
        self.started = self.clock()

    def seconds(self, fraction: float = 0.0, of: int = 0) -> float | None:
        """Seconds to the end, with `fraction` of a job of `of` bytes done beside what is finished; None: unknown."""
        done = self.done + fraction * of
        return None if done <= 0 else (self.clock() - self.started) * (self.total - done) / done


def run_many(
    jobs: Sequence[Job], share: Share, settings: str, work: Work, anew: bool = False, counts: str = "frames"
) -> int:
    """Do this process's part of `jobs`; 1 when any of it failed, and the failures are named at the end.

    A job that was finished with the same `settings` is not done again, unless all are to be done `anew`; one that
    another process is at is left to it. `counts` is what `work`'s number is called.
    """
    mine = dealt(jobs, share)
    for job in mine if anew else ():
        (job.folder / DONE).unlink(missing_ok=True)
    waiting = [job for job in mine if not is_done(job, settings)]
    _say(f"{len(mine)} of {len(jobs)} recordings are this process's; {len(mine) - len(waiting)} are done already")
    remaining, failures = Remaining(sum(max(job.nbytes, 1) for job in waiting)), []
    for number, job in enumerate(waiting, start=1):
        label = f"[{number}/{len(waiting)}] {job.path.name}"
        nbytes, is_worked = max(job.nbytes, 1), True
        try:
            job.folder.mkdir(parents=True, exist_ok=True)
            with claimed(job.folder / CLAIM) as is_ours:
                is_worked = is_ours and not is_done(job, settings)
                if not is_ours:
                    _say(f"{label}: another process is at it")
                elif is_worked:
                    counted = work(job.path, job.folder, _Telling(label, job, remaining))
                    _finish(job, settings, {counts: counted})
        except Exception as error:  # whatever it is, it is this recording's and ends no other
            said = str(error) if isinstance(error, EtnetError) else f"{type(error).__name__}: {error}"
            failures.append((job, said))
            _note_failure(job, said)
            _say(f"{label}: failed, {said}")
        if not is_worked:
            remaining.total -= nbytes
            continue
        remaining.done += nbytes
        rest = remaining.seconds()
        if rest is not None and number < len(waiting):
            _say(f"{label}: done; all of this process's in about {in_words(rest)}")
    num_done = sum(is_done(job, settings) for job in jobs)
    _say(f"{num_done} of {len(jobs)} recordings are done" + (f", {len(failures)} failed:" if failures else ""))
    for job, error in failures:
        _say(f"  {job.path}: {error}")
    return 1 if failures else 0


def is_done(job: Job, settings: str) -> bool:
    """Whether the job was finished with these settings from the file as it is."""
    done = note_of(job.folder)
    return all(done.get(name) == value for name, value in _sign_of(job, settings).items())


def note_of(folder: Path) -> Mapping[str, object]:
    """What is noted of the recording that a command finished in a folder; empty where none did."""
    try:
        done = bounded_json((folder / DONE).read_bytes(), _LONGEST_NOTE)
    except (OSError, ValueError):
        return {}
    return done if isinstance(done, dict) else {}


def _sign_of(job: Job, settings: str) -> dict[str, str | int]:
    return {"bytes": job.nbytes, "mtime_ns": job.mtime_ns, "settings": settings}


def in_words(seconds: float) -> str:
    """A time to wait, as one says it."""
    if seconds < 90:
        return f"{max(round(seconds), 1)} s"
    return f"{round(seconds / 60)} min" if seconds < 5400 else f"{seconds / 3600:.1f} h"


class _Telling:
    """A line a minute on how far a job is and when all are done."""

    def __init__(self, label: str, job: Job, remaining: Remaining) -> None:
        self._label, self._job, self._remaining = label, job, remaining
        self._said = remaining.clock()

    def __call__(self, fraction: float) -> None:
        if self._remaining.clock() - self._said < SAYS_EVERY:
            return
        self._said = self._remaining.clock()
        rest = self._remaining.seconds(fraction, max(self._job.nbytes, 1))
        when = "" if rest is None else f"; all of this process's in about {in_words(rest)}"
        _say(f"{self._label}: {fraction:.0%}{when}")


def _note_failure(job: Job, said: str) -> None:
    with contextlib.suppress(OSError):
        (job.folder / FAILED).write_text(f"{said}\n")


def _finish(job: Job, settings: str, counted: Mapping[str, int]) -> None:
    (job.folder / FAILED).unlink(missing_ok=True)
    done = {"recording": printable(job.path.name), **counted, **_sign_of(job, settings)}
    write_atomically(job.folder / DONE, (json.dumps(done, indent=1) + "\n").encode())


def _say(line: str) -> None:
    console.print(line, markup=False, highlight=False, soft_wrap=True)

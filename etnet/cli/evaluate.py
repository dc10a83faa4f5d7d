"""`etnet evaluate`: score models on recordings under a named protocol; resumable, shared out by torchrun."""

from __future__ import annotations

import hashlib
import json
import re
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import tyro
from rich.markup import escape

from etnet.cli import many
from etnet.cli.labels import labels_of
from etnet.cli.many import Share, this_share
from etnet.cli.many_sources import recordings_in
from etnet.cli.progress import console, fraction_callback
from etnet.cli.recording import Opening, open_with_progress
from etnet.errors import EtnetError, RecordingError, WeightsError
from etnet.files import claimed, printable, write_atomically
from etnet.plain_values import PlainError, bounded_json

if TYPE_CHECKING:
    from etnet.evaluation.evaluate import Judges
    from etnet.evaluation.protocol import Part
    from etnet.evaluation.report import Failure, Report
    from etnet.evaluation.scores import Scores
    from etnet.nets.presets import Network

_LONGEST_FAILURES = 16 << 20
"""Bytes of one process's list of failures."""
_WRITTEN = re.compile(r"scores/.*|\.?(failures_\d+\.json|report\.(json|md|svg))(\..*)?", re.DOTALL)
"""Below --out, what this command writes, unfinished files included."""
_CHANGED = "the recording or the weights changed while it was scored; run it again"
RULES = 1
"""Raised when a score would come out differently for the same inputs: old results are then computed again."""


@dataclass(frozen=True)
class Evaluate:
    """Score every model on every recording. What is done is kept under --out, so that a second call goes on."""

    items: tyro.conf.Positional[tuple[str, ...]] = ()
    """Models (bundled names, .safetensors files) and recordings with ground truth (files, folders, zips, and folders of
    them), mixed. None at all: the bundled models on the bundled samples."""
    protocol: Literal["paper", "evreal"] = "paper"
    """paper: ET-Net's evaluation code. evreal: EVREAL's."""
    out: Path = Path("evaluation")
    """Folder for scores/, report.md, report.json and report.svg."""
    device: str = "cpu"
    whole: bool = False
    """Score all frames of a known test sequence, not only its cut."""
    begin: Annotated[float | None, tyro.conf.arg(name="from")] = None
    """Seconds since the first event: frames from it on are scored, in place of a known sequence's cut. The protocol's
    cold start or warm-up is before it, and the report says so."""
    end: Annotated[float | None, tyro.conf.arg(name="to")] = None
    """Seconds since the first event: frames up to it are scored. Default: the end."""
    judge: Literal["auto", "alex", "vgg"] = "auto"
    """auto: LPIPS-VGG beside LPIPS-Alex when its weights are installed. alex: never. vgg: insist."""
    flow: Literal["auto", "file"] = "auto"
    """Temporal consistency without flow in the file. auto: estimate it with DIS. file: print n/a."""
    opening: Annotated[Opening, tyro.conf.arg(name="")] = field(default_factory=Opening)

    def part(self) -> Part | None:
        """The stretch that is scored, where one was named."""
        from etnet.evaluation.protocol import Part

        return None if self.begin is self.end is None else Part(self.begin, self.end)


@dataclass(frozen=True)
class Job:
    """One model on one recording."""

    model: str
    recording: Path
    target: Path
    labels: tuple[str, str]
    """The model's and the recording's names in the report, which no other model or recording of this call has."""

    @property
    def file(self) -> str:
        """The recording's file, as it is said."""
        return printable(Path(self.labels[1]).parent / self.recording.name)

    def failed(self, reason: str) -> Failure:
        """As the report names it."""
        from etnet.evaluation.report import Failure

        return Failure(printable(self.model), self.file, reason)


class _Models:
    """The network that was loaded last, and the digests of the weights of all that were."""

    def __init__(self, device: str) -> None:
        self._device = device
        self._last: tuple[str, Network] | None = None
        self._digests: dict[str, str] = {}

    def load(self, name: str) -> Network:
        """The network; the one before is let go."""
        if self._last is None or self._last[0] != name:
            self._last = None
            self._last = (name, _load(name, self._device))
            self._digests[name] = _weights_digest(self._last[1])
        return self._last[1]

    def digest(self, name: str) -> str:
        """Of its weights and its architecture."""
        if name not in self._digests:
            self.load(name)
        return self._digests[name]


def run(config: Evaluate) -> int:
    """Do it; 1 when any pair failed, and the report names it."""
    if config.whole and config.part() is not None:
        raise EtnetError("--whole scores all frames, --from and --to some of them; give one of the two")
    models, recordings = sort_items(config.items, config.out) if config.items else _bundled()
    jobs = _jobs(config, models, recordings)
    share = this_share()
    mine = _dealt(jobs, share, config.out)
    judges = _judges(config)
    _forget_failures(config.out, share.rank, share.size)
    failures: list[tuple[Job, str]] = []
    scored: list[Job] = []
    networks = _Models(config.device)
    for number, job in enumerate(jobs):
        if job not in mine:
            continue
        label = f"[{number + 1}/{len(jobs)}] {job.model} on {job.file}"
        try:
            with claimed(job.target.with_name(f".{job.target.stem}.claim")) as is_ours:
                if not is_ours:
                    _say(f"{label}: another process is at it")
                    continue
                scores = _score(config, job, networks, judges, label)
            scored.append(job)
            _say(f"{label}: LPIPS {scores.mean('lpips'):.4f}, {scores.num_frames} frames")
        except Exception as error:  # whatever it is, it is this pair's and ends no other
            said = str(error) if isinstance(error, EtnetError) else f"{type(error).__name__}: {error}"
            failures.append((job, said))
            _say(f"{label}: failed, {said}")
    # Nobody else would say so: the scores lie there, and pass for some that another process is still to renew.
    failures += [(job, _CHANGED) for job in scored if _kept(config, job, judges, networks) is None]
    _write_failures(config.out, share.rank, failures)
    for job, said in failures:
        _say(f"  {job.model} on {job.file}: {said}")
    report = _collect(config, jobs, judges, networks)
    if report is None:
        _say("other processes are still at work; the last one writes the report")
        return 1 if failures else 0
    _write_report(report, config.out)
    return 1 if report.failures else 0


def _dealt(jobs: list[Job], share: Share, out: Path) -> set[Job]:
    """This process's jobs: recordings weigh as much as their files, and every model has the same recordings."""
    by_folder = {job.target: job for job in jobs}
    sized = [many.Job(job.recording, job.target, _nbytes_of(job.recording, out)) for job in jobs]
    return {by_folder[job.folder] for job in many.dealt(sized, share)}


def sort_items(items: tuple[str, ...], out: Path) -> tuple[list[str], list[Path]]:
    """Models and recordings apart: a bundled name, a preset's or a weights file is a model; the rest must exist.

    A folder that is no recording stands for those in it; what lies in `out` is none.
    """
    from etnet.bundled import models as bundled
    from etnet.nets.presets import PRESETS, UNTRAINED

    names = {path.stem for path in bundled()} | set(PRESETS) | set(UNTRAINED)
    models = [item for item in items if item in names or Path(item).suffix in (".safetensors", ".pth", ".pt", ".tar")]
    recordings = [Path(item) for item in items if item not in models]
    absent = next((path for path in recordings if not path.exists()), None)
    if absent is not None:
        raise RecordingError(f"{absent}: neither a file nor a model; models are {', '.join(sorted(names))}")
    if not models:
        raise WeightsError(f"no model among {len(items)} items; name one, e.g. etnet-half")
    if not recordings:
        raise RecordingError(f"no recording among {len(items)} items; name at least one file with ground truth")
    return models, [found for path in recordings for found in _recordings(path, out)]


def _recordings(path: Path, out: Path) -> tuple[Path, ...]:
    """A folder with one recording among other files is opened as a whole: its pictures may lie beside the events."""
    found = recordings_in((path,), out) if path.is_dir() else (path,)
    return found if len(found) > 1 else (path,)


def _bundled() -> tuple[list[str], list[Path]]:
    from etnet.bundled import models, samples

    return [path.stem for path in models()], list(samples())


def _jobs(config: Evaluate, models: list[str], recordings: list[Path]) -> list[Job]:
    folder = config.out / "scores"
    folder.mkdir(parents=True, exist_ok=True)
    # What was named twice is one.
    models = list({Path(model).resolve(): model for model in models}.values())
    recordings = list({recording.resolve(): recording for recording in recordings}.values())
    shown, labels = labels_of(map(Path, models)), labels_of(recordings)
    jobs = []
    for recording in recordings:
        for model in models:
            # Two files of one name in two folders must not share a result.
            told = f"{Path(model).resolve()}\n{recording.resolve()}{config.part() or ''}"
            where = hashlib.sha256(told.encode()).hexdigest()[:8]
            words = [re.sub(r"[^\w+-]+", "_", Path(part).stem) for part in (model, str(recording))]
            target = folder / f"{words[0]}__{words[1]}__{config.protocol}__{where}.json"
            jobs.append(Job(model, recording, target, (shown[Path(model)], labels[recording])))
    return jobs


def _judges(config: Evaluate) -> Judges:
    from etnet.evaluation.evaluate import Judges
    from etnet.evaluation.judge import find_judge_file, load_judge
    from etnet.evaluation.lpips import load_lpips

    takes_second = config.judge == "vgg" or (config.judge == "auto" and find_judge_file() is not None)
    second = load_judge().to(config.device) if takes_second else None
    return Judges(load_lpips().to(config.device), second)


def _load(model: str, device: str) -> Network:
    from etnet.nets.weights import load_model

    return load_model(model, device)


def _score(config: Evaluate, job: Job, networks: _Models, judges: Judges, label: str) -> Scores:
    from etnet.evaluation.evaluate import evaluate
    from etnet.evaluation.protocol import PROTOCOLS
    from etnet.evaluation.scores import read_scores, write_scores

    model = networks.load(job.model)
    key = _key(config, job, judges, networks.digest(job.model))
    kept = read_scores(job.target, key)
    if kept is not None:
        return kept
    recording = open_with_progress(job.recording, config.opening)
    with recording, fraction_callback(escape(label)) as progress:
        scores = evaluate(
            model,
            recording,
            PROTOCOLS[config.protocol],
            judges,
            whole=config.whole,
            estimates_flow=config.flow == "auto",
            name=job.labels[0],
            on_progress=progress,
            part=config.part(),
        )
    write_scores(scores, job.target, key)
    return scores


def _key(config: Evaluate, job: Job, judges: Judges, weights: str) -> str:
    """All that the numbers depend on."""
    files = _files_of(job.recording, config.out) or [job.recording]
    stats = [(path.name, path.stat().st_size, path.stat().st_mtime_ns) for path in files]
    kind, _, _ = config.device.partition(":")  # each process may have a GPU of its own
    choices = [config.protocol, config.whole, config.flow, kind, repr(config.opening)]
    choices += [] if config.part() is None else [str(config.part())]
    judged = "alex+vgg" if judges.lpips_vgg else "alex"
    facts = [RULES, choices, judged, weights, stats]
    return hashlib.sha256(json.dumps(facts).encode()).hexdigest()


def _files_of(recording: Path, out: Path) -> list[Path]:
    """The recording's files, in order, without what this command writes where --out lies in its folder, or is it."""
    if not recording.is_dir():
        return [recording]
    folder, out = recording.resolve(), out.resolve()
    files = sorted(path for path in folder.rglob("*") if path.is_file())
    if not out.is_relative_to(folder):
        return files
    return [path for path in files if not (path.is_relative_to(out) and _is_written(path.relative_to(out)))]


def _is_written(path: Path) -> bool:
    return _WRITTEN.fullmatch(path.as_posix()) is not None


def _nbytes_of(recording: Path, out: Path) -> int:
    return sum(path.stat().st_size for path in _files_of(recording, out))


def _weights_digest(model: Network) -> str:
    digest = hashlib.sha256(repr(model.config).encode())
    for name, tensor in sorted(model.state_dict().items()):
        digest.update(name.encode())
        digest.update(tensor.cpu().contiguous().numpy().tobytes())
    return digest.hexdigest()


def _kept(config: Evaluate, job: Job, judges: Judges, networks: _Models) -> Scores | None:
    """The pair's scores, if they are of its weights and its recording as they are now."""
    from etnet.evaluation.scores import read_scores

    try:
        key = _key(config, job, judges, networks.digest(job.model))
    except (EtnetError, OSError):
        return None
    return read_scores(job.target, key)


def _collect(config: Evaluate, jobs: list[Job], judges: Judges, networks: _Models) -> Report | None:
    """The report once every job has ended, in success or failure; None before."""
    from etnet.evaluation.report import Report

    failed = dict(_read_failures(config.out))
    if not all(job.target.name in failed or job.target.exists() for job in jobs):
        return None
    scores: list[Scores] = []
    failures: list[Failure] = []
    for job in jobs:
        if job.target.name in failed:
            failures.append(job.failed(failed[job.target.name]))
            continue
        read = _kept(config, job, judges, networks)
        if read is None:
            return None  # it changed since it was scored; whose job it is will say so
        scores.append(replace(read, model=job.labels[0], recording=job.labels[1]))
    return Report(config.protocol, tuple(scores), tuple(failures))


def _forget_failures(out: Path, rank: int, num_ranks: int) -> None:
    """Remove what an earlier call left: one's own list; the first process also those of more processes than now."""
    for path in out.glob("failures_*.json"):
        writer = int(path.stem.removeprefix("failures_"))
        if writer == rank or (rank == 0 and writer >= num_ranks):
            path.unlink()


def _write_failures(out: Path, rank: int, failures: list[tuple[Job, str]]) -> None:
    rows = [[job.target.name, printable(said)] for job, said in failures]
    _write_text(out / f"failures_{rank}.json", json.dumps(rows))


def _read_failures(out: Path) -> Iterator[tuple[str, str]]:
    """The name of the file that each pair's scores would be in, and why there are none."""
    for path in sorted(out.glob("failures_*.json")):
        try:
            rows = bounded_json(path.read_bytes(), _LONGEST_FAILURES)
            is_list = isinstance(rows, list) and all(isinstance(row, list) and len(row) == 2 for row in rows)
            if not is_list or not all(isinstance(word, str) for row in rows for word in row):
                raise PlainError("is no list of failures")
        except (PlainError, OSError) as error:
            raise EtnetError(f"{path.name}: cannot be read (it {error}); delete the file") from None
        yield from ((name, said) for name, said in rows)


def _write_report(report: Report, out: Path) -> None:
    from etnet.evaluation.plot import plot_scores

    _write_text(out / "report.json", json.dumps(report.to_json(), ensure_ascii=False, allow_nan=False, indent=1))
    _write_text(out / "report.md", report.to_markdown())
    if report.scores:
        _write_text(out / "report.svg", plot_scores(report.scores))
        console.print(report.to_table())
    for note in report.notes():
        _say(note)
    _say(f"wrote {out / 'report.md'}, report.json and report.svg")


def _write_text(path: Path, text: str) -> None:
    write_atomically(path, text.encode())


def _say(text: str) -> None:
    # File names may hold brackets, which rich would take for markup.
    console.print(text, markup=False, soft_wrap=True)

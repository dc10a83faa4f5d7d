"""A session file: all that decides the bits of some frames, and the frames' hashes, so that another run can be held
against it. It carries names and hashes, never a path.
"""

from __future__ import annotations

import dataclasses
import hashlib
import json
import re
from collections.abc import Generator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, get_args

import numpy as np
import torch
from torch import nn

from etnet.bundled import samples
from etnet.errors import EtnetError, RecordingError, WeightsError
from etnet.events.opened_as import OpenedAs
from etnet.events.recording import Recording
from etnet.export.take import IsCancelled, Progress, Take
from etnet.files import in_megabytes, write_atomically
from etnet.nets.fingerprint import weights_sha256
from etnet.nets.intervention import Intervention
from etnet.nets.runtime import Contract, Runtime, apply_runtime, contract_of
from etnet.plain_values import PlainError, bounded_json, made_of
from etnet.playback.playback import Playback
from etnet.windows import Policy, plan_windows

FORMAT = "etnet-session-2"
OLDER_FORMAT = "etnet-session-1"
"""Read, too: it does not say how the recording was opened."""
READ_EVENTS = 1 << 20
"""Events hashed at a time."""
LARGEST_FILE = 16 << 20
"""Bytes of a session file: 239,000 frames."""
MOST_THREADS = 1024
HASH_BYTES = 70
"""Of one frame in the file."""
_HASH = re.compile(r"[0-9a-f]{64}")
_POLICIES: dict[str, type[Policy]] = {kind.__name__: kind for kind in get_args(Policy)}


@dataclass(frozen=True, slots=True)
class Change:
    """An intervention that holds from window `at` on."""

    at: int
    intervention: Intervention


@dataclass(frozen=True, slots=True)
class Session:
    """Windows `start` … `start + len(frames)` − 1 of a recording under a model, as they came out under `contract`."""

    recording: str
    """The file's name, to look for it."""
    events_sha256: str
    model: str
    weights_sha256: str
    policy: Policy
    start: int
    frames: tuple[str, ...]
    """SHA-256 of each raw frame (fp32, little endian)."""
    contract: Contract
    change: Change | None = None
    seeds: Mapping[str, int] = field(default_factory=dict)
    """What was drawn at random before the events were there, as their maker says (a simulator's). Rendering draws
    nothing, so the command line and the viewer, which render a recording that is there, leave it empty."""
    opened: OpenedAs | None = None
    """How the recording's file was opened; `None` where that is not known (events in memory, an older session)."""


@dataclass(frozen=True, slots=True)
class Verdict:
    """What a check found: windows whose frames differ, and where the contracts do, in words."""

    num_frames: int
    differing: tuple[int, ...]
    contract_differences: tuple[str, ...]

    @property
    def holds(self) -> bool:
        """Whether every frame came out again to the bit."""
        return not self.differing


def record_session(
    take: Take,
    policy: Policy,
    change: Change | None = None,
    seeds: Mapping[str, int] | None = None,
    progress: Progress | None = None,
    is_cancelled: IsCancelled | None = None,
) -> Session:
    """Render the take and write down what made it.

    Raises:
        EtnetError: of so many windows no session could be read again.
    """
    model: Any = take.playback.model
    recording = take.recording
    if len(take) * HASH_BYTES > LARGEST_FILE:
        most = LARGEST_FILE // HASH_BYTES
        raise EtnetError(
            f"{recording.name}: a session holds {most:,} windows at most, got {len(take):,}; choose a range"
        )
    return Session(
        recording=recording.path.name if recording.path is not None else recording.name,
        events_sha256=events_sha256(recording),
        model=take.playback.model.name,
        weights_sha256=weights_sha256(model),
        policy=policy,
        start=take.start,
        frames=_frame_hashes(take, change, progress, is_cancelled),
        contract=contract_of(model),
        change=change,
        seeds=dict(seeds or {}),
        opened=recording.opened_as,
    )


def check_session(
    session: Session,
    recording: Recording,
    model: nn.Module,
    progress: Progress | None = None,
    is_cancelled: IsCancelled | None = None,
) -> Verdict:
    """Render again, under as much of the session's contract as this machine can take on, and compare every frame.

    Another recording or other weights are an error: their frames could not be compared.
    """
    require_recording(session, recording)
    if (found := weights_sha256(model)) != session.weights_sha256:
        raise WeightsError(
            f"{model.name}: its weights hash to {found[:12]}…, the session's to {session.weights_sha256[:12]}…; "
            "give the weights file that the session was made with"
        )
    playback = Playback(model, recording, plan_windows(recording, session.policy))  # pyright: ignore[reportArgumentType]
    with adopted(session.contract, model) as contract:
        take = Take(playback, session.start, session.start + len(session.frames))
        frames = _frame_hashes(take, session.change, progress, is_cancelled)
    pairs = enumerate(zip(session.frames, frames, strict=True), session.start)
    differing = tuple(i for i, (there, here) in pairs if there != here)
    return Verdict(len(frames), differing, contract_differences(session.contract, contract))


def require_recording(session: Session, recording: Recording) -> None:
    """Raises RecordingError if these are not the session's events."""
    if (found := events_sha256(recording)) != session.events_sha256:
        raise RecordingError(
            f"{recording.name}: its events hash to {found[:12]}…, the session's to {session.events_sha256[:12]}…; "
            "it is another recording, or was opened otherwise (--region, --downsample, --filter, --sort and the like)"
        )


def find_recording(session: Session, folders: Sequence[Path], remedy: str) -> Path:
    """The file of the session's name in one of the folders, or a bundled one; `remedy` ends the error if there is none.

    Only the name's last part counts: a session file may not point anywhere else.
    """
    name = Path(session.recording).name
    bundled = [path for path in samples() if path.name == name]
    for path in (*(folder / name for folder in folders), *bundled):
        if name and path.exists():
            return path
    raise RecordingError(f"{name}: the session's recording is not beside it, here, or bundled; {remedy}")


def contract_differences(there: Contract, here: Contract) -> tuple[str, ...]:
    """One line for each point in which two contracts differ."""

    def points(contract: Contract) -> dict[str, object]:
        listed = dataclasses.asdict(contract)
        return {**listed.pop("runtime"), **listed}

    ours = points(here)
    return tuple(
        f"{name}: {value} there, {ours[name]} here" for name, value in points(there).items() if value != ours[name]
    )


@contextmanager
def adopted(contract: Contract, model: nn.Module) -> Generator[Contract]:
    """Run under `contract`'s precision, attention path, memory format and threads; gives the contract that results."""
    before: Runtime = model.runtime  # pyright: ignore[reportAssignmentType, reportAttributeAccessIssue]
    threads = torch.get_num_threads()
    try:
        apply_runtime(model, contract.runtime)
        torch.set_num_threads(contract.threads)
        yield contract_of(model)
    finally:
        apply_runtime(model, before)
        torch.set_num_threads(threads)


def events_sha256(recording: Recording) -> str:
    """A hash of size and events (x, y, p and t from the first), the same in whatever format they are stored."""
    digest = hashlib.sha256(f"{recording.sensor.width} {recording.sensor.height} {recording.num_events}".encode())
    for start in range(0, recording.num_events, READ_EVENTS):
        events = recording.read(start, min(start + READ_EVENTS, recording.num_events))
        for column, kind in (
            (events.x, "<u2"),
            (events.y, "<u2"),
            (events.t - recording.span.start, "<i8"),
            (events.p, "i1"),
        ):
            digest.update(np.ascontiguousarray(column, kind).tobytes())
    return digest.hexdigest()


def write_session(session: Session, path: Path) -> None:
    """Write a session as JSON, whole or not at all."""
    content = {"format": FORMAT, **dataclasses.asdict(session)}
    content["policy"] = {"kind": type(session.policy).__name__, **dataclasses.asdict(session.policy)}
    text = (json.dumps(content, indent=1, default=sorted) + "\n").encode()
    if len(text) > LARGEST_FILE:
        raise EtnetError(
            f"{path.name}: comes to {in_megabytes(len(text))}, at most {in_megabytes(LARGEST_FILE)} are read again; "
            "choose a shorter range"
        )
    write_atomically(path, text)


def read_session(path: Path) -> Session:
    """A session from its file; a file that is none is an error that says what is wrong with it."""
    try:
        if path.stat().st_size > LARGEST_FILE:
            raise PlainError(f"{in_megabytes(path.stat().st_size)}, at most {in_megabytes(LARGEST_FILE)} are read")
        return _session_of(bounded_json(path.read_bytes(), LARGEST_FILE))
    except OSError as slip:
        raise EtnetError(f"{path.name}: cannot be read ({slip.strerror})") from None
    except PlainError as slip:
        raise EtnetError(f"{path.name}: is not a session file ({slip}); write one with etnet export session") from None


def _session_of(content: Any) -> Session:
    if not isinstance(content, dict) or content.pop("format", None) not in (FORMAT, OLDER_FORMAT):
        raise PlainError(f"its format is not {FORMAT}")
    policy = content.get("policy")
    kind = _POLICIES.get(str(policy.pop("kind", ""))) if isinstance(policy, dict) else None
    if kind is None:
        raise PlainError("its policy is none that is known")
    opened = content.get("opened")
    if opened is not None and not _is_opening(opened):
        raise PlainError("it does not say how its recording was opened")
    session = made_of(Session, {**content, "policy": made_of(kind, policy)})
    if not (session.frames and all(_HASH.fullmatch(each) for each in session.frames)):
        raise PlainError("its frames are no hashes")
    if not (_HASH.fullmatch(session.events_sha256) and _HASH.fullmatch(session.weights_sha256)):
        raise PlainError("its recording or its weights have no hash")
    if session.start < 0 or (session.change is not None and session.change.at < 0):
        raise PlainError("it begins before the first window")
    if not 1 <= session.contract.threads <= MOST_THREADS:
        raise PlainError(f"its contract has {session.contract.threads} threads; wanted 1 … {MOST_THREADS}")
    return session


def _is_opening(opened: object) -> bool:
    """Whether both are said: what was assumed, and which part was seen."""
    view = opened.get("view") if isinstance(opened, dict) and "assumed" in opened else None
    return isinstance(view, dict) and "region" in view


def parse_intervention(content: object) -> Intervention:
    """An intervention from plain values: lists become sets; what is left out stays as it is in the original."""
    try:
        return made_of(Intervention, content)
    except PlainError as slip:
        known = ", ".join(entry.name for entry in dataclasses.fields(Intervention))
        raise EtnetError(f"intervention is not understood ({slip}); it takes {known}") from None


def _frame_hashes(
    take: Take, change: Change | None, progress: Progress | None, is_cancelled: IsCancelled | None
) -> tuple[str, ...]:
    if change is not None:
        take = Take(take.playback.branch(change.at, change.intervention), take.start, take.stop)
    return tuple(
        hashlib.sha256(np.ascontiguousarray(moment.frame, "<f4").tobytes()).hexdigest()
        for moment in take.moments(progress=progress, is_cancelled=is_cancelled)
    )

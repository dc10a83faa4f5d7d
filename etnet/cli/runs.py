"""Runs beside the first one on the command line: `pie-net-lite`, `windows=duration=20ms filter=hot,5ms` …"""

from __future__ import annotations

import bisect
import math
import shlex
from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from typing import TYPE_CHECKING

from etnet.cli.policy import parse_policy
from etnet.errors import EtnetError, WindowError
from etnet.events.cleaning import parse_cleaning
from etnet.events.denoise import cleaned, uncleaned
from etnet.events.recording import Recording
from etnet.windows import Policy, Window, from_window, plan_windows

if TYPE_CHECKING:
    from etnet.export.compared import RunTitle, Sight
    from etnet.export.take import Beside, Take

MOST_RUNS = 3
"""Beside the first one."""


@dataclass(frozen=True)
class RunOptions:
    """How a run differs from the first one; `None` is "as it"."""

    model: str | None = None
    windows: str | None = None
    filter: str | None = None
    precision: str | None = None
    cold_from: float | None = None
    """Seconds since the first event, from which on it sees events: its state is zero there."""


def parse_run(text: str) -> RunOptions:
    """`MODEL windows=… filter=… precision=… cold-from=SECONDS`, any of them; raises `EtnetError` for anything else."""
    known = {entry.name.replace("_", "-"): entry.name for entry in fields(RunOptions)}
    found = RunOptions()
    try:
        for word in shlex.split(text):
            name, is_named, value = word.partition("=")
            if not is_named or name not in known:
                name, value = "model", word
            given = {known[name]: _seconds(value) if name == "cold-from" else value}
            found = replace(found, **given)
    except ValueError as slip:
        raise EtnetError(f"--also {text!r} is not understood ({slip}); {_FORMS}") from None
    if found.precision not in (None, "fp32", "bf16", "auto"):
        raise EtnetError(f"--also {text!r}: precision is fp32, bf16 or auto")
    return found


def _seconds(text: str) -> float:
    value = float(text)
    if not math.isfinite(value):
        raise ValueError(f"{text} is no number of seconds")
    return value


_FORMS = "write a model and what differs, for example 'pie-net-lite windows=duration=20ms filter=hot,5ms'"


@dataclass(frozen=True)
class Main:
    """What the further runs are like, where they do not say otherwise."""

    recording: Recording
    policy: Policy
    windows: Sequence[Window]
    model: str
    device: str
    precision: str
    budget: int


def with_runs(take: Take, main: Main, texts: Sequence[str], frame_offset: int) -> tuple[Take, tuple[RunTitle, ...]]:
    """The take with the runs beside it, and the titles of all."""
    from etnet.export.compared import title_of
    from etnet.export.pictures import card_gamma

    if len(texts) > MOST_RUNS:
        raise EtnetError(f"--also names {len(texts)} runs; at most {MOST_RUNS} stand beside the first one")
    first = take.playback.model
    cleaning = parse_cleaning("") if main.recording.opened_as is None else main.recording.opened_as.cleaning
    titles = [title_of(first, main.policy, cleaning, None, card_gamma(first))]
    beside = []
    for text in texts:
        run, title = _run_of(parse_run(text), main)
        beside.append(run)
        titles.append(title)
    return replace(take, beside=tuple(beside), frame_offset=frame_offset), tuple(titles)


def _run_of(options: RunOptions, main: Main) -> tuple[Beside, RunTitle]:
    from etnet.export.compared import title_of
    from etnet.export.pictures import card_gamma
    from etnet.export.take import Beside
    from etnet.nets.weights import load_model
    from etnet.playback.playback import Playback

    recording = main.recording
    if options.filter is not None:
        recording = cleaned(uncleaned(recording), parse_cleaning(options.filter))
    policy = main.policy if options.windows is None else parse_policy(options.windows)
    is_same_plan = recording is main.recording and policy == main.policy and options.cold_from is None
    windows = main.windows if is_same_plan else plan_windows(recording, policy)
    if options.cold_from is not None:
        windows = from_window(windows, _cold_at(recording, windows, options.cold_from))
    precision = options.precision or main.precision
    model = load_model(options.model or main.model, main.device, precision)  # pyright: ignore[reportArgumentType]
    playback = Playback(model, recording, windows, main.budget)
    opened = recording.opened_as
    cleaning = parse_cleaning(options.filter) if options.filter is not None or opened is None else opened.cleaning
    title = title_of(model, policy, cleaning, options.cold_from, card_gamma(model))
    return Beside(playback, is_same_plan), title


def error_place(letter: str | None, sight: Sight, num_runs: int) -> int | None:
    """The place among the runs of the one whose error stands in the camera's place; `None` for the camera's frame."""
    from etnet.export.compared import LETTERS

    if letter is None:
        return 0 if sight == "difference" else None
    place = LETTERS.index(letter)
    if place >= num_runs:
        raise EtnetError(f"--camera-error is {letter}, and the last of {num_runs} runs is {LETTERS[num_runs - 1]}")
    return place


def _cold_at(recording: Recording, windows: Sequence[Window], seconds: float) -> int:
    stamp = recording.span.start + round(seconds * 1e6)
    found = bisect.bisect_left(windows, stamp, key=lambda window: window.t_start)
    if found >= len(windows):
        raise WindowError(f"{recording.name}: no window begins after cold-from={seconds:g} s; start cold earlier")
    return found

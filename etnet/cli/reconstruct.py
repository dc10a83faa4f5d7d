"""`etnet reconstruct FILE …`: PNG frames with their stamps, and an MP4, of one recording or of many."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Annotated, Literal

import tyro

from etnet.cli.live import ReconstructLive
from etnet.cli.live import run as run_live
from etnet.cli.live_frames import run_as_cut
from etnet.cli.policy import default_policy, parse_policy
from etnet.cli.progress import console, track
from etnet.cli.recording import Opening, open_with_progress
from etnet.errors import EtnetError
from etnet.events.recording import Recording
from etnet.windows import Window, plan_windows

LARGE_SENSOR = 400_000
"""Pixels from which on a run's time is told before it begins."""


@dataclass(frozen=True)
class Reconstruct:
    """Turn recordings into frames: PNG files, a table of their stamps, and a video.

    Many are shared out among the processes of torchrun or SLURM, and what is finished is not done again (docs/many.md).

    With --live a camera, a stream or a replayed recording takes the file's place (`etnet reconstruct --live --help`);
    of what was recorded then, `--windows as-cut` gives the live frames again.
    """

    files: tyro.conf.Positional[tuple[Path, ...]]
    """Recordings: files, folders, zips, and folders of them."""
    out: Path = Path("reconstruction")
    """Folder for frames/, stamps.csv and video.mp4; with several recordings one folder each in it."""
    model: str = "etnet-half"
    """A bundled model's name, or a weights file."""
    windows: str | None = None
    """between-frames, count=10000, density=0.35 or duration=20ms[/5ms]; default: between frames, else density=0.35."""
    device: str = "cpu"
    precision: Literal["fp32", "bf16", "auto"] = "fp32"
    opening: Annotated[Opening, tyro.conf.arg(name="")] = field(default_factory=Opening)
    gamma: Annotated[float | None, tyro.conf.arg(metavar="NUMBER")] = None
    """Display gamma of the PNGs and the video; default: what the model's card says (1 = as the network gives it)."""
    speed: float = 1.0
    """The video's speed, as a share of real time."""


def parse(arguments: Sequence[str], program: str) -> Reconstruct | ReconstructLive:
    """The command line; `--live` makes it another command."""
    is_live = any(argument.partition("=")[0] == "--live" for argument in arguments)
    return tyro.cli(ReconstructLive if is_live else Reconstruct, prog=program, args=list(arguments))


def run(config: Reconstruct | ReconstructLive) -> int:
    """Do it; returns the exit code."""
    from etnet.cli.many import jobs_of, recordings_in, run_many, this_share

    if isinstance(config, ReconstructLive):
        return run_live(config)
    if not config.files:
        raise EtnetError("there is nothing to reconstruct: name a recording, or several")
    if config.windows == "as-cut":
        if len(config.files) > 1:
            raise EtnetError(f"--windows as-cut takes one recording at a time, got {len(config.files)}")
        places = next(iter(config.files)), config.opening, config.out
        return run_as_cut(*places, config.model, config.device, config.precision, config.gamma)
    recordings = recordings_in(config.files, config.out)
    if len(recordings) == len(config.files) == 1 and recordings[0] == config.files[0]:
        num_frames = _reconstruct(config, recordings[0], lambda _: None)
        console.print(f"wrote {num_frames} frames to {config.out}", markup=False, soft_wrap=True)
        return 0

    def work(path: Path, folder: Path, told: Callable[[float], None]) -> int:
        return _reconstruct(replace(config, out=folder), path, told)

    return run_many(jobs_of(recordings, config.out), this_share(), _settings(config), work)


def _settings(config: Reconstruct) -> str:
    """All that decides what is written, the weights file's size and time of change included."""
    weights = Path(config.model)
    status = weights.stat() if weights.is_file() else None
    mark = "" if status is None else f" {status.st_size} {status.st_mtime_ns}"
    return f"{replace(config, files=(), out=Path())}{mark}"


def _reconstruct(config: Reconstruct, path: Path, told: Callable[[float], None]) -> int:
    """One recording; how many frames were written."""
    from etnet.nets.weights import load_model

    with open_with_progress(path, config.opening) as recording:
        for remark in recording.remarks:
            console.print(f"[dim]{remark}[/dim]")
        policy = default_policy(recording) if config.windows is None else parse_policy(config.windows)
        model = load_model(config.model, config.device, config.precision)
        gamma = config.gamma if config.gamma is not None else float(model.card.get("display_gamma", 1.0))  # pyright: ignore
        windows = plan_windows(recording, policy)
        console.print(
            f"{recording.name}: {recording.sensor}, {recording.num_events:,} events, {len(windows)} windows; "
            f"model {model.name}, {model.runtime.precision}, display gamma {gamma:g}"
        )
        _tell_time(model, recording, len(windows))
        _write(config, recording, model, policy, windows, gamma, told)
    return len(windows)


def _tell_time(model, recording: Recording, num_windows: int) -> None:
    """Say before a long run how long it will take: attention costs the square of a large sensor's tokens."""
    from etnet.cli.many import in_words
    from etnet.nets.expected import expected_step_seconds

    if recording.sensor.num_pixels < LARGE_SENSOR:
        return
    seconds = expected_step_seconds(model, recording.sensor.height, recording.sensor.width)
    remedy = "; --opening.downsample 2 or --opening.region takes a fraction of it"
    console.print(f"about {seconds:.1f} s a window, {in_words(seconds * num_windows)} in all{remedy}", soft_wrap=True)


def _write(
    config: Reconstruct,
    recording: Recording,
    model,
    policy,
    windows: Sequence[Window],
    gamma: float,
    told: Callable[[float], None],
) -> None:
    from etnet.export.images import to_uint8, write_atomically, write_png
    from etnet.export.video import video_writer
    from etnet.reconstruction import reconstruct

    (config.out / "frames").mkdir(parents=True, exist_ok=True)
    stamps = ["frame,stamp_us,start_us,num_events"]
    width, height = recording.sensor.width, recording.sensor.height
    rate = _frames_per_second(windows) * config.speed
    with video_writer(config.out / "video.mp4", width, height, rate) as append:
        for window, step in track(reconstruct(model, recording, policy), len(windows), "reconstructing"):
            image = to_uint8(step.frame[0, 0].float().cpu().numpy(), gamma)
            write_png(config.out / "frames" / f"frame_{window.index:06d}.png", image)
            append(image)
            stamps.append(f"{window.index},{window.t_stop},{window.t_start},{window.num_events}")
            told((window.index + 1) / len(windows))
    write_atomically(config.out / "stamps.csv", ("\n".join(stamps) + "\n").encode())


def _frames_per_second(windows: Sequence[Window]) -> float:
    """The mean rate of the windows, at which the video plays in real time; at least one, at most 1,000."""
    if len(windows) < 2:
        return 25.0
    seconds = (windows[-1].t_stop - windows[0].t_stop) / 1e6
    return min(max((len(windows) - 1) / seconds, 1.0), 1000.0) if seconds > 0 else 25.0

"""`etnet reconstruct FILE | --live SOURCE`: PNG frames with their stamps, and an MP4."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Literal

import tyro

from etnet.cli.live import ReconstructLive
from etnet.cli.live import run as run_live
from etnet.cli.policy import default_policy, parse_policy
from etnet.cli.progress import console, track
from etnet.cli.recording import Opening, open_with_progress
from etnet.errors import WindowError
from etnet.events.recording import Recording
from etnet.live.log import windows_as_cut
from etnet.windows import Window, plan_windows


@dataclass(frozen=True)
class Reconstruct:
    """Turn a recording into frames: PNG files, a table of their stamps, and a video.

    With --live a camera, a stream or a replayed recording takes the file's place: `etnet reconstruct --live --help`.
    """

    file: tyro.conf.Positional[Path]
    """A recording: a file, a folder or a zip."""
    out: Path = Path("reconstruction")
    """Folder for frames/, stamps.csv and video.mp4."""
    model: str = "etnet-half"
    """A bundled model's name, or a weights file."""
    windows: str | None = None
    """between-frames, count=10000, density=0.35 or duration=20ms[/5ms]; default: between frames, else density=0.35.

    as-cut takes the windows of a live recording as they were cut then, and gives its live frames again.
    """
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
    kind = ReconstructLive if is_live else Reconstruct
    return tyro.cli(kind, prog=program, args=list(arguments))


def run(config: Reconstruct | ReconstructLive) -> int:
    """Do it; returns the exit code."""
    from etnet.nets.weights import load_model

    if isinstance(config, ReconstructLive):
        return run_live(config)
    with open_with_progress(config.file, config.opening) as recording:
        for remark in recording.remarks:
            console.print(f"[dim]{remark}[/dim]")
        windows = _windows(config, recording)
        model = load_model(config.model, config.device, config.precision)
        gamma = config.gamma if config.gamma is not None else float(model.card.get("display_gamma", 1.0))  # pyright: ignore
        console.print(
            f"{recording.name}: {recording.sensor}, {recording.num_events:,} events, {len(windows)} windows; "
            f"model {model.name}, {model.runtime.precision}, display gamma {gamma:g}"
        )
        _write(config, recording, model, windows, gamma)
    console.print(f"wrote {len(windows)} frames to {config.out}", markup=False, soft_wrap=True)
    return 0


def _windows(config: Reconstruct, recording: Recording) -> Sequence[Window]:
    if config.windows == "as-cut":
        as_cut = windows_as_cut(recording)
        if as_cut.downsample != config.opening.downsample:
            raise WindowError(
                f"{recording.name}: the network saw it with {as_cut.downsample} pixels a side joined, it is opened "
                f"with {config.opening.downsample}; add --downsample {as_cut.downsample}"
            )
        return as_cut.windows
    policy = default_policy(recording) if config.windows is None else parse_policy(config.windows)
    return plan_windows(recording, policy)


def _write(config: Reconstruct, recording: Recording, model, windows: Sequence[Window], gamma: float) -> None:
    from etnet.export.images import to_uint8, write_atomically, write_png
    from etnet.export.video import video_writer
    from etnet.reconstruction import reconstruct

    (config.out / "frames").mkdir(parents=True, exist_ok=True)
    stamps = ["frame,stamp_us,start_us,num_events"]
    width, height = recording.sensor.width, recording.sensor.height
    rate = _frames_per_second(windows) * config.speed
    with video_writer(config.out / "video.mp4", width, height, rate) as append:
        for window, step in track(reconstruct(model, recording, windows), len(windows), "reconstructing"):
            image = to_uint8(step.frame[0, 0].float().cpu().numpy(), gamma)
            write_png(config.out / "frames" / f"frame_{window.index:06d}.png", image)
            append(image)
            stamps.append(f"{window.index},{window.t_stop},{window.t_start},{window.num_events}")
    write_atomically(config.out / "stamps.csv", ("\n".join(stamps) + "\n").encode())


def _frames_per_second(windows: Sequence[Window]) -> float:
    """The mean rate of the windows, at which the video plays in real time; at least one, at most 1,000."""
    if len(windows) < 2:
        return 25.0
    seconds = (windows[-1].t_stop - windows[0].t_stop) / 1e6
    return min(max((len(windows) - 1) / seconds, 1.0), 1000.0) if seconds > 0 else 25.0

"""`etnet reconstruct FILE`: PNG frames with their stamps, and an MP4."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Literal

import tyro

from etnet.cli.live import ReconstructLive
from etnet.cli.live import run as run_live
from etnet.cli.live_frames import run_as_cut
from etnet.cli.policy import default_policy, parse_policy
from etnet.cli.progress import console, track
from etnet.cli.recording import Opening, open_with_progress
from etnet.events.recording import Recording
from etnet.windows import Window, plan_windows


@dataclass(frozen=True)
class Reconstruct:
    """Turn a recording into frames: PNG files, a table of their stamps, and a video.

    With --live a camera, a stream or a replayed recording takes the file's place (`etnet reconstruct --live --help`);
    of what was recorded then, `--windows as-cut` gives the live frames again.
    """

    file: tyro.conf.Positional[Path]
    """A recording: a file, a folder or a zip."""
    out: Path = Path("reconstruction")
    """Folder for frames/, stamps.csv and video.mp4."""
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
    from etnet.nets.weights import load_model

    if isinstance(config, ReconstructLive):
        return run_live(config)
    if config.windows == "as-cut":
        places = config.file, config.opening, config.out
        return run_as_cut(*places, config.model, config.device, config.precision, config.gamma)
    with open_with_progress(config.file, config.opening) as recording:
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
        _write(config, recording, model, policy, windows, gamma)
    console.print(f"wrote {len(windows)} frames to {config.out}", markup=False, soft_wrap=True)
    return 0


def _write(config: Reconstruct, recording: Recording, model, policy, windows: Sequence[Window], gamma: float) -> None:
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
    write_atomically(config.out / "stamps.csv", ("\n".join(stamps) + "\n").encode())


def _frames_per_second(windows: Sequence[Window]) -> float:
    """The mean rate of the windows, at which the video plays in real time; at least one, at most 1,000."""
    if len(windows) < 2:
        return 25.0
    seconds = (windows[-1].t_stop - windows[0].t_stop) / 1e6
    return min(max((len(windows) - 1) / seconds, 1.0), 1000.0) if seconds > 0 else 25.0

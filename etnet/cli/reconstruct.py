"""`etnet reconstruct FILE …`: PNG frames with their stamps, and an MP4; with `--stamps`, frames at given moments."""

from __future__ import annotations

import hashlib
import re
from collections.abc import Callable, Sequence
from contextlib import nullcontext
from dataclasses import dataclass, field, replace
from itertools import islice
from pathlib import Path
from typing import Annotated, Literal

import tyro

from etnet.arguments import parsed
from etnet.cli.frames_folder import FRAMES, KALIBR, VIDEO, check_frames, kalibr_name, make_room
from etnet.cli.live import ReconstructLive
from etnet.cli.live import run as run_live
from etnet.cli.live_frames import run_as_cut
from etnet.cli.policy import default_policy, parse_policy
from etnet.cli.progress import console, track
from etnet.cli.recording import Opening, chosen_windows, open_with_progress
from etnet.errors import EtnetError, RecordingError, WindowError
from etnet.events.moments import Moments, divided, moments_of_frames, moments_of_triggers, read_moments
from etnet.events.recording import Recording
from etnet.export.frame_files import STAMPS, frame_name
from etnet.windows import ByCount, ByDuration, ByStamps, Policy, Window, plan_windows

LARGE_SENSOR = 400_000
"""Pixels from which on a run's time is told before it begins."""
SLOWEST, FASTEST = 0.001, 100_000
"""Frames a second of a video that can be written."""


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
    begin: Annotated[float | None, tyro.conf.arg(name="from")] = None
    """Seconds since the first event: frames of windows that end after it. What lies before is replayed, so that they
    are those of the whole run."""
    end: Annotated[float | None, tyro.conf.arg(name="to")] = None
    """Seconds since the first event: frames of windows that end by then. Default: the end."""
    overwrite: bool = False
    """Replace frames that are there, and a film or frames that something else wrote. Of several recordings those that
    are finished are left as they are; with it they are done again."""
    model: str = "etnet-half"
    """A bundled model's name, or a weights file."""
    windows: str | None = None
    """between-frames, count=10000, density=0.35, duration=20ms[/5ms], count=10000,duration=20ms or active=20%;
    default: between frames, else density=0.35."""
    stamps: str | None = None
    """Frames at these moments only: a CSV with a column of stamps, a folder of pictures named by nanoseconds, another
    recording (its frames), or triggers, triggers=INPUT, triggers=INPUT/rising, triggers=INPUT/falling of this one.
    --windows duration=… or count=… is then what the window before each holds; default: since the moment before."""
    stamps_unit: Literal["s", "ms", "us", "ns"] | None = None
    """Time unit of the timestamps, where their column does not say it."""
    upsample: int = 1
    """Windows from one moment to the next; only the last one's frame is written. A network likes short windows."""
    layout: Literal["frames", "kalibr"] = "frames"
    """frames: frames/frame_000000.png. kalibr: cam0/<ns>.png, as Kalibr and EuRoC have them, without a video."""
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
    return parsed(ReconstructLive if is_live else Reconstruct, program, arguments, beside=("--live",))


def run(config: Reconstruct | ReconstructLive) -> int:
    """Do it; returns the exit code."""
    from etnet.cli.many import jobs_of, run_many, this_share
    from etnet.cli.many_sources import check_apart, recordings_in

    if isinstance(config, ReconstructLive):
        return run_live(config)
    _check_numbers(config)
    if not config.files:
        raise EtnetError("there is nothing to reconstruct: name a recording, or several")
    if config.windows == "as-cut":
        if len(config.files) > 1:
            raise EtnetError(f"--windows as-cut takes one recording at a time, got {len(config.files)}")
        if config.begin is not None or config.end is not None:
            raise EtnetError("--windows as-cut gives all live frames again; leave --from and --to out")
        _check_out(config)
        places = next(iter(config.files)), config.opening, config.out
        return run_as_cut(*places, config.model, config.device, config.precision, config.gamma, config.overwrite)
    check_apart(config.files, config.out)
    recordings = recordings_in(config.files, config.out)
    if len(recordings) == len(config.files) == 1 and recordings[0] == config.files[0]:
        _check_out(config)
        num_frames = _reconstruct(config, recordings[0], lambda _: None)
        console.print(f"wrote {num_frames} frames to {config.out}", markup=False, soft_wrap=True)
        return 0

    def work(path: Path, folder: Path, told: Callable[[float], None]) -> int:
        own = replace(config, out=folder)
        _check_out(own, is_shared=True)
        return _reconstruct(own, path, told)

    return run_many(jobs_of(recordings, config.out), this_share(), _settings(config), work, anew=config.overwrite)


def _check_numbers(config: Reconstruct) -> None:
    """Before anything is computed or taken away."""
    from etnet.export.images import check_gamma
    from etnet.export.pace import check_speed

    check_speed(config.speed)
    if config.gamma is not None:
        check_gamma(config.gamma)


def _folder_of(config: Reconstruct) -> Path:
    is_kalibr = config.layout == "kalibr" and config.windows != "as-cut"
    return config.out / (KALIBR if is_kalibr else FRAMES)


def _check_out(config: Reconstruct, is_shared: bool = False) -> None:
    """Finished frames, and what others put there, stay, unless they may be replaced; what is read from, always."""
    folder = _folder_of(config)
    written = folder.resolve(), (config.out / STAMPS).resolve()
    if config.stamps is not None and Path(config.stamps).resolve() in written:
        raise EtnetError(f"--stamps {config.stamps}: what is written would replace it; give another --out")
    check_frames(folder, config.overwrite, is_shared)


def _settings(config: Reconstruct) -> str:
    """All that decides what is written, size and time of change of the weights and of what gives stamps included."""
    weights = Path(config.model)
    mark = _mark_of(weights) if weights.is_file() else ""
    stamps = "" if config.stamps is None else _marks_below(Path(config.stamps), config.out)
    return f"{replace(config, files=(), out=Path(), overwrite=False)}{mark}{stamps}"


def _mark_of(file: Path) -> str:
    status = file.stat()
    return f" {status.st_size} {status.st_mtime_ns}"


def _marks_below(path: Path, out: Path) -> str:
    """Of a file as it is, of a folder one for all its files, whose names may be the stamps; of triggers none."""
    from etnet.cli.many import files_of

    if not path.is_dir():
        return _mark_of(path) if path.is_file() else ""
    files = sorted((each.relative_to(path).as_posix(), _mark_of(each)) for each in files_of(path, out))
    return f" {hashlib.sha256(repr(files).encode()).hexdigest()[:16]}"


def _reconstruct(config: Reconstruct, path: Path, told: Callable[[float], None]) -> int:
    """One recording; how many frames were written."""
    from etnet.nets.weights import load_model

    with open_with_progress(path, config.opening) as recording:
        for remark in recording.remarks:
            console.print(f"[dim]{remark}[/dim]")
        policy, names = _policy(config, recording)
        model = load_model(config.model, config.device, config.precision)
        gamma = config.gamma if config.gamma is not None else float(model.card.get("display_gamma", 1.0))  # pyright: ignore
        windows = plan_windows(recording, policy)
        chosen = chosen_windows(recording, windows, config.begin, config.end)
        part = "" if len(chosen) == len(windows) else f" ({chosen.start} – {chosen[-1]} chosen)"
        console.print(
            f"{recording.name}: {recording.sensor}, {recording.num_events:,} events, {len(windows)} windows{part}; "
            f"model {model.name}, {model.runtime.precision}, display gamma {gamma:g}"
        )
        _tell_time(model, recording, chosen.stop)
        shown = windows if len(chosen) == len(windows) else [windows[index] for index in chosen]
        if names is not None:
            shown = [window for window in shown if window.t_stop in names]
        if not shown:
            raise WindowError(f"{recording.name}: none of the moments lies from --from to --to; widen the range")
        return _write(config, recording, model, policy, shown, gamma, names, told)


def _tell_time(model, recording: Recording, num_windows: int) -> None:
    """Say before a long run how long it will take: attention costs the square of a large sensor's tokens."""
    from etnet.cli.many import in_words
    from etnet.nets.expected import expected_step_seconds

    if recording.sensor.num_pixels < LARGE_SENSOR:
        return
    seconds = expected_step_seconds(model, recording.sensor.height, recording.sensor.width)
    remedy = "; --downsample 2 or --region takes a fraction of it"
    console.print(f"about {seconds:.1f} s a window, {in_words(seconds * num_windows)} in all{remedy}", soft_wrap=True)


def _policy(config: Reconstruct, recording: Recording) -> tuple[Policy, dict[int, int] | None]:
    """The windows, and with given moments the nanoseconds of each stamp that is written (others are not)."""
    if config.upsample < 1 or (config.upsample > 1 and (config.stamps is None or config.windows is not None)):
        raise WindowError(
            f"--upsample {config.upsample}: it takes 1 or more, with --stamps and without --windows: it divides what "
            "lies between two moments"
        )
    if config.stamps is None:
        return default_policy(recording) if config.windows is None else parse_policy(config.windows), None
    moments = _moments(config, recording).within(recording.span)
    console.print(moments.said, markup=False, soft_wrap=True)
    names = dict(zip(moments.stamps.tolist(), moments.nanoseconds.tolist(), strict=True))
    held = None if config.windows is None else parse_policy(config.windows)
    match held:
        case None:
            return ByStamps(tuple(divided(moments.stamps, recording, config.upsample).tolist())), names
        case ByDuration(duration, None):
            return ByStamps(tuple(names), duration=duration), names
        case ByCount(num_events):
            return ByStamps(tuple(names), num_events=num_events), names
    raise WindowError(f"--windows {config.windows}: with --stamps it takes duration=20ms or count=10000")


def _moments(config: Reconstruct, recording: Recording) -> Moments:
    text = config.stamps or ""
    found = re.fullmatch(r"triggers(?:=(\d+)(?:/(rising|falling))?)?", text)
    if found is not None:
        channel = None if found[1] is None else int(found[1])
        edge = None if found[2] is None else 1 if found[2] == "rising" else -1
        triggers = recording.triggers
        return moments_of_triggers(None if triggers is None else triggers.chosen(channel, edge), recording.name)
    path = Path(text)
    if not path.exists():
        raise RecordingError(f"--stamps {text}: there is no such file or folder; or name triggers")
    is_table = path.suffix.lower() in (".csv", ".txt", ".tsv")
    if is_table or (path.is_dir() and any(each.stem.isdigit() for each in path.glob("*.[pjbt]*"))):
        return read_moments(path, recording.span, config.stamps_unit)
    with open_with_progress(path, Opening()) as other:
        return moments_of_frames(other.ground_truth, other.name)


def _write(
    config: Reconstruct,
    recording: Recording,
    model,
    policy: Policy,
    shown: Sequence[Window],
    gamma: float,
    names: dict[int, int] | None,
    told: Callable[[float], None],
) -> int:
    """The frames of the windows `shown`; how many they are. With `names` they are numbered one after the other."""
    from etnet.export.images import to_uint8, write_png
    from etnet.export.video import video_writer
    from etnet.files import write_atomically
    from etnet.reconstruction import reconstruct

    is_kalibr, folder = config.layout == "kalibr", _folder_of(config)
    rate = 0.0 if is_kalibr else _frames_per_second(shown, config.speed)
    make_room(folder, config.overwrite)
    stamps = ["frame,t_stop_us,t_start_us,num_events"]
    width, height = recording.sensor.width, recording.sensor.height
    first, stop = shown[0].index, shown[-1].index + 1
    steps = track(islice(reconstruct(model, recording, policy), stop), stop, "reconstructing")
    with nullcontext() if is_kalibr else video_writer(config.out / VIDEO, width, height, rate) as append:
        for window, step in steps:
            told((window.index + 1) / stop)
            if window.index < first or (names is not None and window.t_stop not in names):
                continue
            image = to_uint8(step.frame[0, 0].float().cpu().numpy(), gamma)
            number = window.index if names is None else len(stamps) - 1
            nanoseconds = window.t_stop * 1000 if names is None else names[window.t_stop]
            write_png(folder / (kalibr_name(nanoseconds) if is_kalibr else frame_name(number)), image)
            if append is not None:
                append(image)
            stamps.append(f"{number},{window.t_stop},{window.t_start},{window.num_events}")
    write_atomically(config.out / STAMPS, ("\n".join(stamps) + "\n").encode())
    return len(stamps) - 1


def _frames_per_second(windows: Sequence[Window], speed: float) -> float:
    """The video's rate: in real time the mean rate of the windows, at least one, at most 1,000; times `speed`.

    Raises:
        EtnetError: no video has such a rate.
    """
    rate = 25.0
    seconds = (windows[-1].t_stop - windows[0].t_stop) / 1e6
    if len(windows) > 1 and seconds > 0:
        rate = min(max((len(windows) - 1) / seconds, 1.0), 1000.0)
    if not SLOWEST <= rate * speed <= FASTEST:
        takes = f"a video takes {SLOWEST:g} to {FASTEST:,.0f}"
        raise EtnetError(f"speed is {speed:g}: {rate * speed:g} frames a second, and {takes}; choose another --speed")
    return rate * speed

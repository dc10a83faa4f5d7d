"""`etnet export KIND RECORDING -o OUT`: video, gif, frames, arrays, csv, page, session, or the network as onnx."""

from __future__ import annotations

import sys
from collections.abc import Generator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import tyro

from etnet.arguments import parsed, told_misspelt
from etnet.cli.policy import default_policy, parse_policy
from etnet.cli.progress import console, progress_callback
from etnet.cli.recording import Opening, chosen_windows, open_with_progress
from etnet.errors import EtnetError, WindowError
from etnet.events.recording import Recording
from etnet.files import in_megabytes
from etnet.windows import Window

if TYPE_CHECKING:
    from etnet.export.pictures import Look
    from etnet.export.take import Progress, Take
    from etnet.windows import Policy

MEMORY = 128 << 20
"""Bytes of states and frames that an export keeps; it goes forward, so little is looked at twice."""


@dataclass(frozen=True)
class Source:
    """What is exported."""

    file: tyro.conf.Positional[Path]
    """A recording: a file, a folder or a zip."""
    out: Annotated[Path, tyro.conf.arg(aliases=["-o"])]
    """Where to write."""
    model: str = "etnet-half"
    """A bundled model's name, or a weights file."""
    windows: str | None = None
    """between-frames, count=10000, density=0.35 or duration=20ms[/5ms]; default: between frames, else density=0.35."""
    range: str | None = None
    """Windows FROM:TO, numbered from 0, TO left out; either may be omitted. Default: all."""
    begin: Annotated[float | None, tyro.conf.arg(name="from")] = None
    """Seconds since the first event: windows that end after it. Default: the beginning."""
    end: Annotated[float | None, tyro.conf.arg(name="to")] = None
    """Seconds since the first event: windows that end by then. Default: the end."""
    overwrite: bool = False
    """Replace what is there."""
    device: str = "cpu"
    precision: Literal["fp32", "bf16", "auto"] = "fp32"
    opening: Annotated[Opening, tyro.conf.arg(name="")] = field(default_factory=Opening)


@dataclass(frozen=True)
class Pictures(Source):
    """How it is drawn."""

    panels: tuple[Literal["events", "reconstruction", "camera"], ...] = ("reconstruction",)
    """Side by side, in this order. With --also all runs stand where the reconstruction does, each with its name."""
    also: Annotated[tuple[str, ...], tyro.conf.arg(metavar="RUN …")] = ()
    """Up to three runs beside the first, each in quotes: a model, and what differs from --model, --windows, --filter
    and --precision: "pie-net-lite" "windows=duration=20ms filter=hot,5ms" "cold-from=1.5" (its state is zero at 1.5 s).
    At each moment they show their window that ends nearest."""
    show: Literal["frames", "difference", "error"] = "frames"
    """Of several runs. difference: each minus the first. error: each minus the camera."""
    camera_error: Annotated[Literal["A", "B", "C", "D"] | None, tyro.conf.arg(metavar="RUN")] = None
    """The run (A is the first) whose error stands in the place of the camera's frame; with difference that is A."""
    frame_offset: float = 0.0
    """Milliseconds added to the camera frames' timestamps, before one is chosen."""
    scale: int = 1
    """Enlarge each pixel to so many on a side."""
    stamps: bool = False
    """Burn a line with seconds, window and events in, below the picture."""
    gamma: Annotated[float | None, tyro.conf.arg(metavar="NUMBER")] = None
    """Display gamma; default: what the model's card says (1 = as the network gives it)."""
    tone: Literal["auto", "raw", "gamma", "robust", "hdr", "clahe"] = "auto"
    """Tone mapping, as in the viewer. auto: the display gamma alone. raw: linear. robust: percentile 1–99 %."""
    event_style: Literal["polarity", "count", "time surface", "decay"] = "polarity"


@dataclass(frozen=True)
class Frames(Pictures):
    """A folder of PNG files with a table of their stamps."""


@dataclass(frozen=True)
class Video(Pictures):
    """MP4 (H.264) that plays in a browser."""

    speed: float = 1.0
    """As a share of real time: 0.1 is ten times slower."""
    fps: Annotated[float | None, tyro.conf.arg(metavar="NUMBER")] = None
    """Frames a second; default: one frame a window where windows are even."""


@dataclass(frozen=True)
class Gif(Pictures):
    """A GIF that loops; at most 50 frames a second."""

    speed: float = 1.0
    """As a share of real time: 0.1 is ten times slower."""
    fps: Annotated[float | None, tyro.conf.arg(metavar="NUMBER")] = None
    """Frames a second, at most 50; default: one frame a window where windows are even."""


@dataclass(frozen=True)
class Arrays(Source):
    """Numbers as NPZ or HDF5, by the ending of --out."""

    what: tuple[Literal["frames", "voxels", "camera", "attention", "states"], ...] = ("frames", "voxels")
    queries: tuple[str, ...] = ()
    """Pixels X,Y whose attention rows are written."""
    sites: tuple[str, ...] = ()
    """Attention sites, e.g. scale1.encoder.2.self; default: all."""


@dataclass(frozen=True)
class Csv(Source):
    """The numbers of every window: events, polarity, frame statistics, errors against the camera."""


@dataclass(frozen=True)
class Page(Source):
    """One HTML file that opens from disk with the network off: everything at hand, nothing to install."""

    also: tuple[str, ...] = ()
    """More models, each shown as a run of its own beside --model."""
    title: str | None = None
    """Default: the recording's name."""
    queries: tuple[int, int] = (6, 4)
    """Columns and rows of the grid of query pixels."""
    megabytes: float = 15.0
    """How large the file may become."""
    gamma: Annotated[float | None, tyro.conf.arg(metavar="NUMBER")] = None
    """Display gamma; default: what the model's card says (1 = as the network gives it)."""


@dataclass(frozen=True)
class SessionFile(Source):
    """JSON with the hashes of recording, weights and frames, and what else decides their bits (`etnet replay`)."""

    intervention: str | None = None
    """JSON, e.g. '{"removed_scales": [3]}'."""
    at: int = 0
    """The window from which the intervention holds."""


@dataclass(frozen=True)
class Onnx:
    """The network itself, no recording: encode.onnx and decode.onnx, with states as named inputs and outputs."""

    out: Annotated[Path, tyro.conf.arg(aliases=["-o"])]
    """The folder to write into."""
    model: str = "etnet-half"
    """A bundled model's name, or a weights file."""
    size: Annotated[str | None, tyro.conf.arg(metavar="WIDTHxHEIGHT")] = None
    """Also one graph for a whole step at this sensor size, e.g. 240x180."""
    overwrite: bool = False
    """Replace graphs that are there."""


Export = (
    Annotated[Video, tyro.conf.subcommand("video")]
    | Annotated[Gif, tyro.conf.subcommand("gif")]
    | Annotated[Frames, tyro.conf.subcommand("frames")]
    | Annotated[Arrays, tyro.conf.subcommand("arrays")]
    | Annotated[Csv, tyro.conf.subcommand("csv")]
    | Annotated[Page, tyro.conf.subcommand("page")]
    | Annotated[SessionFile, tyro.conf.subcommand("session")]
    | Annotated[Onnx, tyro.conf.subcommand("onnx")]
)


KINDS = {"video": Video, "gif": Gif, "frames": Frames, "arrays": Arrays, "csv": Csv, "page": Page,
         "session": SessionFile, "onnx": Onnx}  # fmt: skip


def parse(arguments: Sequence[str], program: str) -> Any:
    """The command line; the kind comes first."""
    kind = arguments[0] if arguments else ""
    if kind in KINDS:
        return parsed(KINDS[kind], f"{program} {kind}", arguments[1:])
    if kind in ("-h", "--help"):
        return tyro.cli(Export, prog=program, args=list(arguments))
    if kind and not kind.startswith("-"):
        raise SystemExit(told_misspelt(program, "kind of file", kind, KINDS, f"{program} --help lists them"))
    print(f"{program}: name the kind of file first: {', '.join(KINDS)}", file=sys.stderr)
    raise SystemExit(2)


def run(config: Any) -> int:
    """Do it; returns the exit code."""
    if isinstance(config, Onnx):
        return _write_onnx(config)
    _check_out(config)
    config.out.resolve().parent.mkdir(parents=True, exist_ok=True)
    with _taken(config) as (take, policy), progress_callback("exporting") as progress:
        said = _write(config, take, policy, progress)
    console.print(f"wrote {config.out}: {said}", markup=False, soft_wrap=True)
    return 0


def _check_out(config: Source) -> None:
    """What is there stays, unless it may be replaced."""
    out = config.out
    is_there = any(out.iterdir()) if out.is_dir() else out.exists()
    if is_there and not config.overwrite:
        raise _is_there(out)


def _is_there(path: Path) -> EtnetError:
    return EtnetError(f"{path}: is there already; give another name, or --overwrite")


def chosen_range(config: Source, recording: Recording, windows: Sequence[Window]) -> tuple[int, int]:
    """Windows start … stop − 1: by number, or by seconds."""
    if config.begin is None and config.end is None:
        return parse_range(config.range, len(windows))
    if config.range is not None:
        raise WindowError("--range counts windows, --from and --to seconds; give one of the two")
    found = chosen_windows(recording, windows, config.begin, config.end)
    return found.start, found.stop


def _write_onnx(config: Onnx) -> int:
    from etnet.export.onnx_graphs import graph_files, write_graphs
    from etnet.nets.weights import load_model

    size = None if config.size is None else parse_size(config.size)
    former = [path for path in graph_files(config.out, size) if path.exists()]
    if former and not config.overwrite:
        raise _is_there(former[0])
    for path in write_graphs(load_model(config.model), config.out, size):
        console.print(f"wrote {path}", markup=False, soft_wrap=True)
    return 0


def parse_size(text: str) -> tuple[int, int]:
    """`WIDTHxHEIGHT` → (height, width)."""
    try:
        width, height = (int(part) for part in text.lower().split("x"))
    except ValueError:
        width = height = 0
    if not (8 <= width <= 4096 and 8 <= height <= 4096):
        raise EtnetError(f"size {text!r} is not understood; write WIDTHxHEIGHT, each 8 … 4096, e.g. 240x180")
    return height, width


def parse_range(text: str | None, length: int) -> tuple[int, int]:
    """`FROM:TO` → two indices; negative ones count from the end, as in Python."""
    if text is None:
        return 0, length
    try:
        first, last = (int(part) if part.strip() else None for part in text.split(":"))
    except ValueError:
        raise WindowError(f"range {text!r} is not understood; write FROM:TO, e.g. 10:50, 10: or :50") from None
    start, stop, _ = slice(first, last).indices(length)
    if start >= stop:
        raise WindowError(f"range {text} holds none of the {length} windows")
    return start, stop


@contextmanager
def _taken(config: Source) -> Generator[tuple[Take, Policy]]:
    from etnet.export.take import Take
    from etnet.nets.weights import load_model
    from etnet.playback.playback import Playback
    from etnet.windows import plan_windows

    with open_with_progress(config.file, config.opening) as recording:
        for remark in recording.remarks:
            console.print(str(remark), style="dim", markup=False)
        policy = default_policy(recording) if config.windows is None else parse_policy(config.windows)
        model = load_model(config.model, config.device, config.precision)
        windows = plan_windows(recording, policy)
        start, stop = chosen_range(config, recording, windows)
        yield Take(Playback(model, recording, windows, MEMORY), start, stop), policy


def _write(config: Source, take: Take, policy: Policy, progress: Progress) -> str:
    match config:
        case Video() | Gif():
            from etnet.export.video import write_gif, write_video

            write = write_video if isinstance(config, Video) else write_gif
            take, look = _drawn(config, take, policy)
            num = write(take, config.out, look, config.speed, progress, frames_per_second=config.fps)
            return f"{num} frames"
        case Frames():
            from etnet.export.frames import write_frames

            take, look = _drawn(config, take, policy)
            return f"{write_frames(take, config.out, look, progress)} pictures"
        case Arrays():
            from etnet.export.arrays import ArraysChoice, write_arrays

            choice = ArraysChoice(config.what, parse_queries(config.queries), config.sites)
            return f"{write_arrays(take, config.out, choice, progress)} windows"
        case Csv():
            from etnet.export.table import write_table

            return f"{write_table(take, config.out, progress)} rows"
        case Page():
            return _write_page(config, take, policy, progress)
        case SessionFile():
            return _write_session(config, take, policy, progress)
    raise AssertionError(config)


def _write_page(config: Page, take: Take, policy: Policy, progress: Progress) -> str:
    from etnet.export.page import PageConfig, write_page
    from etnet.export.pictures import card_gamma
    from etnet.nets.weights import load_model

    others = tuple(load_model(name, config.device, config.precision) for name in config.also)
    page = PageConfig(
        title=config.title or take.recording.name,
        query_grid=config.queries,
        budget_bytes=round(config.megabytes * 1e6),
        gamma=config.gamma if config.gamma is not None else card_gamma(take.playback.model),
    )
    size = write_page(take, policy, config.out, page, others, progress)
    return f"{len(take)} windows, {in_megabytes(size)}; open it in a browser"


def _write_session(config: SessionFile, take: Take, policy: Policy, progress: Progress) -> str:
    from etnet.export.session_file import Change, parse_intervention, record_session, write_session
    from etnet.plain_values import bounded_json

    change = None
    if config.intervention is not None:
        try:
            change = Change(config.at, parse_intervention(bounded_json(config.intervention, 1 << 20)))
        except (ValueError, AttributeError) as slip:
            raise EtnetError(f"--intervention is not a JSON object ({slip})") from None
    session = record_session(take, policy, change, progress=progress)
    write_session(session, config.out)
    return f"{len(session.frames)} frames; check them with etnet replay {config.out.name} --check"


def parse_queries(texts: tuple[str, ...]) -> tuple[tuple[int, int], ...]:
    """`X,Y` → pixels."""
    try:
        return tuple((int(x), int(y)) for x, y in (text.split(",") for text in texts))
    except ValueError:
        raise EtnetError(f"queries {' '.join(texts)} are not understood; write pixels as X,Y, e.g. 120,90") from None


def _drawn(config: Pictures, take: Take, policy: Policy) -> tuple[Take, Look]:
    """What is drawn, with the runs beside it, and how."""
    from etnet.cli.runs import Main, error_place, with_runs
    from etnet.export.compared import Runs
    from etnet.export.pictures import Look, card_gamma

    gamma = config.gamma if config.gamma is not None else card_gamma(take.playback.model)
    look = Look(config.panels, gamma, config.scale, config.stamps, config.tone, config.event_style)
    offset = round(config.frame_offset * 1000)
    if not config.also:
        if config.camera_error is not None:
            raise EtnetError("--camera-error names one of several runs; give those beside the first by --also")
        return replace(take, frame_offset=offset), look
    playback = take.playback
    main = Main(playback.recording, policy, playback.windows, config.model, config.device, config.precision, MEMORY)
    compared, titles = with_runs(take, main, config.also, offset)
    if config.gamma is not None:
        titles = tuple(replace(title, gamma=config.gamma) for title in titles)
    camera_error = error_place(config.camera_error, config.show, len(titles))
    return compared, replace(look, runs=Runs(titles, config.show, camera_error))

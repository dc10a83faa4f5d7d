"""The whole command that makes what the page takes away: every choice in it, quoted for a shell."""

from __future__ import annotations

import shlex
from collections.abc import Iterator
from dataclasses import dataclass

from app.html.moment import Moment
from app.state.view_state import ViewState
from app.views.compare.state import NAMES, CompareState
from app.views.export.runs import SIGHTS, camera_error_of
from app.views.export.state import ExportFormat, OrderedRun, StartExport, arrays_of
from app.views.page import Page
from etnet.events.assumptions import Assumptions
from etnet.events.opened_as import View
from etnet.render.events import EventStyle
from etnet.render.tone import Tone
from etnet.windows import BetweenFrames, ByActivity, ByCount, ByCountOrDuration, ByDensity, ByDuration, ByStamps, Policy

_KINDS: dict[ExportFormat, str] = {
    "mp4": "video", "gif": "gif", "png": "frames", "page": "page", "npz": "arrays", "h5": "arrays", "csv": "csv",
    "session": "session",
}  # fmt: skip


@dataclass(frozen=True, slots=True)
class CommandLine:
    """How the command line is told of what is shown: by names, never by where a file lies."""

    file: str
    model: str
    precision: str = "fp32"
    device: str = "cpu"


def command_line_of(page: Page) -> CommandLine | None:
    """`None` for what the command line cannot open: a video has to be simulated first."""
    if page.video is not None or not page.file_name:
        return None
    ready, state = page.ready, page.state
    if ready is None or ready.request.playback.network != (state.model_id, state.precision):
        return CommandLine(page.file_name, page.model.source, state.precision)
    return CommandLine(page.file_name, page.model.source, ready.contract.runtime.precision, ready.contract.device)


def export_command(
    wanted: StartExport,
    moment: Moment,
    line: CommandLine,
    query: tuple[int, int] | None,
    out: str,
    tone: Tone = "auto",
    style: EventStyle = "polarity",
    shown: ViewState | None = None,
) -> str:
    """`etnet export …`, typed where the recording lies, for the windows, network and look that the page would use."""
    words = ["etnet", "export", _KINDS[wanted.format], _as_operand(line.file), "-o", out, "--model", line.model]
    words += ["--windows", policy_text(moment.policy), "--precision", line.precision]
    words += [] if line.device == "cpu" else ["--device", line.device]
    words += _range(wanted, moment)
    if (opened := moment.recording.opened_as) is not None:
        words += [*_statement(opened.assumed), *_view(opened.view)]
    words += [] if moment.cleaning.changes_nothing else ["--filter", moment.cleaning.text]
    words += _look(wanted, query, tone, style)
    if wanted.runs and shown is not None:
        words += _compared(wanted, moment, line, shown.of(CompareState))
    return shlex.join(words)


def policy_text(policy: Policy) -> str:
    """A window policy as `--windows` takes it."""
    match policy:
        case BetweenFrames():
            return "between-frames"
        case ByCount(num_events):
            return f"count={num_events}"
        case ByDensity(events_per_pixel):
            return f"density={events_per_pixel!r}"
        case ByDuration(duration, stride):
            return f"duration={_time(duration)}" + ("" if stride is None else f"/{_time(stride)}")
        case ByCountOrDuration(num_events, duration):
            return f"count={num_events},duration={_time(duration)}"
        case ByActivity(active_pixels):
            return f"active={active_pixels!r}"
        case ByStamps():
            return "stamps"


def _seconds(microseconds: int) -> str:
    return f"{microseconds / 1e6:.6f}".rstrip("0").rstrip(".")


def _time(microseconds: int) -> str:
    return f"{microseconds // 1000}ms" if microseconds % 1000 == 0 else f"{microseconds}us"


def _as_operand(name: str) -> str:
    return f"./{name}" if name.startswith("-") else name


def _range(wanted: StartExport, moment: Moment) -> list[str]:
    if wanted.format == "png":
        return ["--range", f"{moment.index}:{moment.index + 1}"]
    if wanted.first is None and wanted.last is None:
        return []
    first, last = wanted.first or 0, len(moment.windows) - 1 if wanted.last is None else wanted.last
    return ["--range", f"{first}:{max(first, last) + 1}"]


def _look(wanted: StartExport, query: tuple[int, int] | None, tone: Tone, style: EventStyle) -> Iterator[str]:
    if wanted.format in ("mp4", "gif", "png"):
        yield from ("--panels", *wanted.panels)
        if wanted.has_stamps:
            yield "--stamps"
        if wanted.scale > 1:
            yield from ("--scale", str(wanted.scale))
        if tone != "auto":
            yield from ("--tone", tone)
        if style != "polarity" and "events" in wanted.panels:
            yield from ("--event-style", style)
    if wanted.format in ("mp4", "gif"):
        yield from ("--speed", f"{wanted.speed:g}")
        if wanted.fps is not None:
            yield from ("--fps", f"{wanted.fps:g}")
    if wanted.format in ("npz", "h5"):
        names = arrays_of(wanted, query)
        yield from ("--what", *names)
        if query is not None and "attention" in names:
            yield from ("--queries", f"{query[0]},{query[1]}")


def _compared(wanted: StartExport, moment: Moment, line: CommandLine, compare: CompareState) -> Iterator[str]:
    """The runs beside the first, how they are shown, and the offset between the two clocks."""
    if wanted.runs[1:]:
        yield "--also"
        yield from (_run_text(each, moment, line) for each in wanted.runs[1:])
    if SIGHTS[compare.sight] != "frames":
        yield from ("--show", SIGHTS[compare.sight])
    place = camera_error_of(compare, tuple(each.number for each in wanted.runs))
    if place is not None and (place or compare.sight != "difference") and "camera" in wanted.panels:
        yield from ("--camera-error", NAMES[place])  # the command line's runs have no gaps between their letters
    if compare.offset:
        yield from ("--frame-offset", f"{compare.offset / 1000:g}")


def _run_text(ordered: OrderedRun, moment: Moment, line: CommandLine) -> str:
    """What of a run is not as the first one's; its network always."""
    run = ordered.run
    words = [ordered.source or line.model]
    words += [] if run.policy is None else [f"windows={policy_text(run.policy)}"]
    words += [] if run.cleaning is None else [f"filter={run.cleaning.text or 'none'}"]
    words += [] if run.precision is None else [f"precision={run.precision}"]
    if run.cold_from is not None:
        words.append(f"cold-from={_seconds(run.cold_from - moment.recording.span.start)}")
    return shlex.join(words)


def _statement(stated: Assumptions) -> Iterator[str]:
    if stated.width is not None:
        yield from ("--assume", f"width={stated.width},height={stated.height}")
    if stated.time_unit is not None:
        yield from ("--time-unit", stated.time_unit)
    if stated.polarity != "auto":
        yield from ("--polarity", stated.polarity)
    if stated.sort:
        yield "--sort"
    if stated.drop_outside:
        yield "--drop-outside"


def _view(view: View) -> Iterator[str]:
    if view.region is not None:
        yield from ("--region", *map(str, view.region))
    if view.downsample != 1:
        yield from ("--downsample", str(view.downsample))
    if view.flip != "none":
        yield from ("--flip", view.flip)
    if view.rotate:
        yield from ("--rotate", str(view.rotate))

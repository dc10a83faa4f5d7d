"""What a visitor takes home, made while nobody waits: the model's steps on the engine's thread, the file beside it.

The writers are those of `etnet export`, so that files are the same. They run in a thread of their own and ask for
steps; between two steps requests are granted.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, ClassVar, cast

import numpy as np
from jaxtyping import UInt8

from app.catalogue.cut import CutRecording, is_live
from app.engine.downloads import LARGEST, Download, plain_name
from app.engine.file_writer import Writer
from app.engine.jobs import Job
from app.engine.playbacks import LoadedPlayback
from app.engine.requests import FrameRequest, Ready
from app.state.view_state import ViewState
from app.views.compare.state import CompareState
from app.views.events.state import EventsState
from app.views.export.relay import Desk, Relay
from app.views.export.runs import SIGHTS, camera_error_of
from app.views.export.state import EXPORT_SLOT, ExportFormat, ExportState, Order, arrays_of
from app.views.inspect.state import NO_CHANGE, InspectState, changed_request
from app.views.reconstruction.state import ReconstructionState
from etnet.errors import EtnetError, WindowError
from etnet.files import in_megabytes
from etnet.private_folder import PrivateFolder
from etnet.stretch import windows_between

if TYPE_CHECKING:
    from etnet.events.recording import Recording
    from etnet.export.compared import Runs
    from etnet.export.take import Progress, Take
    from etnet.playback.playback import Playback
    from etnet.windows import Policy

MOST_WINDOWS = 20_000
PACKED = 16
"""The rows of an NPZ lie on disk until all are there; they may take so many times what the file may."""
ENDINGS: dict[ExportFormat, str] = {
    "mp4": "mp4", "gif": "gif", "png": "png", "npz": "npz", "h5": "h5", "csv": "csv", "page": "html",
    "session": "session.json",
}  # fmt: skip


@dataclass(frozen=True, slots=True)
class ExportJob:
    """The job that makes one file. Its answer is `None` until it is a `Download`."""

    is_ordered: ClassVar[bool] = True
    order: Order

    @property
    def request(self) -> FrameRequest:
        """The playback that it needs."""
        order = self.order
        if order.wanted.runs:
            return order.wanted.runs[0].request.plain
        asked = order.recording_id, order.model_id, order.precision, order.policy, order.index
        return FrameRequest(*asked, cleaning=order.cleaning)

    def run(self, loaded: LoadedPlayback, cancelled: Callable[[], bool]) -> Iterator[tuple[Download | None, float]]:
        """One step of the network, or a moment's wait for the writer, between two yields."""
        desk = Desk()
        take = _take_of(self.order, loaded, desk)
        with PrivateFolder("etnet-take-") as folder:
            name = file_name(take.recording.name, self.order.wanted.format)
            path = folder / name
            work = partial(_write, self.order, take, path, loaded.contract.threads)
            writer = Writer(work, "taking away", desk.give_up)
            try:
                while not writer.is_done:
                    desk.serve(cancelled)
                    yield None, min(writer.share, 0.99)
                writer.raise_failure()
            finally:
                writer.stop()
            size = path.stat().st_size
            if size > LARGEST:
                raise _too_large(name, in_megabytes(size))
            made = Download(name, path.read_bytes())
        yield made, 1.0


def export_jobs(state: ViewState, request: FrameRequest) -> Mapping[str, Job]:
    """The file that was ordered, if any."""
    order = state.of(ExportState).order
    return {} if order is None else {EXPORT_SLOT: ExportJob(order)}


def write(order: Order, take: Take, path: Path, progress: Progress, is_cancelled: Callable[[], bool]) -> None:
    """Write one file with the command line's own writer and its defaults."""
    from etnet.export.arrays import ArraysChoice, write_arrays
    from etnet.export.page import PageConfig, write_page
    from etnet.export.pictures import Look, card_gamma, draw
    from etnet.export.session_file import Change, record_session, write_session
    from etnet.export.table import write_table
    from etnet.export.video import write_gif, write_video

    wanted, gamma = order.wanted, card_gamma(take.playback.model)
    look = Look(wanted.panels, gamma, wanted.scale, wanted.has_stamps)
    if order.view is not None:
        tone, style = order.view.of(ReconstructionState).tone, order.view.of(EventsState).event_image
        look = replace(look, tone=tone, event_style=style)
        if wanted.runs:
            look = replace(look, runs=_runs_of(order, order.view, take))
    match wanted.format:
        case "mp4":
            write_video(take, path, look, wanted.speed, progress, is_cancelled, wanted.fps)
        case "gif":
            write_gif(take, path, look, wanted.speed, progress, is_cancelled, wanted.fps)
        case "png":
            from etnet.export.images import write_png

            if order.view is not None and wanted.sheet != "panels":
                write_png(path, _sheet(order, order.view, take))
                return
            moment = next(take.moments(progress=progress, is_cancelled=is_cancelled))
            write_png(path, draw(moment, look, len(take.playback)))
        case "npz" | "h5":
            queries = () if order.query is None else (order.query,)
            choice = ArraysChoice(arrays_of(wanted, order.query), queries)
            write_arrays(take, path, choice, progress, is_cancelled, _changed(order))
        case "csv":
            write_table(take, path, progress, is_cancelled)
        case "page":
            page = PageConfig(title=take.recording.name, gamma=gamma)
            write_page(take, order.policy, path, page, (), progress, is_cancelled)
        case "session":
            _refuse_what_passes(take.recording, order.policy)
            at = order.change.run_from
            change = None if at is None or at >= take.stop else Change(at, order.change.intervention)
            write_session(record_session(take, order.policy, change, None, progress, is_cancelled), path)


def _changed(order: Order) -> str:
    """What is changed in the network or its events, and where, in words; empty where nothing is."""
    from app.html.attention.changed import change_words, since_words

    change = order.change
    if change.is_nothing:
        return ""
    where = "in each window for itself" if change.since is None else since_words(change.since, change.once)
    left = "" if change.edit.changes_nothing else " (voxels hold the events as they are)"
    return f"{change_words(change.intervention, change.edit)}, {where}{left}"


def _refuse_what_passes(recording: Recording, policy: Policy) -> None:
    """Nobody could open it again as it is now, or cut it as it is cut."""
    if is_live(recording) or (recording.latest is not None and recording.path is None):
        raise EtnetError(
            f"{recording.name}: a live recording passes; press Record, open the file, and take a session of that file"
        )
    if isinstance(recording, CutRecording) and policy == recording.policy:
        raise EtnetError(
            f"{recording.name}: its windows are those of the live run, which no session plans again; choose "
            "other windows, or use `etnet reconstruct --windows as-cut`, which gives the live frames"
        )
    if recording.growth is not None:
        raise EtnetError(f"{recording.name}: only a part of it is indexed by now; take its session when all of it is")
    if recording.path is not None and recording.opened_as is None:
        raise EtnetError(
            f"{recording.name}: a simulated video is gone with its page; cut its events out first, download them, and "
            "take a session of that file"
        )


def _sheet(order: Order, view: ViewState, take: Take) -> UInt8[np.ndarray, "h w 3"]:
    """What the page shows of the moment, drawn as it draws it, with what is changed in the network and its events."""
    from app.html.moment import Moment
    from app.views.attention.state import look_in
    from app.views.export.sheet import sheet_picture
    from app.views.reconstruction.state import tones_in
    from etnet.nets.attention import AttentionProbe
    from etnet.nets.runtime import contract_of

    taken = next(take.moments(None if view.query is None else AttentionProbe()))
    card = getattr(take.playback.model, "card", {})
    is_linear_light = bool(card) and card.get("target_tone", "linear") == "linear"
    asked = order.recording_id, order.model_id, order.precision, order.policy, order.index, view.query is not None
    plain = FrameRequest(*asked, cleaning=order.cleaning)
    request, began_at = changed_request(InspectState(change=order.change), plain), take.playback.first
    is_exact, contract = request.is_original and began_at == 0, contract_of(take.playback.model)
    found = taken.frame, taken.step.attention
    ready = Ready(request, *found, 0.0, is_exact, False, False, contract, order.index, began_at)
    moment = Moment(
        order.recording_id, order.policy, order.index, take.recording, take.playback.windows, order.cleaning
    )
    network = getattr(take.playback.model, "name", order.model_id)
    look, tones = look_in(view, is_linear_light), tones_in(view, is_linear_light)
    look = look if look is None else replace(look, query=order.wanted.pixel or look.query)
    return sheet_picture(order.wanted.sheet, moment, ready, network, look, tones, view.of(EventsState).event_image)


def _write(order: Order, take: Take, path: Path, num_threads: int, writer: Writer) -> None:
    import torch

    torch.set_num_threads(num_threads)  # a thread begins with torch's own number, not the engine's
    most = LARGEST * (PACKED if path.suffix == ".npz" else 1)

    def progress(done: int, total: int) -> None:
        writer.share = done / max(total, 1)
        if sum(part.stat().st_size for part in path.parent.rglob("*") if part.is_file()) > most:
            raise _too_large(path.name, f"more than {in_megabytes(LARGEST)}")

    write(order, take, path, progress, lambda: writer.is_stopped)


def _too_large(name: str, size: str) -> EtnetError:
    return EtnetError(
        f"{name} comes to {size}; a page hands out at most {in_megabytes(LARGEST)}: take fewer windows, or use "
        "`etnet export`"
    )


def _take_of(order: Order, loaded: LoadedPlayback, desk: Desk) -> Take:
    from etnet.export.take import Beside, Take

    wanted, first, last = order.wanted, *_range_of(order, loaded)
    if last - first >= MOST_WINDOWS:
        raise EtnetError(
            f"{last - first + 1:,} windows are more than one page holds ({MOST_WINDOWS:,}); "
            "choose a range, or use `etnet export`"
        )
    # A session says itself what was changed, and carries it in a branch of its own; a protocol changes nothing.
    is_changed = wanted.format != "session" and not wanted.is_replayed and order.change != NO_CHANGE
    request = ExportJob(order).request
    relay = Relay(desk, loaded, request, order.change) if is_changed else Relay(desk, loaded)
    beside = []
    for run in wanted.runs[1:]:
        assert loaded.beside is not None
        other = loaded.beside(run.request.plain)
        is_same_plan = run.request.playback.cut == request.playback.cut
        beside.append(Beside(cast("Playback", Relay(desk, other)), is_same_plan))
    offset = 0 if order.view is None or not wanted.runs else order.view.of(CompareState).offset
    return Take(cast("Playback", relay), first, last + 1, tuple(beside), offset)


def _range_of(order: Order, loaded: LoadedPlayback) -> tuple[int, int]:
    """The first and the last window."""
    wanted, num_windows = order.wanted, len(loaded.windows)
    if wanted.format == "png":
        index = ExportJob(order).request.index
        return index, index
    if wanted.is_replayed:
        found = windows_between(loaded.windows, *order.marks) or range(num_windows)
        return found.start, found.stop - 1
    first = 0 if wanted.first is None else max(wanted.first, 0)
    last = max(num_windows - 1 if wanted.last is None else wanted.last, first)
    if last >= num_windows:
        raise WindowError(
            f"windows {first} – {last} were ordered; there are 0 – {num_windows - 1}; set the marks again and export"
        )
    return first, last


def _runs_of(order: Order, view: ViewState, take: Take) -> Runs:
    """The names of the runs and how Compare shows them."""
    from etnet.export.compared import Runs, title_of
    from etnet.export.pictures import card_gamma

    compare, start, titles = view.of(CompareState), take.recording.span.start, []
    for ordered, playback in zip(
        order.wanted.runs, (take.playback, *(run.playback for run in take.beside)), strict=True
    ):
        model, request = playback.model, ordered.request
        cold_from = None if ordered.run.cold_from is None else (ordered.run.cold_from - start) / 1e6
        titles.append(title_of(model, request.policy, request.cleaning, cold_from, card_gamma(model)))
    numbers = tuple(ordered.number for ordered in order.wanted.runs)
    return Runs(tuple(titles), SIGHTS[compare.sight], camera_error_of(compare, numbers), numbers)


def file_name(name: str, format: ExportFormat) -> str:
    """What a format of a recording is called."""
    return f"{plain_name(name)}.{ENDINGS[format]}"

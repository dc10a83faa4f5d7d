"""A stretch of the current recording as a recording of its own: the file of `etnet cut`, made beside the engine."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import ClassVar

from app.engine.downloads import LARGEST, PATIENCE, Download, plain_name
from app.engine.file_writer import Writer
from app.engine.jobs import Job
from app.engine.playbacks import LoadedPlayback
from app.engine.requests import FrameRequest
from app.state.view_state import ViewState
from app.views.recording.state import TRIM_SLOT, RecordingState, TrimOrder
from etnet.errors import EtnetError
from etnet.events.recording import Recording
from etnet.files import in_megabytes
from etnet.private_folder import PrivateFolder

_ADVICE = "mark a shorter stretch, or use `etnet cut`"


@dataclass(frozen=True, slots=True)
class TrimJob:
    """The job that makes the file. Its answer is `None` until it is a `Download`."""

    is_ordered: ClassVar[bool] = True
    order: TrimOrder

    @property
    def request(self) -> FrameRequest:
        """The playback whose events these are."""
        order = self.order
        return FrameRequest(
            order.excerpt.recording_id, order.model_id, order.precision, order.policy, 0, cleaning=order.cleaning
        )

    def run(self, loaded: LoadedPlayback, cancelled: Callable[[], bool]) -> Iterator[tuple[Download | None, float]]:
        """A moment's wait for the writer between two yields; it needs no step of the network."""
        recording = loaded.playback.recording
        with PrivateFolder("etnet-cut-") as folder:
            path = folder / f"{plain_name(recording.name)}_cut.h5"
            writer = Writer(partial(_write, self.order, recording, path), "cutting")
            try:
                while not writer.is_done:
                    writer.wait(PATIENCE)
                    yield None, min(writer.share, 0.99)
                writer.raise_failure()
            finally:
                writer.stop()
            made = Download(path.name, path.read_bytes())
        yield made, 1.0


def trim_jobs(state: ViewState, request: FrameRequest) -> Mapping[str, Job]:
    """The cut that was ordered, if any."""
    order = state.of(RecordingState).cut
    return {} if order is None else {TRIM_SLOT: TrimJob(order)}


def _write(order: TrimOrder, recording: Recording, path: Path, writer: Writer) -> None:
    """Write the file; it is ended between two blocks of events or two frames."""
    from etnet.events.write import write_recording

    excerpt = order.excerpt
    start, stop, span = excerpt.start, excerpt.stop, excerpt.span
    if start >= stop:
        raise EtnetError("there is no event between the marks; mark a longer stretch")

    def progress(share: float) -> None:
        writer.note(share)
        size = sum(part.stat().st_size for part in path.parent.iterdir())
        if size > LARGEST:
            raise EtnetError(f"this stretch comes to more than the {in_megabytes(LARGEST)} of a page; {_ADVICE}")

    write_recording(recording, path, "event_utils", start=start, stop=stop, span=span, progress=progress)

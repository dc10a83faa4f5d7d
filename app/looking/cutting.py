"""A stretch of the recording on show as a recording of its own: the file of `etnet cut`, made beside the engine."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from threading import Thread

from app.looking.taking import LARGEST, PATIENCE, Made, plain_name
from app.source_view import CutOrder
from app.studies import Study
from app.studio import Stage
from app.view_state import ViewState
from app.wishes import Wish
from etnet.errors import Cancelled, EtnetError
from etnet.events.recording import Recording

SLOT = "source/cut"
_ADVICE = "mark a shorter stretch, or use `etnet cut`"


@dataclass(frozen=True, slots=True)
class Cutting:
    """The study that makes the file. Its answer is `None` until it is a `Made`."""

    order: CutOrder

    @property
    def wish(self) -> Wish:
        """The playback whose events these are."""
        order = self.order
        return Wish(order.excerpt.recording_id, order.model_id, order.precision, order.policy, 0)

    def run(self, stage: Stage, cancelled: Callable[[], bool]) -> Iterator[tuple[Made | None, float]]:
        """A moment's wait for the writer between two yields; it needs no step of the network."""
        recording = stage.playback.recording
        with tempfile.TemporaryDirectory(prefix="etnet-cut-") as folder:
            writer = _Writer(self.order, recording, Path(folder) / f"{plain_name(recording.name)}_cut.h5")
            try:
                while writer.is_alive():
                    writer.join(PATIENCE)
                    yield None, min(writer.share, 0.99)
            finally:
                writer.is_stopped = True
                writer.join()
            if writer.failure is not None:
                raise writer.failure
            made = Made(writer.path.name, writer.path.read_bytes())
        yield made, 1.0


def cut_question(state: ViewState, wish: Wish) -> Mapping[str, Study]:
    """The cut that was ordered, if any."""
    return {} if state.source.cut is None else {SLOT: Cutting(state.source.cut)}


class _Writer(Thread):
    """Writes one file; it is ended between two blocks of events or two frames."""

    def __init__(self, order: CutOrder, recording: Recording, path: Path) -> None:
        super().__init__(daemon=True, name="cutting")
        self._order, self._recording, self.path = order, recording, path
        self.share = 0.0
        self.is_stopped = False
        self.failure: Exception | None = None
        self.start()

    def run(self) -> None:
        """Called by the thread."""
        from etnet.events.write import write_recording

        excerpt, recording = self._order.excerpt, self._recording
        start = 0 if excerpt.begin is None else excerpt.begin.event
        stop = recording.num_events if excerpt.end is None else excerpt.end.event
        span = (
            recording.span.start if excerpt.begin is None else excerpt.begin.stamp,
            recording.span.stop if excerpt.end is None else excerpt.end.stamp,
        )
        try:
            if start >= stop:
                raise EtnetError("there is no event between the marks; mark a longer stretch")
            write_recording(recording, self.path, "event_utils", start=start, stop=stop, span=span, progress=self._note)
        except Exception as error:  # told to whoever ordered it, on the engine's thread
            self.failure = error

    def _note(self, share: float) -> None:
        self.share = share
        if self.is_stopped:
            raise Cancelled("what was to be cut out is not wanted any more")
        size = sum(part.stat().st_size for part in self.path.parent.iterdir())
        if size > LARGEST:
            raise EtnetError(f"this stretch comes to more than the {LARGEST / 1e6:.0f} MB of a page; {_ADVICE}")

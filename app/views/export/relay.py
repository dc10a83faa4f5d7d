"""Playbacks as a writer's thread sees them: their steps are made on the engine's thread, one at a time."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from queue import Empty, SimpleQueue
from typing import TYPE_CHECKING, Any

from app.engine.downloads import PATIENCE
from app.engine.playbacks import LoadedPlayback
from app.engine.requests import FrameRequest
from app.views.inspect.state import Change, InspectState, changed_request
from etnet.errors import Cancelled
from etnet.nets.intervention import Intervention

if TYPE_CHECKING:
    from etnet.playback.playback import Playback


class Desk:
    """Where a writer asks for steps and the engine makes them; all of a writer's playbacks share one."""

    def __init__(self) -> None:
        self._asked: SimpleQueue[tuple[Relay, int, Any]] = SimpleQueue()
        self._answers: SimpleQueue[Any] = SimpleQueue()
        self._open: tuple[Relay, int, Any] | None = None

    def ask(self, relay: Relay, index: int, probe: Any) -> Any:
        """The step of a window. Called by the writer; waits for the engine."""
        self._asked.put((relay, index, probe))
        answer = self._answers.get()
        if isinstance(answer, BaseException):
            raise answer
        return answer

    def serve(self, cancelled: Callable[[], bool]) -> None:
        """Make the step that is asked for, or wait a moment for one. A step that is cancelled is still owed: somebody
        waits for a frame, which comes first."""
        if self._open is None:
            try:
                self._open = self._asked.get(timeout=PATIENCE)
            except Empty:
                return
        relay, index, probe = self._open
        with suppress(Cancelled):
            try:
                answer = relay.step(index, probe, cancelled)
            except Cancelled:
                raise
            except Exception as error:
                answer = error
            self._open = None
            self._answers.put(answer)

    def give_up(self) -> None:
        """Let a writer that waits go."""
        self._answers.put(Cancelled("this export was cancelled"))


class Relay:
    """One playback at a desk."""

    def __init__(
        self, desk: Desk, loaded: LoadedPlayback, request: FrameRequest | None = None, change: Change | None = None
    ) -> None:
        """With a `change` the steps of `request`'s run have it, as the page shows it."""
        self._desk, self._loaded, self._request, self._change = desk, loaded, request, change
        playback: Playback = loaded.playback
        self.recording, self.windows, self.model = playback.recording, playback.windows, playback.model
        self.first = playback.first
        self._playback = playback

    def __len__(self) -> int:
        return len(self.windows)

    def at(self, index: int, probe: Any = None, **_: object) -> Any:
        """The step of a window. Called by the writer; waits for the engine."""
        return self._desk.ask(self, index, probe)

    def branch(self, at: int, intervention: Intervention) -> Relay:
        """Itself, with a change in the steps from window `at` on. Called by the writer before it asks for any."""
        self._playback = self._playback.branch(at, intervention)
        return self

    def step(self, index: int, probe: Any, cancelled: Callable[[], bool]) -> Any:
        """What the writer asked for, made on the engine's thread."""
        if self._request is None or self._change is None:
            return self._playback.at(index, probe, cancelled=cancelled)
        asked = replace(self._request, index=index)
        playback, intervention = self._loaded.playing(changed_request(InspectState(change=self._change), asked))
        return playback.at(index, probe, intervention, cancelled)

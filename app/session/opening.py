"""Recordings are opened and planned beside the page, which goes on answering; the newest request wins."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property, partial

from app.catalogue.cut import is_live, windows_of
from app.catalogue.live import WaitingForEvents
from app.catalogue.part_id import known_as
from app.catalogue.recordings import suited_policy
from app.catalogue.threads import THREADS
from app.catalogue.visitor import VisitorCatalogue
from app.engine.denoised import cleaned_once
from app.html.moment import Moment
from app.html.timeline_marks import curve_of
from app.state.view_state import Limits
from etnet.errors import EtnetError
from etnet.events.cleaning import UNCLEANED, Cleaning
from etnet.events.recording import Recording
from etnet.windows import Policy, Window


@dataclass(frozen=True, slots=True)
class Plan:
    """Which recording, cut how; `None` leaves the cut to the recording."""

    recording_id: str
    policy: Policy | None
    cleaning: Cleaning = UNCLEANED


@dataclass(frozen=True, eq=False)
class Opened:
    """A plan come true. What follows from it is found once: it is asked for with every picture."""

    plan: Plan
    policy: Policy
    recording: Recording
    windows: Sequence[Window]

    @cached_property
    def recording_id(self) -> str:
        """By which it is known: that of a part, if only a part of the file is there."""
        return known_as(self.plan.recording_id, self.recording)

    @property
    def share(self) -> float | None:
        """How much of the file is indexed by now, to the per cent; `None` where it is all there."""
        growth = self.recording.growth
        return None if growth is None else round(growth.share, 2)

    @property
    def is_outgrown(self) -> bool:
        """Whether the whole file can be opened, of which this is a part."""
        return self.recording.growth is not None and self.recording.growth.is_over

    @cached_property
    def limits(self) -> Limits:
        """What the reducer may do."""
        is_growing = self.recording.latest is not None
        return Limits(
            self.recording.sensor, self.windows, self.recording.span.start, is_growing, is_live(self.recording)
        )


@dataclass(frozen=True, slots=True)
class Unopened:
    """A plan that failed, and why in plain words."""

    plan: Plan
    message: str
    is_waiting: bool = False
    """It may be there in a moment: it is tried again, and nobody is told that it failed."""


@dataclass(frozen=True, slots=True)
class Opening:
    """How far a plan's recording is opened, 0 … 1: a format without an index, or a video, takes a while."""

    plan: Plan
    share: float


class Opener:
    """Opens beside the page. Replies come in any order; the session takes the one that fits its state."""

    def __init__(self, catalogue: VisitorCatalogue, tell: Callable[[Opened | Unopened | Opening], None]) -> None:
        self._catalogue = catalogue
        self._tell = tell
        self._begun: Plan | None = None

    def want(self, plan: Plan) -> None:
        """Begin with a plan, unless it is the last one that was begun."""
        if plan != self._begun:
            self._begun = plan
            THREADS.start(partial(self._open, plan), "opening")

    def heard(self, plan: Plan) -> None:
        """The answer to a plan has come: it may be begun again."""
        if plan == self._begun:
            self._begun = None

    def _open(self, plan: Plan) -> None:
        try:
            recording = self._catalogue.open(plan.recording_id, self._progress(plan))
            recording = cleaned_once(recording, plan.cleaning)
            policy = suited_policy(recording) if plan.policy is None else plan.policy
            windows = windows_of(recording, policy)
            if len(windows) == 0:
                self._tell(Unopened(plan, f"{recording.name}: holds no events, so there is nothing to show"))
            else:
                opened = Opened(plan, policy, recording, windows)
                # Of a large file it takes seconds: here, where nobody waits for it but who waits for the file.
                curve_of(Moment(opened.recording_id, policy, 0, recording, windows, plan.cleaning))
                self._tell(opened)
        except EtnetError as error:
            self._tell(Unopened(plan, str(error), isinstance(error, WaitingForEvents)))

    def _progress(self, plan: Plan) -> Callable[[float], None]:
        """Tells every whole per cent once."""
        told = -1

        def progress(share: float) -> None:
            nonlocal told
            if int(share * 100) > told:
                told = int(share * 100)
                self._tell(Opening(plan, share))

        return progress

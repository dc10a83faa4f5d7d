"""What one visitor has open: a recording and its windows, opened and planned beside the page, or why there are none."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cached_property, partial
from threading import Lock
from typing import Any

from app.catalogue.cut import CutRecording, is_live, windows_of
from app.catalogue.live import WaitingForEvents
from app.catalogue.recording_id import known_as, whole_id
from app.catalogue.recordings import suited_policy
from app.catalogue.threads import THREADS
from app.catalogue.visitor import VisitorCatalogue
from app.engine.denoised import CleanedRecordings
from app.engine.failures import in_words
from app.html.moment import Moment
from app.html.timeline_marks import curve_of
from app.state import intents as ask
from app.state.view_state import Limits, ViewState
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
    """Opens beside the page. Replies come in any order; the session takes the one that fits its state.

    A recording has one thread, however many plans are made for it while it is opened: it goes on with the newest.
    """

    def __init__(
        self,
        catalogue: VisitorCatalogue,
        cleaned: CleanedRecordings,
        tell: Callable[[Opened | Unopened | Opening], None],
    ) -> None:
        self._catalogue, self._cleaned = catalogue, cleaned
        self._tell = tell
        self._begun: Plan | None = None
        self._waiting: dict[str, Plan] = {}
        """By recording, what its thread does next."""
        self._at_work: set[str] = set()
        """Recordings that have a thread."""
        self._lock = Lock()

    def want(self, plan: Plan) -> None:
        """Begin with a plan, unless it is the last one that was begun."""
        key = plan.recording_id
        with self._lock:
            if plan == self._begun:
                return
            self._begun = self._waiting[key] = plan
            if key in self._at_work:
                return
            self._at_work.add(key)
        THREADS.start(partial(self._work, key), "opening")

    def heard(self, plan: Plan) -> None:
        """The answer to a plan has come: it may be begun again."""
        with self._lock:
            if plan == self._begun:
                self._begun = None

    def _work(self, key: str) -> None:
        while True:
            with self._lock:
                plan = self._waiting.pop(key, None)
                if plan is None:
                    self._at_work.discard(key)
                    return
            self._open(plan)

    def _is_wanted(self, plan: Plan) -> bool:
        """Whether no other plan came after it; the same one that came meanwhile is answered by it."""
        with self._lock:
            if self._waiting.get(plan.recording_id) == plan:
                del self._waiting[plan.recording_id]
            return self._begun in (None, plan)

    def _open(self, plan: Plan) -> None:
        try:
            recording = self._catalogue.open(plan.recording_id, self._progress(plan))
            if not self._is_wanted(plan):
                return
            recording = self._cleaned.of(recording, plan.cleaning)
            policy = suited_policy(recording) if plan.policy is None else plan.policy
            windows = windows_of(recording, policy)
            if len(windows) == 0:
                self._tell(Unopened(plan, f"{recording.name}: holds no events, so there is nothing to show"))
            else:
                opened = Opened(plan, policy, recording, windows)
                # Of a large file it takes seconds: here, where nobody waits for it but who waits for the file.
                curve_of(Moment(opened.recording_id, policy, 0, recording, windows, plan.cleaning))
                self._tell(opened)
        except Exception as error:  # whatever it was, a page that waits is told
            if plan.recording_id in self._waiting:
                return  # by the one that comes next: a film that was begun again is another one
            self._tell(Unopened(plan, in_words(error, self), isinstance(error, WaitingForEvents)))

    def _progress(self, plan: Plan) -> Callable[[float], None]:
        """Tells every whole per cent once."""
        told = -1

        def progress(share: float) -> None:
            nonlocal told
            if int(share * 100) > told:
                told = int(share * 100)
                self._tell(Opening(plan, share))

        return progress


class RecordingLoader:
    """Keeps what is open equal to what the view asks for. Used by the visitor's thread alone."""

    def __init__(
        self,
        catalogue: VisitorCatalogue,
        cleaned: CleanedRecordings,
        post: Callable[[Opened | Unopened | Opening], None],
    ) -> None:
        self._catalogue = catalogue
        self._opener = Opener(catalogue, cleaned, post)
        self._aims_at: tuple[int, int] | None = None
        """A moment (µs) that is still to be made, and the window that is shown instead."""
        self._opened: Opened | None = None
        self._refused: Plan | None = None
        self.trouble = ""
        """Why there is no moment, in plain words."""

    def limits(self, state: ViewState) -> Limits:
        """What the reducer may do; nothing is known while another recording is open than the view's."""
        held = self._of(state)
        return Limits() if held is None else held.limits

    def moment(self, state: ViewState) -> Moment | None:
        """The window that the view asks for, if its recording is open and cut as it says."""
        found = self.placed(state)
        return None if found is None or self.said_gone(state) else found

    def placed(self, state: ViewState) -> Moment | None:
        """The same, also where its events have left a live recording's buffer: it still has a place in time."""
        held = self._of(state)
        if held is None or held.policy != state.policy or held.plan.cleaning != state.cleaning:
            return None
        return Moment(state.recording_id, held.policy, state.index, held.recording, held.windows, state.cleaning)

    def said_gone(self, state: ViewState) -> str:
        """That the window's events have left the buffer, and what has; empty where they are there."""
        held, placed = self._of(state), self.placed(state)
        if held is None or placed is None or not isinstance(held.recording, CutRecording):
            return ""
        if not held.recording.is_gone(placed.window):
            return ""
        return f"gone: before {held.recording.gone_before:.1f} s"

    def has_left(self, state: ViewState) -> bool:
        """The same of what could not be drawn: where not even its window can be told, that is not why."""
        with suppress(Exception):
            return bool(self.said_gone(state))
        return False

    def within(self, state: ViewState) -> ViewState:
        """The view at the nearest window that its recording has here: another page, which leads, may have more."""
        if self.placed(state) is None:
            return state
        index = self.limits(state).clamp_index(state.index)
        return state if index == state.index else replace(state, index=index)

    def want(self, state: ViewState) -> None:
        """Begin to open what the view asks for, unless it is there, or was refused."""
        is_outgrown = self._opened is not None and self._opened.is_outgrown
        if self.placed(state) is not None and not is_outgrown:
            return
        if (plan := _plan_of(state)) != self._refused:
            self._catalogue.looks_at(plan.recording_id)
            self._opener.want(plan)

    @property
    def recording_id(self) -> str | None:
        """What is open, whatever the view asks for."""
        return None if self._opened is None else self._opened.recording_id

    def forget_refusal(self) -> None:
        """The view asks for something else again: what was refused may be tried another time."""
        self._refused, self.trouble = None, ""

    @property
    def share(self) -> float | None:
        """How much of the current file is indexed by now; `None` where it is all there."""
        return None if self._opened is None else self._opened.share

    def take(self, item: Opened | Unopened | Opening, state: ViewState) -> tuple[tuple[Any, ...], str]:
        """Fold one letter of the opener: what follows for the view, and what is to be said of a failure."""
        if isinstance(item, Opening):
            if item.plan.recording_id == _plan_of(state).recording_id and self.moment(state) is None:
                self.trouble = f"It is being opened: {item.share:.0%}."
            return (), ""
        self._opener.heard(item.plan)
        if item.plan != _plan_of(state):
            return (), ""
        if isinstance(item, Opened):
            self._opened, self._refused, self.trouble = item, None, ""
            last = len(item.windows) - 1
            is_beyond = state.moment is not None and state.moment > item.windows[last].t_stop
            self._aims_at = (state.moment, last) if is_beyond and state.moment is not None else None
            return (ask.RenameRecording(item.recording_id), ask.Settle(item.policy)), ""
        if item.is_waiting:
            self._opened, self.trouble = None, item.message
            return (), ""
        held = self._opened
        if held is not None and held.plan.recording_id == item.plan.recording_id:
            if (held.policy, held.plan.cleaning) == (item.plan.policy, item.plan.cleaning):
                self._refused = item.plan  # a part that could not become whole stays what it is
            # What worked: the windows and the filter as they were.
            return (ask.ChooseCleaning(held.plan.cleaning), ask.ChoosePolicy(held.policy)), item.message
        self._refused, self.trouble = item.plan, item.message  # what was open before stays, to return to
        return (), item.message

    def grow(self, state: ViewState) -> tuple[bool, Any | None]:
        """Take in what a recording that is still being made has become: whether it has, and what follows."""
        held = self._of(state)
        if held is None or held.recording.latest is None:
            return False, None
        try:
            recording = held.recording.latest()
        except EtnetError:
            return False, None  # it is gone; the next one to open it is told
        if recording is held.recording:
            return False, None
        windows = windows_of(recording, held.policy, held.windows)
        self._opened = replace(held, recording=recording, windows=windows)
        if state.follows_newest and self._opened.limits.is_live:
            return True, ask.FollowNewest()
        return True, self._nearer(state, self._opened)

    def _nearer(self, state: ViewState, held: Opened) -> Any | None:
        """On to the moment that was asked for, as far as it is made; not where the visitor has gone elsewhere."""
        if self._aims_at is None or state.index != self._aims_at[1] or state.is_playing:
            self._aims_at = None
            return None
        stamp, _ = self._aims_at
        index = held.limits.index_at(stamp)
        last = len(held.windows) - 1
        self._aims_at = (stamp, index) if index == last and held.recording.latest is not None else None
        return ask.Seek(index)

    def _of(self, state: ViewState) -> Opened | None:
        held = self._opened
        return held if held is not None and held.recording_id == state.recording_id else None


def _plan_of(state: ViewState) -> Plan:
    return Plan(whole_id(state.recording_id), state.policy, state.cleaning)

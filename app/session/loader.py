"""What one visitor has open: the recording and its windows, or why there are none."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

from app.catalogue.cut import CutRecording, windows_of
from app.catalogue.part_id import whole_id
from app.catalogue.visitor import VisitorCatalogue
from app.html.moment import Moment
from app.session.opening import Opened, Opener, Opening, Plan, Unopened
from app.state import intents as ask
from app.state.view_state import Limits, ViewState
from etnet.errors import EtnetError


class RecordingLoader:
    """Keeps what is open equal to what the view asks for. Used by the visitor's thread alone."""

    def __init__(self, catalogue: VisitorCatalogue, post: Callable[[Opened | Unopened | Opening], None]) -> None:
        self._catalogue = catalogue
        self._opener = Opener(catalogue, post)
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

    def want(self, state: ViewState) -> None:
        """Begin to open what the view asks for, unless it is there, or was refused."""
        plan = _plan_of(state)
        is_outgrown = self._opened is not None and self._opened.is_outgrown
        if (self.placed(state) is None or is_outgrown) and plan != self._refused:
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

"""What one visitor has open: the recording and its windows, or why there are none."""

from __future__ import annotations

from collections.abc import Callable

from app import intents as ask
from app.opening import Opened, Opener, Opening, Plan, Unopened
from app.own_catalogue import OwnCatalogue
from app.present import Moment
from app.view_state import Limits, ViewState


class Held:
    """Keeps what is open equal to what the view asks for. Used by the visitor's thread alone."""

    def __init__(self, catalogue: OwnCatalogue, post: Callable[[Opened | Unopened | Opening], None]) -> None:
        self._opener = Opener(catalogue, post)
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
        held = self._of(state)
        if held is None or held.policy != state.policy:
            return None
        return Moment(state.recording_id, held.policy, state.index, held.recording, held.windows)

    def want(self, state: ViewState) -> None:
        """Begin to open what the view asks for, unless it is there, or was refused."""
        plan = Plan(state.recording_id, state.policy)
        if self.moment(state) is None and plan != self._refused:
            self._opener.want(plan)

    def take(self, item: Opened | Unopened | Opening, state: ViewState) -> tuple[ask.Intent | None, str]:
        """Fold one letter of the opener: what follows for the view, and what is to be said of a failure."""
        if isinstance(item, Opening):
            if item.plan.recording_id == state.recording_id and self.moment(state) is None:
                self.trouble = f"It is being opened: {item.share:.0%}."
            return None, ""
        self._opener.heard(item.plan)
        if item.plan != Plan(state.recording_id, state.policy):
            return None, ""
        if isinstance(item, Opened):
            self._opened, self._refused, self.trouble = item, None, ""
            return ask.Settle(item.policy), ""
        held = self._of(state)
        if held is not None:
            return ask.ChoosePolicy(held.policy), item.message  # the windows that worked
        self._opened, self._refused, self.trouble = None, item.plan, item.message
        return None, item.message

    def _of(self, state: ViewState) -> Opened | None:
        held = self._opened
        return held if held is not None and held.plan.recording_id == state.recording_id else None

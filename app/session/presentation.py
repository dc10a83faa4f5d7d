"""One page leads, the others show its moment: same recording, windows and frame, each with a pointer of its own."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from dataclasses import dataclass, replace

from app.session.messages import Presented
from app.state.view_state import ViewState
from etnet.errors import EtnetError

RELOADS_WITHIN = 10.0
"""Seconds for which the lead is kept for a page that left: a reload is a page that leaves and a page that comes."""


@dataclass(slots=True, eq=False)
class Seat:
    """One page's place in a presentation."""

    room: Presentation
    is_host: bool
    """Whether it sits at the viewer's own machine."""
    opens: Callable[[str], object]
    """Raises an EtnetError for a recording that this page may not open."""
    post: Callable[[Presented], None]
    """Told that the page that leads has moved, or that another one leads."""

    @property
    def words(self) -> str:
        """What the page says of it."""
        num = self.room.num_followers
        if self.room.leads(self):
            return f"Presenting to {num} page{'s' if num != 1 else ''}" if num else "Presenting"
        return "Following the presenter" if self.room.moment is not None else ""

    def show(self, state: ViewState) -> None:
        """This page has moved: where it leads, the others follow."""
        self.room.show(self, state)

    def following(self, state: ViewState) -> ViewState:
        """The page with the presenter's moment; as it is where it leads, or may not open that recording."""
        led = None if self.room.leads(self) else self.room.moment
        if led is None or led == _moment_of(state):
            return state
        if led.recording_id != state.recording_id:
            try:
                self.opens(led.recording_id)
            except EtnetError:
                return state
            state = replace(state, query=None, mark_a=None, mark_b=None)
        return replace(
            state,
            recording_id=led.recording_id,
            model_id=led.model_id,
            precision=led.precision,
            policy=led.policy,
            cleaning=led.cleaning,
            index=led.index,
            follows_newest=led.follows_newest,
            moment=None,
            is_playing=False,
        )

    def leave(self) -> None:
        """The page is gone."""
        self.room.leave(self)


class Presentation:
    """All pages of a viewer that presents. Safe from every thread."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._seats: list[Seat] = []
        self._leader: Seat | None = None
        self._kept_until = 0.0
        self._moment: ViewState | None = None

    @property
    def moment(self) -> ViewState | None:
        """The moment that is shown, with nothing else of the presenter's page."""
        return self._moment

    @property
    def num_followers(self) -> int:
        """Pages beside the one that leads."""
        return max(len(self._seats) - 1, 0)

    def join(
        self, is_host: bool, opens: Callable[[str], object], post: Callable[[Presented], None] = lambda news: None
    ) -> Seat:
        """A page has come. The first one leads; one at the viewer's own machine before all others."""
        seat = Seat(self, is_host, opens, post)
        with self._lock:
            self._seats.append(seat)
            leader = self._leader
            if leader is None or (is_host and not leader.is_host):
                self._leader = seat
        self._tell()
        return seat

    def leads(self, seat: Seat) -> bool:
        """Whether the others show what this page shows."""
        with self._lock:
            is_free = self._leader is None and bool(self._seats) and time.monotonic() > self._kept_until
            if is_free:
                self._leader = next((each for each in self._seats if each.is_host), self._seats[0])
            leader = self._leader
        if is_free:
            self._tell()  # the page that leads now may have nothing else to draw
        return leader is seat

    def show(self, seat: Seat, state: ViewState) -> None:
        """The page that leads has moved."""
        if not self.leads(seat) or state.policy is None or (moment := _moment_of(state)) == self._moment:
            return
        self._moment = moment
        self._tell()

    def leave(self, seat: Seat) -> None:
        """A page has gone; its lead is kept for a moment, in case it comes back."""
        with self._lock:
            self._seats.remove(seat)
            if self._leader is seat:
                self._leader, self._kept_until = None, time.monotonic() + RELOADS_WITHIN
        self._tell()

    def _tell(self) -> None:
        with self._lock:
            seats = tuple(self._seats)
        for seat in seats:
            seat.post(Presented())


def _moment_of(state: ViewState) -> ViewState:
    """What of a page the others follow."""
    return ViewState(
        recording_id=state.recording_id,
        model_id=state.model_id,
        precision=state.precision,
        policy=state.policy,
        cleaning=state.cleaning,
        index=state.index,
        follows_newest=state.follows_newest,
    )

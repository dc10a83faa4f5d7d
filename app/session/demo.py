"""The demo while nobody touches it: recording after recording, each in three acts that point at the live pictures.

Any touch hands control over; when the page was left alone for `IDLE` seconds it starts afresh and goes on.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

from app.catalogue.recording_id import listed_id
from app.state import intents as ask
from app.state.view_state import ViewState
from app.views import VIEWS
from app.views.demo.state import Act, DemoState, Large, PointAt
from app.views.view import View

IDLE = 60.0
"""Seconds without a touch after which the page belongs to the next visitor."""
MOST_MESSAGES = 120.0
"""A second, of one visitor: more than any hand makes (a dragged slider sends about 60)."""
BURST = 240.0
MOST_VISITORS = 24
"""At once: what two cores keep up with when all of them only watch."""
STALLED = 20.0
"""Seconds after which an act ends though what it is about never came."""

_PLACES = ((0.5, 0.45), (0.3, 0.6), (0.66, 0.3))
"""Where the third act looks from, as fractions of the picture."""
_FORBIDDEN = (
    ask.ReopenRecording | ask.ChooseModel | ask.ChoosePrecision | ask.ChoosePolicy | ask.ChooseCleaning
    | ask.ShowWorkspace | ask.OpenTab | ask.StageCard
)  # fmt: skip
"""What a visitor may not do in public: it would load networks, plan windows and lay states at everybody's expense, or
leave the demo, which alone starts over when its visitor has gone."""


def may_ask(intent: Any, views: Sequence[View]) -> bool:
    """Whether a visitor in public may ask for this: of the page most, of a view all, if it is a public one."""
    if isinstance(intent, _FORBIDDEN):
        return False
    if isinstance(intent, ask.OpenRecording) and intent.recording_id != listed_id(intent.recording_id):
        return False  # the same file, seen in another way
    if isinstance(intent, ask.Set):
        return any(view.name == intent.view and view.is_public for view in views)
    home = type(intent).__module__
    return all(view.is_public for view in views if type(view.initial).__module__ == home)


@dataclass(frozen=True, slots=True)
class DemoStep:
    """A stretch of the show: what it does when it begins, and for how long it stays.

    `recording_id`: the page starts afresh with it; `None`: it goes on as it is.
    """

    seconds: float
    act: Act
    recording_id: str | None = None
    plays: bool = False
    is_live: bool = False
    place: tuple[float, float] | None = None


def steps_of(recording_id: str, is_live: bool = False) -> tuple[DemoStep, ...]:
    """Three acts of a recording, and the invitation. A live one goes on by itself, and stands still for the third."""
    begins = DemoStep(8.0, "events", recording_id, plays=True, is_live=is_live)
    image = DemoStep(6.0, "image", plays=True, is_live=is_live)
    looks = tuple(DemoStep(4.2, "places", is_live=is_live, place=place) for place in _PLACES)
    return (begins, image, *looks, DemoStep(5.0, "invite", plays=True, is_live=is_live))


class DemoScript:
    """Leads a page from its first moment on. Times are seconds of any steady clock."""

    def __init__(self, recording_ids: Sequence[str], live_id: str = "") -> None:
        """`live_id`: a source's recording, which then is the whole show."""
        self._ids = (live_id,) if live_id else tuple(recording_ids)
        self._is_live = bool(live_id)
        self._beats = self._rounds()
        self._beat: DemoStep | None = None
        self._began_at = 0.0
        self._asked_at = 0.0
        self._touched_at: float | None = None

    @property
    def is_leading(self) -> bool:
        """Whether nobody has touched the page of late."""
        return self._touched_at is None

    def touch(self, now: float) -> bool:
        """A visitor did something; whether they take control with this touch."""
        was_leading, self._touched_at = self.is_leading, now
        return was_leading

    def due(self, is_up: bool, now: float) -> DemoStep | None:
        """The beat that begins now; `None` while the present one lasts, or a visitor leads.

        `is_up`: the recording is there and has its first image, or what the act is about.
        """
        if not self._ids:
            return None
        if self._touched_at is not None:
            if now - self._touched_at < IDLE:
                return None
            self._touched_at, self._beat, self._beats = None, None, self._rounds()
        beat = self._beat
        if beat is not None:
            if not is_up and now - self._asked_at < STALLED:
                self._began_at = now  # its time counts from when there is something to see
                return None
            if now - self._began_at < beat.seconds:
                return None
        self._beat, self._began_at, self._asked_at = next(self._beats), now, now
        return self._beat

    def _rounds(self) -> Iterator[DemoStep]:
        while True:
            for recording_id in self._ids:
                yield from steps_of(recording_id, self._is_live)


def intents_of(beat: DemoStep, state: ViewState) -> tuple[Any, ...]:
    """What a beat asks of the page when it begins."""
    intents: list[Any] = [PointAt(beat.act)]
    runs = state.follows_newest if beat.is_live else state.is_playing
    if beat.plays != runs:
        intents.append(ask.FollowNewest() if beat.plays and beat.is_live else ask.TogglePlay())
    if beat.place is not None:
        intents.append(ask.QueryFraction(*beat.place))
    return tuple(intents)


def public_view(default: ViewState, views: Sequence[View] = VIEWS) -> ViewState:
    """How a public page begins: large pictures, each shown when the network has made it."""
    public = replace(default, workspace="demo", waits_for_frames=True, is_public=True)
    return public.put(*(view.in_public for view in views if view.in_public is not None))


def public_moment(linked: ViewState, state: ViewState) -> ViewState:
    """What of a link's moment a page in public shows: the recording, the time and the pixel, as the demo shows them."""
    large: Large = "cloud" if linked.query is None else "map"
    there = replace(state, recording_id=listed_id(linked.recording_id), policy=None, query=linked.query)
    there = replace(there, index=0, moment=linked.moment, mark_a=None, mark_b=None, is_playing=False)
    return there.put(DemoState(large=large))


class Throttle:
    """A bucket of `BURST` messages that fills by `MOST_MESSAGES` a second; what finds it empty is dropped."""

    def __init__(self, now: float) -> None:
        self._level = BURST
        self._at = now

    def takes(self, now: float) -> bool:
        """Whether one more message passes."""
        self._level = min(BURST, self._level + (now - self._at) * MOST_MESSAGES)
        self._at = now
        if self._level < 1.0:
            return False
        self._level -= 1.0
        return True

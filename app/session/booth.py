"""What a visitor has beside the page: their own camera, pages to take home, a place in a presentation."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from app.catalogue.homes import Homes
from app.catalogue.mirror import Mirror
from app.engine.downloads import Download, Downloaded
from app.html.moment import Moment
from app.session.jobs import JobNews
from app.session.presentation import Seat
from app.state import intents as ask
from app.state.view_state import Limits, ViewState
from app.views.demo.state import HOME_SLOT, DemoState, HomeFailed, HomeReady, MirrorEnded, OpenSheet, TakeHome
from app.views.page import MirrorShown

STUCK = 6.0
"""Seconds after which the mirror goes on though the image of its moment never came."""
WAITS = 120.0
"""Seconds for which a visitor waits for the page that they ordered; then they count as gone."""


@dataclass(frozen=True, slots=True)
class MirrorNews:
    """A message: the visitor's camera has begun as this recording, or is over ("")."""

    recording_id: str


class Booth:
    """One visitor's. Used by their thread."""

    def __init__(
        self, mirror: Mirror | None = None, homes: Homes | None = None, public_url: str = "", seat: Seat | None = None
    ) -> None:
        self._seat = seat
        self.mirror, self.homes, self.public_url = mirror, homes, public_url.rstrip("/")
        self.idle = None if mirror is None else MirrorShown(mirror.ticket)
        """What the page says of a mirror that does not run."""
        self._moved_at = 0.0
        self._ordered: tuple[Any, float] | None = None

    @property
    def recording_id(self) -> str:
        """The mirror's recording, while it runs; "" otherwise."""
        return "" if self.mirror is None else self.mirror.recording_id

    @property
    def is_active(self) -> bool:
        """Whether a camera, what was ordered of it, or a presenter may move the page; else only its visitor does."""
        mirror = self.mirror
        return self._seat is not None or (mirror is not None and bool(mirror.recording_id or mirror.ordered))

    @property
    def presenting(self) -> str:
        """That the page leads others or follows one, in words; empty where nobody presents."""
        return "" if self._seat is None else self._seat.words

    def following(self, state: ViewState) -> ViewState:
        """The page with the presenter's moment, where there is one."""
        return state if self._seat is None else self._seat.following(state)

    def present(self, state: ViewState) -> None:
        """The page shows this: others may follow."""
        if self._seat is not None:
            self._seat.show(state)

    def is_live(self, state: ViewState) -> bool:
        """Whether the page shows the mirror."""
        return bool(self.recording_id) and state.recording_id == self.recording_id

    def offers(self, intent: Any) -> bool:
        """Whether what a page asks for is to be had here: a page can send what it does not show."""
        match intent:
            case TakeHome() | OpenSheet("home"):
                return self.homes is not None
            case OpenSheet("mirror"):
                return self.mirror is not None
        return True

    def heard(self, news: MirrorNews, home_id: str) -> tuple[Any, ...]:
        """What follows when the camera begins or ends: its recording plays, or the former one is shown again."""
        if self.mirror is not None:
            self.idle = MirrorShown(self.mirror.ticket, trouble=self.mirror.trouble)
        if news.recording_id:
            return OpenSheet(""), ask.OpenRecording(news.recording_id), ask.TogglePlay()
        is_told = self.mirror is not None and bool(self.mirror.trouble)
        return ask.OpenRecording(home_id), ask.TogglePlay(), MirrorEnded(is_told)

    def waits(self, state: ViewState) -> bool:
        """Whether the visitor waits for their page: they have not gone, though they touch nothing."""
        order, now = state.of(DemoState).order, time.monotonic()
        if order is None:
            self._ordered = None
            return False
        if self._ordered is None or self._ordered[0] is not order:
            self._ordered = order, now
        return now - self._ordered[1] < WAITS

    def advance(self, state: ViewState, shown: int | None) -> None:
        """Close the mirror's next window, once the image of the current one has come."""
        if self.mirror is None:
            return
        order = state.of(DemoState).order
        self.mirror.ordered = "" if order is None else order.recording_id
        if not self.is_live(state) or not state.is_playing:
            return
        if (shown is not None and shown >= state.index) or time.monotonic() - self._moved_at > STUCK:
            self._moved_at = time.monotonic()
            self.mirror.advance()

    def newest(self, state: ViewState, limits: Limits) -> int | None:
        """The window that is due while the mirror plays; `None` to stay."""
        if not self.is_live(state) or not state.is_playing or not limits.windows:
            return None
        last = len(limits.windows) - 1
        return last if last > state.index else None

    def goes_on(self, intent: Any, was_playing: bool, state: ViewState) -> tuple[Any, ...]:
        """A touch asks where the network looks, or for a page; in the mirror, the world goes on meanwhile.

        A scene that is opened in public plays.
        """
        if isinstance(intent, ask.OpenRecording):
            return self.opened(intent.recording_id, state)[1:]
        pauses = isinstance(intent, ask.Query | ask.QueryFraction | TakeHome)
        return (ask.TogglePlay(),) if pauses and was_playing and not state.is_playing and self.is_live(state) else ()

    def opened(self, recording_id: str, state: ViewState) -> tuple[Any, ...]:
        """What opens a recording: nobody who comes by would think of pressing play."""
        plays = state.is_public and (recording_id != state.recording_id or not state.is_playing)
        return ask.OpenRecording(recording_id), *((ask.TogglePlay(),) if plays else ())

    def shown(self, moment: Moment | None, ready_index: int | None) -> MirrorShown | None:
        """What the page says of the mirror."""
        mirror = self.mirror
        if mirror is None:
            return None
        delay, is_live = None, moment is not None and bool(mirror.recording_id)
        if moment is not None and is_live and moment.recording_id == mirror.recording_id and ready_index is not None:
            delay = _delay(mirror, moment.windows, ready_index)
        return MirrorShown(mirror.ticket, bool(mirror.recording_id), delay, mirror.trouble)

    def kept(self, news: JobNews) -> tuple[Any, ...] | None:
        """A page that is made goes to its place, and the visitor is told where; `None`: it is no such page."""
        made = news.result.value
        if news.slot == HOME_SLOT and news.result.trouble:
            return (HomeFailed(news.result.trouble),)
        if news.slot != HOME_SLOT or not isinstance(made, Download):
            return None
        ready = () if self.homes is None else (HomeReady(self.homes.put(made.content)),)
        return *ready, Downloaded(news.slot)

    def close(self) -> None:
        """The visitor has gone."""
        if self._seat is not None:
            self._seat.leave()
        if self.mirror is not None:
            self.mirror.close()


def _delay(mirror: Mirror, windows: Sequence[Any], index: int) -> float | None:
    behind = mirror.behind(windows[index].t_stop) if index < len(windows) else None
    return None if behind is None else round(behind, 1)

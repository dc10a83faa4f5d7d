"""One visitor: what they asked for, what their page shows, and the thread that turns the one into the other.

Callbacks only put things into the mailbox. The visitor's own thread takes them out, folds them into the `ViewState`,
draws what needs no model at once, and asks the engine for the rest; the newest request wins.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from queue import Empty, SimpleQueue
from typing import Any

import viser

from app.catalogue.recording_id import whole_id
from app.catalogue.threads import THREADS
from app.catalogue.visitor import VisitorCatalogue
from app.catalogue.visitor_uploads import VisitorUploads
from app.engine.engine import Engine
from app.engine.failures import in_words
from app.engine.requests import Failed, Ready, Working
from app.html.timeline_marks import Cached
from app.session.booth import Booth, MirrorNews
from app.session.channel import AskHelp, Copied, FollowLink, Hello, Hover, RemoveFile, Resized, Touched
from app.session.facts import KnownFacts
from app.session.jobs import JobNews
from app.session.layout import arrangement_of, build_layout, watch_canvas
from app.session.loader import Opened, Opening, RecordingLoader, Unopened
from app.session.messages import CanvasChanged, Closed, HandedOver, Item, Presented
from app.session.page import FOLLOW_INTERVAL, PageComposer, VisitorRequests
from app.session.player import Player
from app.session.runs import RunPlanned, RunReply
from app.session.saved_view import SavedView
from app.session.standing import NOTHING_REFUSED, Standing
from app.session.visit import Shown, Visit
from app.state import intents as ask
from app.state.view_state import ViewState
from app.views import VIEWS
from app.views.page import Page
from app.views.view import View, reduce_views

PUSH_INTERVAL = 1 / 30
"""Seconds between two pushes of pictures and text; the first one after a rest goes at once."""
REST = 0.3
"""Seconds without a new window after which the scene is drawn in full."""
WAIT_FOR_HELLO = 1.0
"""Seconds in which a page says which tab it is; after that it is shown the default view."""
GLANCE = 0.5
"""Seconds between two looks at what the engine has cached."""
BUSY_FOR = 2.0
"""Seconds after which what waits for a moment in which nothing comes in is done all the same."""


class Session:
    """Made when a visitor connects, closed when they leave."""

    def __init__(
        self,
        client: viser.ClientHandle,
        catalogue: VisitorCatalogue,
        engine: Engine,
        default: ViewState,
        desk: VisitorUploads | None = None,
        views: Sequence[View] = VIEWS,
        follow_session: Callable[[str], ViewState | None] = lambda recording_id: None,
        booth: Booth | None = None,
        mail: SimpleQueue[Item] | None = None,
    ) -> None:
        """`desk` holds the uploaded files, `booth` the visitor's camera; they are closed with the session.

        `follow_session` gives the page of an uploaded session file, by its id, and `None` for a recording. `mail` is
        the mailbox, where camera and presentation have news before the session is there.
        """
        self._is_public = default.is_public
        self._standing = Standing()
        self._client = client
        self._views = views
        self._desk = desk
        self._booth = Booth() if booth is None else booth
        self._default = default
        self._catalogue = catalogue
        self._engine = engine
        self._visitor = f"visitor-{client.client_id}"
        self._mail: SimpleQueue[Item] = SimpleQueue() if mail is None else mail
        self._state = default
        self._keeper = SavedView(client, default, [view.initial for view in views])
        self._held = RecordingLoader(catalogue, engine.cleaned, self._mail.put)
        self._player = Player()
        self._asked = VisitorRequests(engine, catalogue, self._visitor, views, self._mail.put)
        self._answers = self._asked.frames
        self._is_known = default.is_public  # nothing is kept of a visitor in public, so no tab is waited for
        self._has_asked = False
        self._is_closed = False
        self._is_dirty = True
        self._known = KnownFacts(catalogue, desk)
        self._composer = PageComposer(views, self._known, engine, self._answers, self._held, self._booth)
        self.drawn: tuple[float, Page] | None = None
        """When (monotonic clock) and what was drawn last, during the visit; it may be read from any thread."""
        self._shown_index = -1
        self._has_played = False
        self._moved_at = 0.0
        self._pushed_at = 0.0
        self._glanced_at = self._grown_at = self._tidied_at = 0.0
        self._cached: Cached | None = None
        self._hovers_at: float | None = None
        """Seconds on the timeline that the pointer is over."""
        self._showing = Visit(client, catalogue, default, views, self._booth, follow_session)
        ticket = "" if desk is None else desk.ticket
        self._layout = build_layout(client, self._speak, views, self._is_public, ticket)
        self._layout.arrange(self._state)
        watch_canvas(client, self._showing.hears, lambda: self._mail.put(CanvasChanged()))
        if desk is not None:
            desk.on_change = lambda arrived: self._mail.put(HandedOver(arrived))
        THREADS.start(self._run, self._visitor)

    def close(self) -> None:
        """The visitor has gone: nothing more is computed for them."""
        self._mail.put(Closed())

    def _speak(self, item: Item) -> None:
        """What a visitor does, on viser's event loop."""
        if not self._is_public or self._showing.hears():
            self._mail.put(item)

    # ---- the visitor's own thread ----

    def _run(self) -> None:
        self._asked.begin()
        try:
            self._serve()
        finally:
            self.drawn = None
            self._asked.close()
            self._catalogue.close()
            self._booth.close()
            if self._desk is not None:
                self._desk.close()

    def _serve(self) -> None:
        began = time.monotonic()
        while not self._is_closed:
            try:
                has_heard = False
                for item in letters(self._mail, self._patience()):
                    has_heard = True
                    self._take(item)
                if not self._is_known and time.monotonic() - began > WAIT_FOR_HELLO:
                    self._is_known = True
                if not self._is_closed and self._is_known:
                    self._advance()
                    if not has_heard or time.monotonic() - self._tidied_at > BUSY_FOR:
                        self._tidy()
            except Exception as error:  # what cannot be drawn must not end the visit
                if self._held.has_left(self._state):
                    self._is_dirty = True  # it left a live recording while it was drawn: that is drawn next
                    continue
                with suppress(UserWarning):  # viser's, of a page that has gone; its session ends in a moment
                    self._showing.refuse("This could not be shown", in_words(error, self))
                self._is_dirty = False

    def _patience(self) -> float:
        since = time.monotonic() - self._pushed_at
        if self._is_dirty or self._state.is_playing:
            return max(PUSH_INTERVAL - since, 0.001)
        if self._follows():
            return max(FOLLOW_INTERVAL - since, 0.001)
        return REST / 2 if self._is_moving() else GLANCE

    def _take(self, item: Item) -> None:
        match item:
            case Closed():
                self._is_closed = True
            case Hello(tab):
                self._greet(tab)
            case AskHelp() | FollowLink() | Copied():
                self._answer(item)
            case Touched():
                self._touch()
            case Resized() | CanvasChanged() | Presented():
                pass
            case Hover(seconds):
                self._hovers_at = seconds
            case HandedOver(arrived):
                self._known.forget()
                self._open_handed(arrived)
            case MirrorNews():
                self._touch()
                self._reduce(*self._booth.heard(item, self._default.recording_id))
            case RemoveFile(recording_id):
                self._known.forget()
                self._remove(recording_id)
            case Ready() | Working() | Failed() | JobNews() | RunPlanned() | RunReply():
                if self._asked.take(item):
                    self._is_dirty = True
                    if isinstance(item, JobNews):
                        self._reduce(*self._showing.hand_over(item))
                return
            case Opening() | Opened() | Unopened():
                self._known.forget()
                follows, trouble = self._held.take(item, self._state)
                if trouble:
                    self._showing.refuse("Cannot be shown", trouble)
                    before = self._standing.returned(self._state, self._held.recording_id, trouble)
                    if before is not None and not follows and self._held.moment(self._state) is None:
                        self._held.forget_refusal()
                        self._state = before
                        self._layout.arrange(self._state)
                self._reduce(*follows)
            case _:
                self._has_asked = True
                self._touch()
                if self._showing.permits(item):
                    self._perform(item)
        self._is_dirty = True

    def _perform(self, intent: Any) -> None:
        """What a visitor asks for, and may."""
        for view in self._views:
            view.perform(intent, self._catalogue)
        was_playing = self._state.is_playing
        if isinstance(intent, ask.TogglePlay | ask.ChooseSpeed):
            step = None if self.drawn is None else self.drawn[1].step_milliseconds
            self._reduce(*self._player.before(intent, self._state, self._held.limits(self._state), step))
        self._reduce(intent)
        if self._booth.is_active or self._is_public:
            self._reduce(*self._booth.goes_on(intent, was_playing, self._state))

    def _open_handed(self, recording_id: str) -> None:
        """A file has come, unless the id is ""."""
        if not recording_id:
            return
        self._touch()
        self._has_asked = self._is_known = True
        self._state, intents = self._showing.handed(recording_id, self._state)
        self._layout.arrange(self._state)
        self._reduce(*intents)

    def _remove(self, recording_id: str) -> None:
        if self._desk is None:
            return
        if whole_id(self._state.recording_id) == recording_id:
            self._reduce(ask.OpenRecording(self._default.recording_id))
        self._desk.remove(recording_id)

    def _lead(self) -> None:
        """Go on with the show, where the page is in public and nobody has touched it."""
        is_up = self._held.moment(self._state) is not None and self._answers.shows(self._state)
        if (stretch := self._showing.lead(self._state, is_up)) is None:
            return
        if self._desk is not None:
            self._desk.clear()  # its owner has gone
        self._state, intents = stretch
        self._layout.arrange(self._state)
        for intent in intents:
            self._reduce(intent)
        self._is_dirty = True

    def _greet(self, tab: int) -> None:
        if self._is_public:
            self._is_known = True
            return
        if self._keeper.knows_tab:
            return
        recalled, refused = self._keeper.recall(tab)
        if self._has_asked:
            return  # a slow page said hello when its visitor had begun: their view is the newer one
        self._is_known = True
        self._state = self._showing.restore(recalled, refused)
        self._layout.arrange(self._state)

    def _touch(self) -> None:
        """Whatever a visitor does, the demo first hands over the page."""
        if self._is_public:
            self._reduce(*self._showing.touch())

    def _answer(self, letter: Shown) -> None:
        self._touch()
        before, self._state = self._state, self._showing.answer(letter, self._state)
        if self._state is before:
            return
        self._has_asked = self._is_known = True
        self._layout.arrange(self._state)
        if self._held.moment(self._state) is not None and self._state.policy is not None:
            self._reduce(ask.Settle(self._state.policy))  # what the link names is open already

    def _reduce(self, *intents: Any) -> None:
        before = self._state
        for intent in intents:
            self._state = reduce_views(self._state, intent, self._held.limits(self._state), self._views)
        if self._state.index != before.index:
            self._moved_at = time.monotonic()  # at once: nothing that can wait for rest is done for a first window
        if arrangement_of(self._state) != arrangement_of(before):
            self._layout.arrange(self._state)

    def _advance(self) -> None:
        if self._booth.is_active:
            self._state = self._held.within(self._booth.following(self._state))
        self._held.want(self._state)
        if self._is_public:
            self._lead()
        shown = self._answers.index
        if self._booth.is_active:
            self._booth.advance(self._state, shown)
        self._glance()
        self._play(shown)
        is_due = time.monotonic() - self._pushed_at >= PUSH_INTERVAL
        if self._state.index != self._shown_index:
            self._moved_at = time.monotonic()
        elif self._moved_at and not self._is_moving():
            self._moved_at, self._is_dirty = 0.0, True  # at rest: once more, in full
        if self._is_dirty and is_due:
            self._is_dirty = False
            self._pushed_at = time.monotonic()
            self._push()

    def _tidy(self) -> None:
        """What waits until nothing comes in: the catalogue is looked at, and the page kept in its browser."""
        self._tidied_at, is_moving = time.monotonic(), self._is_moving()
        if not is_moving:
            self._is_dirty |= self._known.look(self._state, self._held.share)
        goes_by_itself = self._state.is_playing or self._follows() or self._booth.is_active
        if goes_by_itself or not is_moving:
            self._keeper.keep(self._state)  # not for each window under a finger

    def _play(self, shown: int | None) -> None:
        """Go on to the window that is due."""
        due, limits = None, self._held.limits(self._state)
        if self._shows_mirror():
            due = self._booth.newest(self._state, limits)
        elif self._state.is_playing or self._has_played:  # once more at its end: the clock stops
            due = self._player.due(self._state, limits, time.monotonic(), shown)
        self._has_played = self._state.is_playing
        if due is not None:
            self._reduce(ask.PlayTo(due))
            self._is_dirty = True

    def _shows_mirror(self) -> bool:
        return self._booth.is_active and self._booth.is_live(self._state)

    def _follows(self) -> bool:
        """Whether the page goes with a source."""
        return self._state.follows_newest and self._held.limits(self._state).is_live

    def _is_moving(self) -> bool:
        return bool(self._moved_at) and time.monotonic() - self._moved_at < REST

    def _glance(self) -> None:
        if self._standing.has_refused:
            self._is_dirty |= self._standing.is_due(time.monotonic())
        every = 0.0 if self._shows_mirror() else PUSH_INTERVAL if self._follows() else GLANCE
        if time.monotonic() - self._grown_at > every:
            self._grown_at = time.monotonic()
            has_grown, follows = self._held.grow(self._state)
            self._is_dirty |= has_grown
            if follows is not None:
                self._reduce(follows)
        if self._answers.request is not None and time.monotonic() - self._glanced_at > GLANCE:
            self._glanced_at = time.monotonic()
            cached = self._engine.cached(self._answers.request)
            self._is_dirty |= cached != self._cached
            self._cached = cached

    def _push(self) -> None:
        moment, runs = self._held.moment(self._state), ()
        if moment is not None:
            if self._standing.recording_id != self._state.recording_id:
                self._standing.note(self._state)
            self._standing.page = self._state
            if self._booth.is_active:
                self._booth.present(self._state)
            is_moving = self._is_moving() or self._state.is_playing
            runs = self._asked.ask(self._state, moment, is_moving, self._follows())
        page = self._composer.page(
            self._state,
            moment,
            runs,
            self._asked.jobs.results,
            self._cached,
            self._is_moving() or self._state.is_playing or self._follows(),
            self._hovers_at,
            self._standing.refused if self._standing.has_refused else NOTHING_REFUSED,
        )
        self._layout.show(page)
        self._shown_index = self._state.index
        self._client.flush()
        self.drawn = time.monotonic(), page


def letters(mail: SimpleQueue[Item], patience: float) -> Iterator[Item]:
    """Everything in a mailbox; waits up to `patience` seconds for the first."""
    try:
        yield mail.get(timeout=patience)
        while True:
            yield mail.get_nowait()
    except Empty:
        return

"""One visitor: what they asked for, what their page shows, and the thread that turns the one into the other.

Callbacks only put things into the mailbox. The visitor's own thread takes them out, folds them into the `ViewState`,
draws what needs no model at once, and asks the engine for the rest; the newest request wins.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from queue import SimpleQueue
from typing import Any

import viser

from app.catalogue.part_id import whole_id
from app.catalogue.threads import THREADS
from app.catalogue.visitor import VisitorCatalogue
from app.catalogue.visitor_uploads import VisitorUploads
from app.engine.engine import Engine
from app.engine.failures import in_words
from app.engine.requests import Failed, FrameRequest, Ready, Reply, Working
from app.html.moment import Moment
from app.html.timeline_marks import Cached
from app.session.booth import Booth, MirrorNews
from app.session.channel import AskHelp, Copied, FollowLink, Hello, Hover, RemoveFile, Resized, Touched
from app.session.facts import KnownFacts
from app.session.frames import NewestFrames
from app.session.jobs import JobNews, VisitorJobs
from app.session.layout import arrangement_of, build_layout, watch_canvas
from app.session.loader import RecordingLoader
from app.session.messages import CanvasChanged, Closed, HandedOver, Item, Presented, letters
from app.session.opening import Opened, Opening, Unopened
from app.session.page import FOLLOW_INTERVAL, PageComposer
from app.session.player import Player
from app.session.runs import RunPlanned, RunReply, VisitorRuns
from app.session.saved_view import SavedView
from app.session.standing import Standing
from app.session.visit import Shown, Visit
from app.session.wanted import compared_runs, jobs_of, request_of
from app.state import intents as ask
from app.state.view_state import ViewState
from app.views import VIEWS
from app.views.page import Page, RunFrame
from app.views.reduce import reduce_views
from app.views.view import View
from etnet.errors import EtnetError

PUSH_INTERVAL = 1 / 30
"""Seconds between two pushes of pictures and text; the first one after a rest goes at once."""
REST = 0.3
"""Seconds without a new window after which the scene is drawn in full."""
WAIT_FOR_HELLO = 1.0
"""Seconds in which a page says which tab it is; after that it is shown the default view."""
GLANCE = 0.5
"""Seconds between two looks at what the engine has cached."""


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
    ) -> None:
        """`desk` holds the uploaded files, `booth` the visitor's camera; they are closed with the session.

        `follow_session` gives the page of an uploaded session file, by its id, and `None` for a recording.
        """
        self._follow_session = follow_session
        self._standing = Standing()
        self._client = client
        self._views = views
        self._desk = desk
        self._booth = Booth() if booth is None else booth
        self._default = default
        self._catalogue = catalogue
        self._engine = engine
        self._visitor = f"visitor-{client.client_id}"
        self._mail: SimpleQueue[Item] = SimpleQueue()
        self._state = default
        self._keeper = SavedView(client, default, [view.initial for view in views])
        self._held = RecordingLoader(catalogue, self._mail.put)
        self._player = Player()
        self._answers = NewestFrames()
        self._studying = VisitorJobs(engine, self._visitor, self._mail.put)
        self._comparing = VisitorRuns(engine, catalogue, self._visitor, self._mail.put)
        self._is_known = default.is_public  # nothing is kept of a visitor in public, so no tab is waited for
        self._has_asked = False
        self._is_closed = False
        self._is_dirty = True
        self._known = KnownFacts(catalogue, desk)
        self._composer = PageComposer(views, self._known, engine, self._answers, self._held, self._booth)
        self.drawn: tuple[float, Page] | None = None
        """When (monotonic clock) and what was drawn last, during the visit; it may be read from any thread."""
        self._shown_index = -1
        self._moved_at = 0.0
        self._pushed_at = 0.0
        self._glanced_at = self._grown_at = 0.0
        self._cached: Cached | None = None
        self._hovers_at: float | None = None
        """Seconds on the timeline that the pointer is over."""
        self._showing = Visit(client, catalogue, default, views, self._booth)
        ticket = "" if desk is None else desk.ticket
        self._layout = build_layout(client, self._speak, views, self._showing.is_public, ticket)
        self._layout.arrange(self._state)
        watch_canvas(client, self._showing.hears, lambda: self._mail.put(CanvasChanged()))
        if desk is not None:
            desk.on_change = lambda arrived: self._mail.put(HandedOver(arrived))
        self._booth.listen(self._mail.put)
        self._own_thread: int | None = None
        THREADS.start(self._run, self._visitor)

    def close(self) -> None:
        """The visitor has gone: nothing more is computed for them."""
        self._mail.put(Closed())

    def _speak(self, item: Item) -> None:
        """What a visitor does, on viser's event loop."""
        if self._showing.hears():
            self._mail.put(item)

    # ---- the visitor's own thread ----

    def _run(self) -> None:
        self._own_thread = threading.get_ident()
        try:
            self._serve()
        finally:
            self.drawn = None
            self._comparing.close()
            self._engine.drop(self._visitor)
            self._catalogue.close()
            self._booth.close()
            if self._desk is not None:
                self._desk.close()

    def _serve(self) -> None:
        began = time.monotonic()
        while not self._is_closed:
            try:
                for item in letters(self._mail, self._patience()):
                    self._take(item)
                if not self._is_known and time.monotonic() - began > WAIT_FOR_HELLO:
                    self._is_known = True
                if not self._is_closed:
                    self._advance()
            except Exception as error:  # what cannot be drawn must not end the visit
                if self._held.said_gone(self._state):
                    self._is_dirty = True  # it left a live recording while it was drawn: that is drawn next
                    continue
                self._notify("This could not be shown", in_words(error, self))
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
            case AskHelp() | Touched() | FollowLink() | Copied():
                self._answer(item)
            case Resized() | CanvasChanged() | Presented():
                pass
            case Hover(seconds):
                self._hovers_at = seconds
            case HandedOver(arrived):
                self._known.forget()
                self._open_handed(arrived)
            case MirrorNews():
                self._answer(Touched())
                self._reduce(*self._booth.heard(item, self._default.recording_id))
            case RemoveFile(recording_id):
                self._known.forget()
                self._remove(recording_id)
            case Ready() | Working() | Failed():
                self._is_dirty |= self._answers.take(item)
                return
            case JobNews():
                if self._studying.take(item):
                    self._is_dirty = True
                    self._reduce(*self._showing.hand_over(item))
                return
            case RunPlanned() | RunReply():
                self._is_dirty |= self._comparing.take(item)
                return
            case Opening() | Opened() | Unopened():
                self._known.forget()
                follows, trouble = self._held.take(item, self._state)
                if trouble:
                    self._notify("Cannot be shown", trouble)
                    before = self._standing.returned(self._state, self._held.recording_id, trouble)
                    if before is not None and not follows and self._held.moment(self._state) is None:
                        self._held.forget_refusal()
                        self._state = before
                        self._layout.arrange(self._state)
                self._reduce(*follows)
            case _:
                self._has_asked = True
                self._answer(Touched())
                if self._showing.permits(item):
                    for view in self._views:
                        view.perform(item, self._catalogue)
                    was_playing = self._state.is_playing
                    step = None if self.drawn is None else self.drawn[1].step_milliseconds
                    for first in self._player.before(item, self._state, self._held.limits(self._state), step):
                        self._reduce(first)
                    self._reduce(item)
                    self._reduce(*self._booth.goes_on(item, was_playing, self._state))
        self._is_dirty = True

    def _open_handed(self, recording_id: str) -> None:
        """A file has come, unless the id is "": a recording is opened, a session is followed."""
        if not recording_id:
            return
        self._answer(Touched())
        self._has_asked = self._is_known = True
        try:
            state = self._follow_session(recording_id)
        except EtnetError as error:
            self._notify("This session cannot be shown", str(error))
            return
        if state is None:
            self._reduce(ask.OpenRecording(recording_id))
            if self._catalogue.is_film(recording_id):
                self._reduce(ask.OpenTab("video"))
            return
        shown = self._state
        self._state = replace(state, workspace=shown.workspace, tab=shown.tab, visit=shown.visit)
        self._layout.arrange(self._state)

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
        if self._showing.is_public:
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

    def _answer(self, letter: Shown) -> None:
        """Whatever a visitor does, the demo first hands over the page."""
        for intent in self._showing.touch():
            self._reduce(intent)
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
        if arrangement_of(self._state) != arrangement_of(before):
            self._layout.arrange(self._state)

    def _advance(self) -> None:
        if not self._is_known:
            return
        self._state = self._booth.following(self._state)
        self._held.want(self._state)
        self._lead()
        shown = self._answers.index
        self._booth.advance(self._state, shown)
        self._glance()
        limits = self._held.limits(self._state)
        due = self._booth.newest(self._state, limits)
        if due is None and not self._booth.is_live(self._state):
            due = self._player.due(self._state, limits, time.monotonic(), shown)
        if due is not None:
            self._reduce(ask.PlayTo(due))
            self._is_dirty = True
        is_due = time.monotonic() - self._pushed_at >= PUSH_INTERVAL
        if self._state.index != self._shown_index:
            self._moved_at = time.monotonic()
        elif self._moved_at and not self._is_moving():
            self._moved_at, self._is_dirty = 0.0, True  # at rest: once more, in full
        if self._is_dirty and is_due:
            self._is_dirty = False
            self._pushed_at = time.monotonic()
            self._push()
        if not self._keeper.keep(self._state) and not self._is_dirty:
            self._glanced_at = min(self._glanced_at, time.monotonic() - GLANCE)

    def _follows(self) -> bool:
        """Whether the page goes with a source."""
        return self._state.follows_newest and self._held.limits(self._state).is_live

    def _is_moving(self) -> bool:
        return bool(self._moved_at) and time.monotonic() - self._moved_at < REST

    def _glance(self) -> None:
        self._is_dirty |= self._standing.is_due(time.monotonic())
        if not self._is_moving():
            self._is_dirty |= self._known.look(self._state, self._held.share)
        every = 0.0 if self._booth.is_live(self._state) else PUSH_INTERVAL if self._follows() else GLANCE
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
            self._standing.note(self._state)
            self._booth.present(self._state)
            runs = self._comparing.runs(self._state, compared_runs(self._state, self._views), moment, self._answers)
            self._ask(moment, runs)
        page = self._composer.page(
            self._state,
            moment,
            runs,
            self._studying.results,
            self._cached,
            self._is_moving() or self._state.is_playing or self._follows(),
            self._hovers_at,
            self._standing.refused,
        )
        self._layout.show(page)
        self._shown_index = self._state.index
        self._client.flush()
        self.drawn = time.monotonic(), page

    def _ask(self, moment: Moment, runs: tuple[RunFrame, ...]) -> None:
        """The frame of the moment, those of the runs, and what the open views want computed."""
        state = self._state
        request = request_of(state, moment.policy, self._views)
        if self._answers.ask(request):
            self._engine.request(self._visitor, request, self._hear)
        self._comparing.ask(runs)
        jobs = jobs_of(state, request, moment, runs, self._views, self._num_seen)
        if self._follows():
            self._studying.follow(jobs, state.index)
        else:
            (self._studying.keep if self._is_moving() or state.is_playing else self._studying.want)(jobs)

    def _hear(self, reply: Reply) -> None:
        """A frame that is at hand comes back while it is asked for: it is drawn with this push, not with the next."""
        if threading.get_ident() == self._own_thread:
            self._answers.take(reply)
        else:
            self._mail.put(reply)

    def _num_seen(self, request: FrameRequest) -> int:
        cached = self._engine.cached(request)
        return 0 if cached is None else sum(len(part) for part in cached.frames)

    def _notify(self, title: str, body: str) -> None:
        self._client.add_notification(title, body, color="red", auto_close_seconds=12.0)

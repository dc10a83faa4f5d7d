"""What a visit does to be shown to others: the show in public, moments that addresses name, help."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import viser

from app.catalogue.entries import under_its_name
from app.catalogue.live import is_live_id
from app.catalogue.recording_id import listed_id
from app.catalogue.recordings import CatalogueError
from app.catalogue.visitor import VisitorCatalogue
from app.engine.downloads import Download, Downloaded
from app.engine.network_parts import NetworkParts
from app.session.booth import Booth
from app.session.channel import AskHelp, Copied, FollowLink
from app.session.demo import DemoScript, Throttle, intents_of, may_ask, public_moment
from app.session.jobs import JobNews
from app.session.layout import close_modal, show_help
from app.state import intents as ask
from app.state.link import LinkError, from_link
from app.state.view_state import Limits, ViewState
from app.views.demo.state import PointAt
from app.views.view import View, reduce_views
from etnet.errors import EtnetError
from etnet.files import in_megabytes

if TYPE_CHECKING:
    from viser._gui_handles import GuiModalHandle

Shown = AskHelp | FollowLink | Copied
"""Messages that are answered here."""


class Visit:
    """Used by the visitor's thread, but for `hears`."""

    def __init__(
        self,
        client: viser.ClientHandle,
        catalogue: VisitorCatalogue,
        default: ViewState,
        views: Sequence[View],
        booth: Booth,
        follow_session: Callable[[str], ViewState | None],
    ) -> None:
        self._follow_session = follow_session
        self._booth = booth
        self._client = client
        self._catalogue = catalogue
        self._default = default
        self._views = views
        is_public = default.is_public
        entries = catalogue.entries()
        live = next((entry.id for entry in entries if entry.kind == "live"), "")
        self._attract = DemoScript([entry.id for entry in entries], live) if is_public else None
        self._throttle = Throttle(time.monotonic())
        self._help: GuiModalHandle | None = None

    def hears(self) -> bool:
        """Whether one more message of the visitor is taken. In public nobody may do more than a hand can."""
        return self._attract is None or self._throttle.takes(time.monotonic())

    def permits(self, intent: Any) -> bool:
        """Whether a visitor may ask for this here."""
        return self._booth.offers(intent) and (self._attract is None or may_ask(intent, self._views))

    def touch(self) -> tuple[Any, ...]:
        """What follows from the visitor's doing anything: with the first touch they have control."""
        if self._attract is not None and self._attract.touch(time.monotonic()):
            return (PointAt("none"),)
        return ()

    def lead(self, state: ViewState, is_up: bool) -> tuple[ViewState, tuple[Any, ...]] | None:
        """The next stretch of the show, when it is due: the view it begins from, and what it asks (see `DemoScript`).

        A new recording is shown as to somebody who has just come.
        """
        if self._attract is not None and (self._booth.is_live(state) or self._booth.waits(state)):
            self._attract.touch(time.monotonic())
        beat = None if self._attract is None else self._attract.due(is_up, time.monotonic())
        if beat is None:
            return None
        if beat.recording_id is not None:
            close_modal(self._help)
            state = replace(self._default, recording_id=beat.recording_id, visit=state.visit + 1)
        return state, intents_of(beat, state)

    def restore(self, recalled: ViewState, refused: tuple[str, ...]) -> ViewState:
        """A view that a browser kept, brought to what this catalogue holds; what was left out is said."""
        known = [entry.id for entry in self._catalogue.entries()]
        models = [entry.id for entry in self._catalogue.models()]
        if listed_id(recalled.recording_id) not in known:
            recalled = self._reduced(recalled, ask.OpenRecording(next(iter(known), "")))
            refused = (*refused, "the recording")
        if recalled.model_id not in models:
            recalled = self._reduced(recalled, ask.ChooseModel(models[0]))
        if refused:
            self.refuse("Not all of your last view could be restored", f"Left out: {', '.join(refused)}.")
        return self._reduced(recalled, ask.FormChanged())  # each view's reducer sees what was kept

    def _reduced(self, state: ViewState, intent: Any) -> ViewState:
        return reduce_views(state, intent, Limits(), self._views)

    def handed(self, recording_id: str, state: ViewState) -> tuple[ViewState, tuple[Any, ...]]:
        """A file has come: a session is followed, a recording opened. The view that follows, and what it asks."""
        try:
            page = self._follow_session(recording_id)
        except EtnetError as error:
            self.refuse("This session cannot be shown", self._in_names(error, recording_id))
            return state, ()
        if page is not None:
            page = replace(page, workspace=state.workspace, tab=state.tab, visit=state.visit)
            return page, (ask.FormChanged(),)  # what was kept may not fit together: each view's reducer sees it
        told = (view.name for view in self._views if view.opens_for(self._catalogue, recording_id))
        return state, (*self._booth.opened(recording_id, state), *map(ask.OpenTab, told))

    def _in_names(self, error: EtnetError, recording_id: str) -> str:
        """What went wrong with a file, without a folder, and by the name that its visitor gave it."""
        try:
            return str(under_its_name(error, self._catalogue.entry(recording_id)))
        except CatalogueError as gone:
            return str(gone)

    def hand_over(self, news: JobNews) -> tuple[Any, ...]:
        """Let the browser save a file that is made; what follows."""
        if (kept := self._booth.kept(news)) is not None:
            return kept
        made = news.result.value
        if isinstance(made, NetworkParts):
            return (ask.NetworkKnown(made.anatomy.sites, made.anatomy.num_heads),)
        if not isinstance(made, Download):
            return ()
        self._client.send_file_download(made.name, made.content, save_immediately=True)
        self._client.add_notification(
            "Export", f"{made.name}, {in_megabytes(len(made.content))}: the browser saves it.", auto_close_seconds=6.0
        )
        return (Downloaded(news.slot),)

    def answer(self, letter: Shown, state: ViewState) -> ViewState:
        """Do what a letter asks; the view after it."""
        match letter:
            case AskHelp():
                close_modal(self._help)
                self._help = show_help(self._client)
            case Copied(is_done):
                title = "Link copied" if is_done else "The link could not be copied"
                body = "The link opens this moment." if is_done else "This browser keeps pages from its clipboard."
                self._client.add_notification(title, body, auto_close_seconds=4.0)
            case FollowLink(value):
                return self._follow(value, state)
        return state

    def _follow(self, value: str, state: ViewState) -> ViewState:
        """The moment that an address names; what cannot be shown here is said, and the rest is."""
        try:
            linked, refused = from_link(value, state, [view.initial for view in self._views])
        except LinkError as error:
            self.refuse("The moment in this address cannot be shown", str(error))
            return state
        try:
            self._catalogue.entry(linked.recording_id)
        except CatalogueError:
            why = "Its recording is not among those that can be opened here."
            if is_live_id(linked.recording_id):
                why = "It was seen live, by a viewer that has ended. What was recorded of it can be opened as a file."
            self.refuse("The moment in this address cannot be shown", why)
            return state
        if linked.model_id not in {entry.id for entry in self._catalogue.models()}:
            linked, refused = replace(linked, model_id=state.model_id), (*refused, "the network")
        if self._attract is not None:
            linked = public_moment(linked, state)
        if refused:
            self.refuse("Not all of this moment could be shown", f"Left out: {', '.join(refused)}.")
        return linked

    def refuse(self, title: str, body: str) -> None:
        """Say that something cannot be shown, and why."""
        self._client.add_notification(title, body, color="red", auto_close_seconds=12.0)

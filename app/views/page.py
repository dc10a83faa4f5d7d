"""Everything that one visitor's page is drawn from, as one value."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from app.catalogue.videos import VideoShown
from app.catalogue.visitor_uploads import UploadsShown
from app.engine.jobs import JobResult
from app.engine.requests import Failed, Ready, Working
from app.html.moment import Moment
from app.html.provenance import ModelFacts
from app.html.tones import Tones
from app.state.view_state import ViewState
from app.views.lane_shown import LaneShown
from app.views.timeline.html import Cached


@dataclass(frozen=True, slots=True)
class Choice:
    """One entry of a list that a visitor chooses from: its id in the catalogue, and what he reads."""

    id: str
    title: str
    subtitle: str = ""


@dataclass(frozen=True, slots=True)
class Page:
    """Everything that one visitor's page is drawn from. `ready` may belong to another window than the one on show."""

    state: ViewState
    moment: Moment | None = None
    ready: Ready | None = None
    working: Working | None = None
    failed: Failed | None = None
    cached: Cached | None = None
    tones: Tones = field(default_factory=Tones)
    look: AttentionLook | None = None
    """`None` before a pixel was chosen."""
    model: ModelFacts = field(default_factory=lambda: ModelFacts("no network"))
    step_milliseconds: float | None = None
    is_moving: bool = False
    """A finger drags or the recording plays: what is drawn now is soon replaced."""
    recordings: tuple[Choice, ...] = ()
    models: tuple[Choice, ...] = ()
    trouble: str = ""
    """Why there is no moment, in plain words."""
    growing: tuple[str, ...] = ()
    """Names of recordings that are being written, and will be offered."""
    results: Mapping[str, JobResult] = field(default_factory=dict)
    """What is known of the jobs that this view wants, by slot."""
    lanes: tuple[LaneShown, ...] = ()
    """What is compared at this moment, the main lane first; empty while nothing is."""
    link: str = ""
    """The moment on show as a value for an address; empty while it moves."""
    desk: UploadsShown | None = None
    """The files that this visitor handed over; `None` where nothing is taken."""
    film: VideoShown | None = None
    """How far the video on show is simulated; `None` for what is no video."""
    run: Run | None = None
    """How the command line is told of what is on show; `None` for what it cannot open."""
    can_be_stated: bool = False
    """Whether the visitor may say of this recording what its file does not."""

    @property
    def missed(self) -> int | None:
        """The window whose image the one on show lags behind; `None` where each is waited for: it plays one behind."""
        return None if self.state.is_playing and self.state.waits_for_frames else self.state.index

    @property
    def lags(self) -> bool:
        """Whether the image on show belongs to another window than the one that is missed."""
        return self.ready is not None and self.missed not in (None, self.ready.request.index)

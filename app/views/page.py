"""Everything that one visitor's page is drawn from, as one value."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

from app.catalogue.live import LiveShown
from app.catalogue.videos import VideoShown
from app.catalogue.visitor_uploads import UploadsShown
from app.engine.jobs import JobResult
from app.engine.requests import Failed, FrameRequest, Ready, Working
from app.html.moment import Moment
from app.html.pictures import EventCloud
from app.html.provenance import ModelFacts
from app.html.timeline_marks import Cached, Hovered
from app.state.run import Run
from app.state.view_state import ViewState
from etnet.windows import Window


@dataclass(frozen=True, slots=True)
class Choice:
    """One entry of a list that a visitor chooses from: its id in the catalogue, and what they read."""

    id: str
    title: str
    subtitle: str = ""
    facts: str = ""
    """What it is, as far as that is known: sensor, duration, format."""
    is_film: bool = False
    """Whether it is a video, of which an event sensor's view is simulated."""
    source: str = ""
    """Of a network: what the command line calls it."""


@dataclass(frozen=True, slots=True, eq=False)
class RunFrame:
    """What has come of a run. `request` is `None` until its windows are planned; `window` is the nearest in time."""

    number: int
    """0 is the main run."""
    run: Run
    request: FrameRequest | None
    window: Window | None
    num_windows: int
    model: ModelFacts
    warm_up: int
    ready: Ready | None = None
    working: Working | None = None
    failed: Failed | None = None
    trouble: str = ""


@dataclass(frozen=True, slots=True)
class MirrorShown:
    """The visitor's own camera: what their page needs to begin with it, and how it goes."""

    ticket: str
    is_live: bool = False
    delay: float | None = None
    """Seconds between a picture's arrival and the moment in which what was made of it is drawn."""
    trouble: str = ""


@dataclass(frozen=True, slots=True)
class Page:
    """One visitor's page at one moment. `ready` may belong to another window than the current one."""

    state: ViewState
    moment: Moment | None = None
    ready: Ready | None = None
    working: Working | None = None
    failed: Failed | None = None
    cached: Cached | None = None
    model: ModelFacts = field(default_factory=lambda: ModelFacts("no network"))
    step_milliseconds: float | None = None
    hovered: Hovered | None = None
    """Where on the timeline the pointer is."""
    is_moving: bool = False
    """A finger drags or the recording plays: what is drawn now is soon replaced."""
    recordings: tuple[Choice, ...] = ()
    models: tuple[Choice, ...] = ()
    trouble: str = ""
    """Why there is no moment, in plain words."""
    growing: tuple[str, ...] = ()
    """Names of recordings that are being written, and will be offered."""
    results: Mapping[str, JobResult] = field(default_factory=dict)
    """What is known of the jobs that the open views want, by slot."""
    runs: tuple[RunFrame, ...] = ()
    """What is compared at this moment, the main run first; empty while nothing is."""
    link: str = ""
    """The current moment as a value for an address; empty while it moves."""
    uploads: UploadsShown | None = None
    """The files that this visitor uploaded; `None` where nothing is taken."""
    video: VideoShown | None = None
    """How far the current video is simulated; `None` for what is no video."""
    file_name: str = ""
    """What the command line is told of the recording; empty for what it cannot open."""
    stated_id: str = ""
    """The recording of which the visitor may say what its file does not: this one, or the one that was refused."""
    refused: str = ""
    """Why another recording, asked for a moment ago, was not opened."""
    can_be_binned: bool = False
    """Whether the visitor may choose how its pixels are binned."""
    areas: Mapping[str, str] = field(default_factory=dict)
    """Where each card stands: "a" and "b" on the stage, "s1" … on the shelf."""
    draws_scene: bool = True
    """Whether this picture of a drag is one of those that reach the 3-D scene: a browser that is sent its textures
    as often as HTML shows less of both."""
    cloud: Callable[[int], EventCloud] | None = None
    """The events of the scene in the colours of an open view."""
    placed: Moment | None = None
    """The moment on the timeline, also where `moment` is gone."""
    live: LiveShown | None = None
    """The server's live source; `None` where there is none."""
    is_live: bool = False
    """Whether the current recording is the live one."""
    follows: bool = False
    """Whether the newest window is shown, whichever that is."""
    gone: str = ""
    """That the current window's events have left the buffer of the live recording."""
    mirror: MirrorShown | None = None
    """The visitor's own camera; `None` where none is taken."""
    presenting: str = ""
    """That this page leads others, or follows one, in words."""
    gives_home: bool = False
    """Whether a visitor can take a page home."""
    public_url: str = ""
    """The address by which others reach this server; empty where only this machine does."""
    over_timeline: str = ""
    """SVG that open views draw over the timeline."""

    def is_about(self, request: FrameRequest) -> bool:
        """Whether an answer is about the recording, network, windows and filter that are open, at whichever window."""
        moment, state = self.moment, self.state
        if moment is None:
            return False
        opened = moment.recording_id, state.model_id, state.precision, moment.policy, moment.cleaning
        return request.playback[: len(opened)] == opened

    @property
    def missed(self) -> int | None:
        """The window whose image the current one lags behind; `None` where each is waited for: it plays one behind."""
        is_one_behind = self.follows or (self.state.is_playing and self.state.waits_for_frames)
        return None if is_one_behind else self.state.index

    @property
    def lags(self) -> bool:
        """Whether the image belongs to another window than the one that is missed."""
        ready = self.ready
        return ready is not None and (ready.is_former or self.missed not in (None, ready.request.index))

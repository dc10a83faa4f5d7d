"""All that one visitor's page depends on, as a value, and the one pure function that changes it."""

from __future__ import annotations

import bisect
import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import TypeVar, get_args

from app.state import intents as ask
from app.views.compare.state import CompareIntent, CompareState, reduce_compare
from app.views.demo.state import DemoIntent, DemoState, Order, StartExport, reduce_demo
from app.views.inspect.state import SITE_PATTERN, InspectIntent, InspectState, reduce_inspect
from app.views.recording.state import Excerpt, RecordingIntent, RecordingState, TrimOrder, reduce_recording
from etnet.events.events import Sensor
from etnet.windows import Policy, Window

SPEEDS = (1.0, 0.5, 0.25, 0.1, 0.05, 0.02)
"""Recording seconds per second that the transport offers."""
NUM_HEADS_CAP = 64
WARM_WINDOW = 20
"""Where a recording that was never looked at is opened: the network has seen enough there to draw well."""
Word = TypeVar("Word", bound=str)


@dataclass(frozen=True, slots=True)
class Limits:
    """What the open recording allows. Before it is open nothing is known, and an index is left as it is."""

    sensor: Sensor | None = None
    windows: Sequence[Window] | None = None
    start: int = 0
    """Stamp of the recording's first event, µs: second 0 of the timeline."""
    is_growing: bool = False
    """More windows will come after the last one."""

    def clamp_index(self, index: int) -> int:
        """The nearest window that exists."""
        if self.windows is None:
            return max(index, 0)
        return min(max(index, 0), max(len(self.windows) - 1, 0))

    def index_at(self, t: int) -> int:
        """The window whose frame stamp (`t_stop`) is nearest to `t` µs; the earlier of two equally near."""
        if not self.windows:
            return 0
        after = bisect.bisect_left(self.windows, t, key=lambda window: window.t_stop)
        if after == 0 or after == len(self.windows):
            return self.clamp_index(after)
        earlier, later = self.windows[after - 1].t_stop, self.windows[after].t_stop
        return after if later - t < t - earlier else after - 1


@dataclass(frozen=True, slots=True)
class ViewState:
    """One visitor's view. Equal states show equal pages."""

    recording_id: str = ""
    model_id: str = ""
    precision: ask.Precision = "auto"
    policy: Policy | None = None
    """`None` until the recording is open, which then says what suits it."""
    index: int = 0
    moment: int | None = None
    """Stamp (µs) to return to once the windows are planned anew."""
    is_playing: bool = False
    speed: float = 0.1
    waits_for_frames: bool = False
    loops: bool = True
    workspace: ask.Workspace = "inspect"
    query: tuple[int, int] | None = None
    """Pixel (x, y) of the sensor whose attention is shown."""
    site: str = "scale1.encoder.0.self"
    head: int | None = None
    """`None` is the mean of all heads."""
    opens_heads: bool = False
    event_image: ask.EventImage = "polarity"
    tone: ask.Tone = "auto"
    overlay: float = 0.8
    map_range: ask.MapRange = "shared"
    camera: ask.Camera = "orbit"
    shows_events: bool = True
    voxel_bin: int | None = None
    inside: InspectState = field(default_factory=InspectState)
    compare: CompareState = field(default_factory=CompareState)
    show: DemoState = field(default_factory=DemoState)
    source: RecordingState = field(default_factory=RecordingState)


def reduce(state: ViewState, intent: ask.Intent, limits: Limits) -> ViewState:
    """The state after `intent`, every value inside `limits`. Nothing else may change a view."""
    if isinstance(intent, InspectIntent):
        return replace(state, inside=reduce_inspect(state.inside, intent, state.index))
    if isinstance(intent, CompareIntent):
        now = limits.windows[limits.clamp_index(state.index)].t_start if limits.windows else None
        return replace(state, compare=reduce_compare(state.compare, intent, now))
    if isinstance(intent, DemoIntent):
        is_playing = state.is_playing and not isinstance(intent, StartExport)  # both would want the network
        return replace(
            state, is_playing=is_playing, show=reduce_demo(state.show, intent, lambda wanted: _order(state, wanted))
        )
    if isinstance(intent, RecordingIntent):
        window = limits.windows[limits.clamp_index(state.index)] if limits.windows else None
        order = lambda excerpt: _cut_order(state, excerpt)  # noqa: E731
        return replace(state, source=reduce_recording(state.source, intent, state.recording_id, window, order))
    return (
        _reduce_playback(state, intent, limits)
        or _reduce_source(state, intent, limits)
        or _reduce_look(state, intent, limits)
    )


def _order(state: ViewState, wanted: StartExport) -> Order | None:
    if state.policy is None:
        return None
    view = None
    if wanted.parcel == "png" and wanted.sheet != "panels":
        view = replace(state, show=DemoState(), is_playing=False)
    of = state.recording_id, state.model_id, state.precision, state.policy, state.index
    return Order(wanted, *of, state.query, state.inside.change, view)


def _cut_order(state: ViewState, excerpt: Excerpt) -> TrimOrder | None:
    return None if state.policy is None else TrimOrder(excerpt, state.model_id, state.precision, state.policy)


def _reduce_playback(state: ViewState, intent: ask.Intent, limits: Limits) -> ViewState | None:
    match intent:
        case ask.Seek(index):
            return replace(state, index=limits.clamp_index(index), is_playing=False)
        case ask.Move(num_windows):
            return replace(state, index=limits.clamp_index(state.index + num_windows), is_playing=False)
        case ask.SeekTime(seconds):
            t = limits.start + round(min(max(_finite(seconds), 0.0), 1e9) * 1e6)
            return replace(state, index=limits.index_at(t), is_playing=False)
        case ask.TogglePlay():
            is_at_end = limits.windows is not None and state.index >= len(limits.windows) - 1
            restarts = not state.is_playing and is_at_end and not limits.is_growing
            return replace(state, index=0 if restarts else state.index, is_playing=not state.is_playing)
        case ask.PlayTo(index):
            if not state.is_playing:
                return state
            if limits.windows is not None and index >= len(limits.windows) and not limits.is_growing:
                return (
                    replace(state, index=0)
                    if state.loops
                    else replace(state, index=limits.clamp_index(index), is_playing=False)
                )
            return replace(state, index=limits.clamp_index(index))
        case ask.ChooseSpeed(speed, waits_for_frames):
            return replace(state, speed=_clamped(speed, 1e-4, 16.0), waits_for_frames=waits_for_frames)
        case ask.SetLoop(loops):
            return replace(state, loops=loops)
    return None


def _reduce_source(state: ViewState, intent: ask.Intent, limits: Limits) -> ViewState | None:
    match intent:
        case ask.OpenRecording(recording_id):
            if recording_id == state.recording_id:
                return state
            fresh = {"inside": state.inside.anew(), "compare": state.compare.anew()}
            opened = replace(state, recording_id=recording_id, policy=None, **fresh)
            return replace(opened, index=0, moment=None, query=None, is_playing=False)
        case ask.ReopenRecording(recording_id):
            shown = limits.windows[limits.clamp_index(state.index)] if limits.windows else None
            moment = shown.t_stop if shown else state.moment
            anew = replace(state, recording_id=recording_id, moment=moment, is_playing=False)
            return replace(anew, inside=state.inside.anew(), compare=state.compare.anew())
        case ask.ChooseModel(model_id):
            return replace(state, model_id=model_id, inside=state.inside.anew())
        case ask.ChoosePrecision(precision):
            return replace(state, precision=_known(precision, ask.Precision, state.precision))
        case ask.ChoosePolicy(policy):
            if policy == state.policy:
                return state
            shown = limits.windows[limits.clamp_index(state.index)] if limits.windows else None
            moment = shown.t_stop if shown else state.moment
            return replace(state, policy=policy, moment=moment, is_playing=False, inside=state.inside.anew())
        case ask.RenameRecording(recording_id):
            excerpt = state.source.excerpt
            if excerpt.recording_id == state.recording_id:
                excerpt = replace(excerpt, recording_id=recording_id)  # a part's events have the whole's numbers
            return replace(state, recording_id=recording_id, source=replace(state.source, excerpt=excerpt))
        case ask.Settle(policy):
            index = state.index if state.moment is None else limits.index_at(state.moment)
            if state.policy is None and index == 0:
                index = min(WARM_WINDOW, len(limits.windows or ()) // 2)
            settled = replace(state, policy=policy, index=limits.clamp_index(index), moment=None)
            return settled if state.query is None else reduce(settled, ask.Query(*state.query), limits)
    return None


def _reduce_look(state: ViewState, intent: ask.Intent, limits: Limits) -> ViewState:
    match intent:
        case ask.Query(x, y):
            width, height = (limits.sensor.width, limits.sensor.height) if limits.sensor else (65_536, 65_536)
            # In public the picture waits for who touches it; elsewhere playing goes on under the maps.
            goes_on = state.is_playing and not state.show.is_demo
            return replace(state, query=(min(max(x, 0), width - 1), min(max(y, 0), height - 1)), is_playing=goes_on)
        case ask.QueryFraction(x, y):
            if limits.sensor is None:
                return state
            pixel = ask.Query(int(_unit(x) * limits.sensor.width), int(_unit(y) * limits.sensor.height))
            return reduce(state, pixel, limits)
        case ask.ShowWorkspace(workspace):
            # The attention workspace is a flat view of one map; the others look into the window's depth.
            return replace(state, workspace=workspace, camera="front" if workspace == "attention" else "orbit")
        case ask.OpenSite(site):
            return replace(state, site=site, opens_heads=True) if SITE_PATTERN.fullmatch(site) else state
        case ask.CloseSite():
            return replace(state, opens_heads=False)
        case ask.ChooseHead(head):
            return replace(state, head=None if head is None else min(max(head, 0), NUM_HEADS_CAP - 1))
        case ask.ChooseEventImage(event_image):
            return replace(state, event_image=_known(event_image, ask.EventImage, state.event_image))
        case ask.ChooseTone(tone):
            return replace(state, tone=_known(tone, ask.Tone, state.tone))
        case ask.SetOverlay(opacity):
            return replace(state, overlay=_unit(opacity))
        case ask.ChooseMapRange(map_range):
            return replace(state, map_range=_known(map_range, ask.MapRange, state.map_range))
        case ask.ChooseCamera(camera):
            return replace(state, camera=_known(camera, ask.Camera, state.camera))
        case ask.ShowEvents(is_shown):
            return replace(state, shows_events=is_shown)
        case ask.OpenBin(voxel_bin):
            return replace(state, voxel_bin=None if voxel_bin is None else min(max(voxel_bin, 0), 31))
    return state


def choices(alias: object) -> tuple[str, ...]:
    """The words of a `Literal`, in order: what a dropdown offers and what a stored state may hold."""
    return get_args(alias)


def _known(word: Word, alias: object, present: Word) -> Word:
    """A page may send any word; one that is not offered changes nothing."""
    return word if word in choices(alias) else present


def _finite(value: float) -> float:
    return value if math.isfinite(value) else 0.0


def _clamped(value: float, low: float, high: float) -> float:
    return min(max(_finite(value), low), high)


def _unit(value: float) -> float:
    return _clamped(value, 0.0, 1.0)

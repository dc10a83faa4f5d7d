"""The live source of a server: one recording that grows, its windows, and the files that are recorded of it."""

from __future__ import annotations

import secrets
import time
from collections import OrderedDict
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from threading import Event, Lock

from app.catalogue.cut import CutRecording, FirstKept, with_cut
from app.catalogue.threads import InOrder
from etnet.errors import EtnetError, RecordingError, WindowError
from etnet.events.events import Sensor
from etnet.events.open import open_recording
from etnet.events.opened_as import View
from etnet.events.recording import Recording, Remark
from etnet.live.binning import Binned, Downsample, fitting_downsample
from etnet.live.buffer import Keep
from etnet.live.log import windows_as_cut
from etnet.live.rate import Band, RateFollower, can_follow, follower_of
from etnet.live.record import Recorder
from etnet.live.recording import LiveRecording
from etnet.live.source import LiveSource, Setting
from etnet.live.windows import LiveWindows
from etnet.windows import Policy

WAIT = 1.0
"""Seconds that opening waits for the first window before it says that there is none yet."""
DELAYS = 2_000
"""Frames of which it is remembered how late they were."""
NEWS = 10.0
"""Seconds for which a fault is said beside the timeline."""


_LIVE = "live-"


def is_live_id(recording_id: str) -> bool:
    """Whether an id is that of a live source, of this server or of one that has ended."""
    return recording_id.startswith(_LIVE)


class WaitingForEvents(RecordingError):
    """Nothing came yet; it is asked again by and by."""


@dataclass(frozen=True, slots=True)
class Recorded:
    """A file that is recorded, or was. `num_events` are in it by now, `num_missing` came and are not."""

    id: str
    path: Path
    num_events: int
    num_missing: int
    is_over: bool


@dataclass(frozen=True, slots=True)
class LiveShown:
    """What a page says of the live source. Times are seconds since its first event."""

    id: str
    name: str
    format: str
    sensor: Sensor
    seen: Sensor
    downsample: int
    windowing: str
    """Why windows are as they are, in plain words."""
    seconds: float
    gone_before: float
    """What came before has left the buffer; 0 while everything is there."""
    keep_seconds: float
    num_events: int
    num_lost: int
    """Packets."""
    num_held_up: int
    num_merged: int
    num_unseen: int
    notes: tuple[tuple[float, str], ...]
    """The last faults and their ends."""
    news: str
    """The last of them, if it is new."""
    recording: Recorded | None
    """The file that is being written."""
    recorded: tuple[Recorded, ...]
    """The files that are finished."""
    settings: tuple[Setting, ...]
    is_over: bool
    driver_delay: float | None = None
    """Seconds that the last packet lay in the camera's driver; `None` where the source has none."""
    driver_backlog: int = 0
    """Packets that lay there still."""
    can_follow: bool = False
    """Whether the source's biases can follow the event rate."""
    followed: tuple[float, float] | None = None
    """Mev/s between which they keep it; `None` where they stay as they are."""
    behind: float | None = None
    """Seconds from the arrival of the last event of the image's window to the image."""
    may_change: bool = False
    """Whether this visitor may record and change settings."""


class LiveFeed:
    """One source for all visitors. Safe from every thread; `windows` are cut by the engine's alone."""

    def __init__(
        self,
        source: LiveSource,
        keep: Keep | None = None,
        downsample: Downsample | None = None,
        record: Path | None = None,
        follower: RateFollower | None = None,
    ) -> None:
        """`record`: a file that everything is written to from the first event on. `follower` keeps the event rate."""
        self.id = f"{_LIVE}{secrets.token_hex(4)}"
        self.live = LiveRecording(source, keep, follower)
        self.downsample: Downsample = downsample or fitting_downsample(source.sensor)
        self.seen = Sensor(*(-(-side // self.downsample) for side in (source.sensor.width, source.sensor.height)))
        self.windows: LiveWindows | None = None
        self._binned = Binned(self.live.recording(), self.downsample) if self.downsample > 1 else None
        self._windowing = "measuring how long a step takes"
        self._lock = Lock()
        self._asked = InOrder("live")
        self._changed = Event()
        self._newest: CutRecording | None = None
        self._delays: OrderedDict[int, float | None] = OrderedDict()
        self._folder = Path() if record is None else record.parent
        self._files: dict[str, tuple[Path, Recorded]] = {}
        self._recorder: tuple[str, Recorder] | None = None
        if record is not None:
            self._recorder = (self._new_id(), Recorder(self.live, record, first=0))

    def start(self) -> LiveFeed:
        """Begin to take events in."""
        self.live.start()
        return self

    def close(self) -> None:
        """End the source, and the file that is being written."""
        self.stop_recording()
        self.live.stop()

    # ---- the engine's side ----

    def cut_by(self, policy: Policy, said: str) -> LiveWindows:
        """From now on windows are cut under this policy, for the reason `said`."""
        with self._lock:
            windows = LiveWindows(self.live, policy, self.seen)
            windows.begin_now()  # what came while the network was loaded would be one window of seconds
            self.windows, self._windowing = windows, said
            if self._recorder is not None:
                self._recorder[1].follow(self.windows.kept, repr(policy), self.downsample)
            return self.windows

    def finished(self, index: int) -> None:
        """The image of a window is there: note how late it is, and wake who waits for the first."""
        assert self.windows is not None
        with self._lock:
            self._delays[index] = self.live.behind(self.windows.kept[index].t_stop)
            while len(self._delays) > DELAYS:
                self._delays.popitem(last=False)
        self._changed.set()

    # ---- what there is ----

    def recording(self) -> CutRecording:
        """What there is by now, with the windows that were cut of it."""
        windows = self.windows
        num_windows = 0 if windows is None else len(windows.kept)  # before the events: they hold all of these
        seen = self.live.recording() if self._binned is None else self._binned.latest()
        with self._lock:
            held = self._newest
            if held is not None and held.source is seen.source and len(held.cut) == num_windows:
                return held
            if self.downsample > 1:
                joined = f"{self.live.sensor}, binned {self.downsample}×{self.downsample} to {self.seen}"
                seen = replace(seen, remarks=(*seen.remarks, Remark("assumed", f"{joined} for the network")))
            policy = None if windows is None else windows.policy
            cut = () if windows is None else FirstKept(windows.kept, num_windows)
            self._newest = with_cut(seen, policy, cut, self.live.extent, self.recording)
            return self._newest

    def open(self) -> CutRecording:
        """The same, once a window was cut. Raises WaitingForEvents where none was within a second."""
        until = time.monotonic() + WAIT
        while not (found := self.recording()).cut:
            if time.monotonic() >= until:
                raise WaitingForEvents(self._waits_for())
            self._changed.wait(0.05)
        return found

    def shown(self, index: int | None, may_change: bool) -> LiveShown:
        """For a page whose image belongs to window `index`."""
        live, windows = self.live, self.windows
        extent, start = live.extent(), live.extent().first_stamp or 0
        notes = tuple(((note.stamp - start) / 1e6, note.text) for note in live.notes[-20:] if note.setting is None)
        seconds = ((extent.until or start) - start) / 1e6
        is_new = bool(notes) and (live.is_over or notes[-1][0] > seconds - NEWS)
        with self._lock:
            behind = None if index is None else self._delays.get(index)
            recording = None if self._recorder is None else self._written(*self._recorder, is_over=False)
            recorded = tuple(entry for _, entry in self._files.values())
        return LiveShown(
            id=self.id,
            name=live.source.name,
            format=live.source.format,
            sensor=live.sensor,
            seen=self.seen,
            downsample=self.downsample,
            windowing=self._windowing,
            seconds=seconds,
            gone_before=0.0 if extent.gone_before is None else (extent.gone_before - start) / 1e6,
            keep_seconds=live.keep.seconds,
            num_events=extent.num_events,
            num_lost=live.loss.packets,
            num_held_up=live.loss.held_up,
            num_merged=0 if windows is None else windows.num_merged,
            num_unseen=0 if windows is None else windows.num_unseen,
            notes=notes,
            news=notes[-1][1] if is_new else "",
            recording=recording,
            recorded=recorded,
            settings=live.source.settings(),
            is_over=live.is_over,
            can_follow=can_follow(live.source),
            followed=None if (follower := live.follower) is None else _in_millions(follower.band),
            driver_delay=live.waiting.delay,
            driver_backlog=live.waiting.backlog,
            behind=behind,
            may_change=may_change,
        )

    # ---- what the host may do ----

    def record(self) -> None:
        """Begin a file, named by the time, from the next event on."""
        with self._lock:
            if self._recorder is not None:
                return
            path = self._folder / time.strftime("live-%Y%m%d-%H%M%S.aedat4")
            try:
                recorder = Recorder(self.live, path)
            except EtnetError as error:
                self.live.note(str(error))
                return
            if self.windows is not None:
                recorder.follow(self.windows.kept, repr(self.windows.policy), self.downsample)
            self._recorder = self._new_id(), recorder

    def stop_recording(self) -> None:
        """Finish the file, which can be opened then."""
        with self._lock:
            held, self._recorder = self._recorder, None
        if held is None:
            return
        try:
            held[1].stop()
        except EtnetError:
            return  # the live recording was told
        with self._lock:
            self._files[held[0]] = held[1].path, self._written(*held, is_over=True)

    def begin(self, work: Callable[[], None]) -> None:
        """Do one of these beside the caller, in the order in which they are asked: a disk may be slow."""
        if not self._asked.start(work):
            self.live.note("too much waits to be changed; try again")

    def change(self, name: str, value: int) -> None:
        """Change a setting of the source; one that cannot be changed is noted."""
        try:
            self.live.source.change(name, value)
        except EtnetError as error:
            self.live.note(str(error))

    def follow_rate(self, rate: tuple[float, float] | None) -> None:
        """Let the biases follow, so that the rate (Mev/s) stays between these two; `None` ends that."""
        try:
            self.live.follow_rate(follower_of(self.live.source, rate))
        except EtnetError as error:
            self.live.note(str(error))

    def files(self) -> tuple[Recorded, ...]:
        """What was recorded and is finished."""
        with self._lock:
            return tuple(entry for _, entry in self._files.values())

    def reopened(self, recorded_id: str) -> Recording:
        """A finished file with the windows as they were cut live, if the network ran meanwhile."""
        with self._lock:
            found = self._files.get(recorded_id)
        if found is None:
            raise RecordingError("this file was not recorded here; open it by its name")
        recording = open_recording(found[0], view=View(downsample=self.downsample))
        try:
            cut = windows_as_cut(recording)
        except WindowError:
            return recording
        policy = None if self.windows is None else self.windows.policy
        return with_cut(recording, policy, cut.windows)

    def _written(self, file_id: str, recorder: Recorder, is_over: bool) -> Recorded:
        return Recorded(file_id, recorder.path, recorder.num_events, recorder.num_missing, is_over)

    def _new_id(self) -> str:
        return f"recorded-{secrets.token_hex(4)}"

    def _waits_for(self) -> str:
        notes = [note.text for note in self.live.notes if note.setting is None]
        if notes:
            return f"{self.live.source.name}: {notes[-1]}"
        if self.live.extent().num_events == 0:
            return f"{self.live.source.name}: no events yet; move something before it"
        return f"{self.live.source.name}: the network is getting ready"


def _in_millions(band: Band) -> tuple[float, float]:
    return band.lowest / 1e6, band.highest / 1e6

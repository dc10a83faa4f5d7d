"""`etnet reconstruct --live SOURCE`: frames of a camera, a stream or a replayed recording while its events come."""

from __future__ import annotations

import signal
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from threading import Event
from typing import TYPE_CHECKING, Annotated, Literal

import tyro

from etnet.cli.frames_folder import FRAMES, check_frames
from etnet.cli.policy import parse_policy
from etnet.cli.progress import SAYS_EVERY, console
from etnet.live.layouts import LayoutName
from etnet.live.open import SourceOptions, open_source, parsed_keep, parsed_sensor
from etnet.live.rate import follower_of
from etnet.live.record import Recorder, check_recordable
from etnet.live.recording import LiveRecording
from etnet.windows import Policy

if TYPE_CHECKING:
    from etnet.live.binning import Downsample
    from etnet.nets.base import Reconstructor

MEASURED_SECONDS = 0.5
"""Of events that the rate is measured over before windows are chosen."""


@dataclass(frozen=True)
class LiveOptions:
    """How a live source is taken."""

    sensor: str | None = None
    """WIDTHxHEIGHT of a stream that does not tell it."""
    layout: LayoutName | None = None
    """Of a stream: es (Event Stream), t64_x16_y16_on8 or t32_x16_y15_on1 (faery's)."""
    speed: float = 1.0
    """Of a replayed recording; 0 is as fast as it goes."""
    loop: bool = False
    """Replay again and again."""
    keep: str = "60s,512MB"
    """How much is held: seconds, MB, or both."""
    rate: tuple[float, float] | None = None
    """Lowest and highest Mev/s: the biases of an EVK4 or DAVIS346 follow to stay between."""
    seconds: float | None = None
    """End after so long; default: when the source ends, or at Ctrl+C."""

    def source_options(self) -> SourceOptions:
        """What the source needs of it."""
        sensor = None if self.sensor is None else parsed_sensor(self.sensor)
        return SourceOptions(sensor, self.layout, self.speed, self.loop)


@dataclass(frozen=True)
class ReconstructLive:
    """Turn what a camera sees into frames while it sees it: PNG files and a table of their stamps."""

    live: str
    """camera, davis346, evk4 …, stdin, tcp:PORT, udp:PORT, webcam, or a recording to replay."""
    out: Path = Path("reconstruction")
    """Folder for frames/ and stamps.csv."""
    record: Path | None = None
    """Also record the events: .aedat4 or .h5."""
    overwrite: bool = False
    """Replace frames and the recorded file if they are there."""
    model: str = "etnet-half"
    """A bundled model's name, or a weights file."""
    windows: str | None = None
    """count=10000, density=0.35 or duration=20ms; default: chosen so that a step fits."""
    downsample: Literal["auto", "1", "2", "4"] = "auto"
    """Bin so many pixels a side for the network; auto does above 346×260."""
    device: str = "cpu"
    precision: Literal["fp32", "bf16", "auto"] = "fp32"
    gamma: Annotated[float | None, tyro.conf.arg(metavar="NUMBER")] = None
    """Display gamma of the PNGs; default: what the model's card says."""
    options: Annotated[LiveOptions, tyro.conf.arg(name="")] = field(default_factory=LiveOptions)


def run(config: ReconstructLive) -> int:
    """Do it; returns the exit code."""
    from etnet.export.images import check_gamma
    from etnet.live.binning import fitting_downsample
    from etnet.nets.weights import load_model

    if config.gamma is not None:
        check_gamma(config.gamma)
    policy = None if config.windows is None else parse_policy(config.windows)
    check_frames(config.out / FRAMES, config.overwrite)
    if config.record is not None:
        check_recordable(config.record, config.overwrite, config.live)
    model = load_model(config.model, config.device, config.precision)
    with ExitStack() as stack:
        is_stopped = stack.enter_context(stopping(config.options.seconds))
        live = stack.enter_context(opened(config.live, config.options, is_stopped))
        stated: dict[str, Downsample] = {"1": 1, "2": 2, "4": 4}
        downsample = stated.get(config.downsample) or fitting_downsample(live.sensor)
        num_frames = _reconstruct(config, policy, stack, live, model, downsample, is_stopped)
    console.print(f"wrote {num_frames} frames to {config.out}", markup=False, soft_wrap=True)
    return 0 if num_frames else 1


def _reconstruct(
    config: ReconstructLive,
    policy: Policy | None,
    stack: ExitStack,
    live: LiveRecording,
    model: Reconstructor,
    downsample: Downsample,
    is_stopped: Event,
) -> int:
    from etnet.cli.live_frames import FrameFolder
    from etnet.events.events import Sensor
    from etnet.live.pace import fitting_policy, measured_step
    from etnet.live.reconstruct import reconstruct_live
    from etnet.live.windows import LiveWindows

    seen = Sensor(-(-live.sensor.width // downsample), -(-live.sensor.height // downsample))
    step_seconds = measured_step(model, seen) if policy is None else 0.0
    # A policy that live windows do not take is refused here, before a file of --record is replaced.
    asked = None if policy is None else LiveWindows(live, policy, seen)
    recorder = None
    if config.record is not None:
        recorder = stack.enter_context(Recorder(live, config.record, first=0, overwrite=config.overwrite))
    live.start()
    told = Teller(live)
    if asked is not None:
        windows, said = asked, f"windows {config.windows}"
    else:
        pace = fitting_policy(step_seconds, _rate(live, is_stopped, told), seen)
        windows, said = LiveWindows(live, pace.policy, seen), pace.said
    binned = f", binned {downsample}×{downsample} to {seen}" if downsample > 1 else ""
    console.print(f"{live.source.name}: {live.sensor}{binned}; {said}", markup=False, soft_wrap=True)
    if recorder is not None:
        recorder.follow(windows.kept, repr(windows.policy), downsample)

    def tell(state: str) -> None:
        told.tell(f"{state}, {windows.num_merged} windows merged")

    def tell_waiting() -> None:
        tell("waiting for the next window")

    with FrameFolder(config.out, model, config.gamma, config.overwrite) as folder:
        for live_step in reconstruct_live(model, windows, downsample, is_stopped.is_set, tell_waiting):
            folder.add(live_step.window, live_step.step.frame, live_step.num_merged)
            tell(_behind(live_step.behind))
    told.tell(f"{windows.num_merged} windows merged, {windows.num_unseen} events unseen", is_last=True)
    return len(windows.kept)


@contextmanager
def opened(text: str, options: LiveOptions, is_stopped: Event) -> Iterator[LiveRecording]:
    """The live recording of a source, to be started."""
    keep = parsed_keep(options.keep)
    source = open_source(
        text,
        options.source_options(),
        is_stopped.is_set,
        lambda said: console.print(said, markup=False, soft_wrap=True),
    )
    try:
        live = LiveRecording(source, keep, follower_of(source, options.rate))
    except BaseException:
        source.close()
        raise
    try:
        yield live
    finally:
        live.stop()


@contextmanager
def stopping(seconds: float | None) -> Iterator[Event]:
    """An event that Ctrl+C, a request to end, or the time sets: what was begun is finished then."""
    stopped = Event()
    before = {number: signal.signal(number, lambda *_: stopped.set()) for number in (signal.SIGINT, signal.SIGTERM)}
    timer = None
    if seconds is not None:
        from threading import Timer

        timer = Timer(seconds, stopped.set)
        timer.daemon = True
        timer.start()
    try:
        yield stopped
    finally:
        if timer is not None:
            timer.cancel()
        for number, handler in before.items():
            signal.signal(number, handler)


class Teller:
    """Prints new notes as they come, and a line about the state once a second; once a minute without a terminal."""

    def __init__(self, live: LiveRecording) -> None:
        self._live, self._told, self._last = live, 0, time.monotonic()

    def tell(self, state: str, is_last: bool = False) -> None:
        """Notes at once; the state when it is time."""
        self._told, notes = self._live.notes_from(self._told)
        for note in notes:
            console.print(f"  {note.stamp / 1e6:.1f} s: {note.text}", markup=False, soft_wrap=True)
        every = 1.0 if console.is_terminal else SAYS_EVERY
        if not is_last and time.monotonic() - self._last < every:
            return
        self._last = time.monotonic()
        extent, loss = self._live.extent(), self._live.loss
        seconds = ((extent.until or 0) - (extent.first_stamp or 0)) / 1e6
        lost = f", {loss.packets} packets lost" if loss.packets else ""
        console.print(f"  {seconds:.1f} s, {extent.num_events:,} events, {state}{lost}", markup=False, soft_wrap=True)


def _behind(seconds: float | None) -> str:
    return "far behind" if seconds is None else f"{1000 * seconds:.0f} ms behind"


def _rate(live: LiveRecording, is_stopped: Event, told: Teller) -> float:
    """Events a second over the first moments; what goes wrong in them is told."""
    until = time.monotonic() + 10
    while not (is_stopped.is_set() or live.is_over) and time.monotonic() < until:
        extent = live.extent()
        if extent.until is not None and extent.first_stamp is not None:
            seconds = (extent.until - extent.first_stamp) / 1e6
            if seconds >= MEASURED_SECONDS:
                return extent.num_events / seconds
        told.tell("measuring the event rate")
        is_stopped.wait(0.05)
    return 0.0

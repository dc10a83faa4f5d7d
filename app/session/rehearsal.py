"""Before a demo's doors open: its first recording is rendered, so that the first visitor sees motion at once.

A live source cannot be rendered ahead: it is waited for until the network keeps up with it.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from threading import Event
from typing import Protocol

from app.catalogue.cut import CutRecording
from app.catalogue.live import WaitingForEvents
from app.catalogue.recordings import Catalogue, suited_policy
from app.engine.engine import Engine
from app.engine.requests import Failed, FrameRequest, Ready, Reply
from app.state.view_state import ViewState
from etnet.errors import EtnetError, ModelError
from etnet.events.recording import Recording
from etnet.windows import plan_windows

VISITOR = "rehearsal"
MOST_WINDOWS = 120
"""Of a long recording only its beginning is rendered."""
PATIENCE = 120.0
"""Seconds for which one image may take."""
LIVE_PATIENCE = 60.0
"""Seconds in which a live source has its first window, while a network is loaded, and then the further ones."""
LIVE_WINDOWS = 8
"""Of a live source so many are waited for at most."""
LOOK = 0.02
"""Seconds from one look for its next window to the next."""

Tell = Callable[[int, int], None]
"""Told (images made, images wanted)."""


@dataclass(frozen=True, slots=True)
class Rehearsed:
    """What was rendered of a recording, and how long an image took in the median (seconds)."""

    num_images: int
    step: float


def rehearse(
    engine: Engine,
    catalogue: Catalogue,
    view: ViewState,
    tell: Tell,
    most: int = MOST_WINDOWS,
    may_be_silent: bool = False,
) -> Rehearsed:
    """Render the windows of the view's recording from the first on. Raises EtnetError where that cannot be shown.

    `may_be_silent`: nothing is rendered of a live source that sees a still scene; its page says so and waits on.
    """
    try:
        recording = _opened(catalogue, view.recording_id)
    except WaitingForEvents:
        if not may_be_silent:
            raise
        return Rehearsed(0, 0.0)
    if isinstance(recording, CutRecording) and recording.is_live:
        return _followed(engine, recording, view, tell, min(most, LIVE_WINDOWS))
    policy = suited_policy(recording) if view.policy is None else view.policy
    num_windows = min(len(plan_windows(recording, policy)), most)
    if num_windows == 0:
        raise EtnetError(f"{recording.name}: holds no events, so there is nothing to show")
    took: list[float] = []
    try:
        for index in range(num_windows):
            began = time.perf_counter()
            request = FrameRequest(view.recording_id, view.model_id, view.precision, policy, index)
            _render(engine, request)
            took.append(time.perf_counter() - began)
            tell(index + 1, num_windows)
    finally:
        engine.drop(VISITOR)
    return Rehearsed(num_windows, sorted(took)[len(took) // 2])


def _opened(catalogue: Catalogue, recording_id: str) -> Recording:
    """The recording; of a live source once its first window was cut."""
    until = time.monotonic() + LIVE_PATIENCE
    while True:
        try:
            return catalogue.open(recording_id)
        except WaitingForEvents:
            if time.monotonic() > until:
                raise


def _followed(engine: Engine, recording: CutRecording, view: ViewState, tell: Tell, most: int) -> Rehearsed:
    """The newest windows of a live source, one after the other; fewer of a scene that has become still."""
    last, num_images, step, until = -1, 0, 0.0, time.monotonic() + LIVE_PATIENCE
    try:
        while num_images < most:
            newest = recording if recording.latest is None else recording.latest()
            assert isinstance(newest, CutRecording)
            if len(newest.cut) - 1 == last:
                if newest.latest is None or time.monotonic() > until:
                    break  # the source has ended, or nothing moves before it
                time.sleep(LOOK)
                continue
            last, policy = len(newest.cut) - 1, newest.policy
            assert policy is not None
            request = FrameRequest(view.recording_id, view.model_id, view.precision, policy, last)
            _render(engine, request)
            num_images, step = num_images + 1, (engine.status(request).step_milliseconds or 0.0) / 1000
            tell(num_images, most)
    finally:
        engine.drop(VISITOR)
    return Rehearsed(num_images, step)


class Looking(Protocol):
    """A mirror that somebody looks into."""

    @property
    def recording_id(self) -> str:
        """What is looked at."""
        ...

    def advance(self) -> None:
        """The network is free."""
        ...

    def behind(self, stamp: int) -> float | None:
        """Seconds since the frame of this stamp (µs) came in."""
        ...


@dataclass(frozen=True, slots=True)
class Mirrored:
    """How the network followed a mirror: images a second, and seconds by which the median image was behind."""

    rate: float
    delay: float


def rehearse_mirror(engine: Engine, catalogue: Catalogue, view: ViewState, mirror: Looking, seconds: float) -> Mirrored:
    """Make an image of what a mirror sees whenever the network is free, as its page does, while frames come in.

    Raises EtnetError where nothing can be shown of it.
    """
    recording = catalogue.open(mirror.recording_id)
    policy = suited_policy(recording)
    began, last, delays, ends = 0.0, -1, list[float](), time.monotonic() + PATIENCE
    while not began or time.monotonic() - began < seconds:
        if time.monotonic() > ends:
            raise ModelError(f"no image of the mirror within {PATIENCE:.0f} s; the machine is too slow, or busy")
        mirror.advance()
        assert recording.latest is not None
        windows = plan_windows(recording.latest(), policy)
        if len(windows) - 1 == last:
            time.sleep(0.005)
            continue
        last = len(windows) - 1
        _render(engine, FrameRequest(mirror.recording_id, view.model_id, view.precision, policy, last))
        behind = mirror.behind(windows[last].t_stop)
        if not began:
            began = time.monotonic()  # the first image waits for the network to be made ready for this size
        elif behind is not None:
            delays.append(behind)
    engine.drop(VISITOR)
    rate = len(delays) / (time.monotonic() - began)
    return Mirrored(rate, sorted(delays)[len(delays) // 2] if delays else seconds)


def _render(engine: Engine, request: FrameRequest) -> None:
    is_there, failures = Event(), list[str]()

    def hear(reply: Reply) -> None:
        if isinstance(reply, Failed):
            failures.append(reply.message)
        if isinstance(reply, Failed) or (isinstance(reply, Ready) and not reply.is_approximate):
            is_there.set()

    engine.request(VISITOR, request, hear)
    if not is_there.wait(PATIENCE):
        raise ModelError(f"window {request.index}: no image within {PATIENCE:.0f} s; the machine is too slow, or busy")
    if failures:
        raise ModelError(failures[0])

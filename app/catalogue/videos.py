"""Videos as an event sensor would see them: simulated beside the page, one film for each video and setting.

A film's id is its video's, with the setting behind it, so that everything that is computed of it is kept by that. It is
made for as long as somebody looks at it; each visitor looks at one at a time, the last one opened. What is known of the
first seconds of the last videos is kept, so that another setting costs the pixels' work alone there.
"""

from __future__ import annotations

import contextlib
import os
import re
import threading
import time
from collections import OrderedDict
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from threading import Event, RLock, Semaphore
from typing import TYPE_CHECKING
from weakref import WeakSet

from etnet.errors import Cancelled, RecordingError
from etnet.events.recording import Recording
from etnet.private_folder import PrivateFolder

if TYPE_CHECKING:
    from app.catalogue.entries import Unpacking
    from etnet.simulation.beginning import Beginning
    from etnet.simulation.growing import GrowingVideo, Pace

AT_ONCE = 2
"""Videos that are simulated at the same time; others wait."""
KEPT = 3
"""Videos that nobody looks at and that are whole."""
AT_ONCE_SECONDS = 2.0
"""Of a video, that somebody waits for."""
QUIET = 0.25
"""Seconds that a setting stands before it is simulated: a slider passes through many."""
BEGINNINGS = 2
"""Videos whose first seconds are kept for the next setting; those that were looked at last."""
CONTRASTS, NOISES = (0.05, 1.0), (0.0, 3.0)
"""What the sliders offer."""
BANDWIDTHS = (0, 200, 100, 50, 20, 10)
"""Hz of a white pixel; 0 is no limit."""
SIDES = (120, 160, 240, 320, 480)
"""Pixels of the longer side."""
_SETTING = re.compile(r"^(.*)~(\d\.\d\d)~(\d\.\d\d)~(\d{1,3})~(\d{3})$")
_ENDS_WITHIN = 2.0
"""Seconds that the end of the viewer waits for simulations; they look between two frames whether they are wanted."""
_LOW_PRIORITY = 10
_ASK_EVERY = 0.2
"""Seconds from one question whether a video that waits for its turn is wanted to the next."""


@dataclass(frozen=True, slots=True)
class FilmSetting:
    """How a video is seen; brought to what is offered."""

    contrast: float = 0.2
    noise: float = 0.2
    bandwidth: int = 0
    side: int = 320

    def __post_init__(self) -> None:
        values = {
            "contrast": round(min(max(self.contrast, CONTRASTS[0]), CONTRASTS[1]), 2),
            "noise": round(min(max(self.noise, NOISES[0]), NOISES[1]), 2),
            "bandwidth": min(BANDWIDTHS, key=lambda offered: abs(offered - self.bandwidth)),
            "side": min(SIDES, key=lambda offered: abs(offered - self.side)),
        }
        for name, value in values.items():
            object.__setattr__(self, name, value)

    @property
    def words(self) -> str:
        """As an id has it."""
        return f"{self.contrast:.2f}~{self.noise:.2f}~{self.bandwidth}~{self.side}"


@dataclass(frozen=True, slots=True)
class VideoShown:
    """What a page says of the current video; times are seconds of video, `work` seconds of work for one of them."""

    setting: FilmSetting
    done: float
    total: float
    work: float | None
    is_over: bool


@dataclass(eq=False, slots=True)
class _Film:
    video: GrowingVideo
    path: Path
    watchers: set[str] = field(default_factory=set)
    cancelled: Event = field(default_factory=Event)
    is_low: bool = False
    """Whether its thread gives way to the others."""

    @property
    def is_whole(self) -> bool:
        """Whether it came to its end, and to something."""
        return self.video.pace.is_over and not self.video.has_failed


def film_id(recording_id: str, setting: FilmSetting) -> str:
    """The id of a video's film under another setting."""
    return f"{split_id(recording_id)[0]}~{setting.words}"


def split_id(recording_id: str) -> tuple[str, FilmSetting]:
    """The id of a video, and the setting of its film; what is not offered counts as part of the id."""
    found = _SETTING.match(recording_id)
    if found is None:
        return recording_id, FilmSetting()
    setting = FilmSetting(float(found[2]), float(found[3]), int(found[4]), int(found[5]))
    is_offered = recording_id == f"{found[1]}~{setting.words}"
    return (found[1], setting) if is_offered else (recording_id, FilmSetting())


def is_simulated(recording: Recording) -> bool:
    """Whether it is a film that was made here."""
    return recording.format == "a video, simulated"


class Videos:
    """All films of a server. Safe from every thread."""

    def __init__(self, forget: Callable[[str], object] = lambda recording_id: None) -> None:
        """`forget` is told the id of a film that is no more: nothing computed of it is of use."""
        self._forget = forget
        self._films: OrderedDict[str, _Film] = OrderedDict()
        self._beginnings: OrderedDict[tuple[str, int], Beginning] = OrderedDict()
        self._streams: dict[str, Callable[[Callable[[], bool]], Recording]] = {}
        self._folder: PrivateFolder | None = None
        self._lock = RLock()
        self._turns = Semaphore(AT_ONCE)
        self._num_made = 0
        self._threads: WeakSet[threading.Thread] = WeakSet()

    def stream(self, recording_id: str, wait: Callable[[Callable[[], bool]], Recording]) -> None:
        """Let what a camera sees be opened by an id: `wait` gives it once there is enough to show."""
        with self._lock:
            self._streams[recording_id] = wait

    def holds(self, recording_id: str) -> bool:
        """Whether an id is that of a camera's stream."""
        return recording_id in self._streams

    def open(self, recording_id: str) -> Recording:
        """A film that was begun, as far as it is; waits until there is enough to show. Raises EtnetError."""
        with self._lock:
            stream = self._streams.get(recording_id)
        if stream is not None:
            return stream(lambda: not self.holds(recording_id))
        with self._lock:
            film = self._films.get(recording_id)
            if film is None:
                raise RecordingError("nobody looks at this video any more; open it again")
            self._films.move_to_end(recording_id)
        return film.video.wait(film.cancelled.is_set)

    def watch(self, visitor: str, recording_id: str | None) -> None:
        """What a visitor looks at from now on; a film that nobody looks at any more is not made further."""
        with self._lock:
            for film in self._films.values():
                film.watchers.discard(visitor)
            if recording_id is not None and recording_id in self._films:
                self._films[recording_id].watchers.add(visitor)
            idle = [key for key, film in self._films.items() if not film.watchers]
            whole = [key for key in idle if self._films[key].is_whole]
            unfinished = [key for key in idle if key not in whole]
            # Taken out at once: one that somebody begins to look at meanwhile is another one.
            gone = [(key, self._films.pop(key)) for key in (*unfinished, *whole[:-KEPT])]
        for key, film in gone:
            self._end(key, film)
        with self._lock:
            looked_at = {split_id(key)[0] for key, film in self._films.items() if film.watchers}
            for key in [key for key in self._beginnings if key[0] not in looked_at]:
                del self._beginnings[key]

    def begin(
        self,
        visitor: str,
        recording_id: str,
        video: Path,
        name: str,
        is_strangers: bool = False,
        unpacking: Unpacking | None = None,
    ) -> None:
        """A visitor looks at this film from now on; it is begun if it is not there, and again if it failed.

        `is_strangers`: the video is decoded in a process of its own. `unpacking`: the film lies beside the video,
        counts in it, and ends where that has no room for more.
        """
        if self.holds(recording_id):
            self.watch(visitor, None)
            return
        with self._lock:
            failed = self._films.pop(recording_id) if self.has_failed(recording_id) else None
            if recording_id not in self._films:
                self._begin(recording_id, video, name, is_strangers, unpacking)
            self._films[recording_id].watchers |= {visitor} if failed is None else {visitor, *failed.watchers}
        if failed is not None:
            self._end(recording_id, failed)
        self.watch(visitor, recording_id)

    def has_failed(self, recording_id: str) -> bool:
        """Whether a film is there that came to nothing."""
        with self._lock:
            film = self._films.get(recording_id)
        return film is not None and film.video.has_failed

    @contextlib.contextmanager
    def turn(self, is_cancelled: Callable[[], bool]) -> Iterator[None]:
        """One of `AT_ONCE`, in which a video is simulated; others wait for theirs.

        Raises:
            Cancelled: nobody wanted it any more before it had its turn.
        """
        while not self._turns.acquire(timeout=_ASK_EVERY):
            _check_wanted(is_cancelled)
        try:
            _check_wanted(is_cancelled)
            yield
        finally:
            self._turns.release()

    def shown(self, recording_id: str) -> VideoShown | None:
        """How far a film is; `None` where there is none of that id."""
        with self._lock:
            film = self._films.get(recording_id)
        if film is None:
            return None
        pace: Pace = film.video.pace
        return VideoShown(split_id(recording_id)[1], pace.done, pace.total, pace.work, pace.is_over)

    def let_go(self, video_id: str) -> None:
        """A video is no more: neither are its films."""
        with self._lock:
            self._streams.pop(video_id, None)
            gone = [key for key in self._films if split_id(key)[0] == video_id]
            for key in [key for key in self._beginnings if key[0] == video_id]:
                del self._beginnings[key]
        for key in gone:
            self._drop(key)

    def close(self) -> None:
        """End all simulations and remove what they made.

        Those of the last moment are waited for: a thread that is at work in a library ends the interpreter badly.
        """
        with self._lock:
            keys = list(self._films)
        for key in keys:
            self._drop(key)
        ends = time.monotonic() + _ENDS_WITHIN
        for thread in list(self._threads):
            thread.join(max(0.0, ends - time.monotonic()))
        with self._lock:
            folder, self._folder = self._folder, None
        if folder is not None:
            folder.close()

    def _begin(
        self, recording_id: str, video: Path, name: str, is_strangers: bool, unpacking: Unpacking | None
    ) -> _Film:
        from etnet.simulation.growing import LARGEST, GrowingVideo
        from etnet.simulation.video import VideoConfig

        video_id, setting = split_id(recording_id)
        self._num_made += 1
        path = self._place(video, unpacking) / f"film-{self._num_made}.h5"
        largest = LARGEST if unpacking is None else min(LARGEST, max(unpacking.left_unpacked, 0))
        opened = None
        if is_strangers:
            from app.catalogue.video_apart import FootageApart as opened
        config = VideoConfig(setting.contrast, setting.noise, setting.side, cutoff_hz=float(setting.bandwidth))
        beginning = self._beginning(video_id, setting.side)
        film = _Film(GrowingVideo(video, path, config, name, largest, opened, beginning), path)
        self._films[recording_id] = film
        thread = threading.Thread(target=self._make, args=(film,), daemon=True, name="film")
        self._threads.add(thread)
        thread.start()
        return film

    def _place(self, video: Path, unpacking: Unpacking | None) -> Path:
        """Where films of a video lie: a visitor's beside it, so that they go with it."""
        if unpacking is not None:
            return video.parent
        if self._folder is None:
            self._folder = PrivateFolder("etnet-films-")
        return self._folder.path

    def _beginning(self, video_id: str, side: int) -> Beginning:
        """What is known of the first seconds of a video at this size."""
        from etnet.simulation.beginning import Beginning

        found = self._beginnings.setdefault((video_id, side), Beginning())
        self._beginnings.move_to_end((video_id, side))
        while len(self._beginnings) > BEGINNINGS:
            self._beginnings.popitem(last=False)
        return found

    def _make(self, film: _Film) -> None:
        if not film.cancelled.wait(QUIET):
            with contextlib.suppress(Cancelled), self.turn(film.cancelled.is_set):
                film.video.run(partial(self._is_unwanted, film))
        if film.cancelled.is_set():
            film.path.unlink(missing_ok=True)

    def _is_unwanted(self, film: _Film) -> bool:
        """Asked before each frame. Whoever moved a slider waits for the first seconds; after them the page and the
        network go first. The threads that look for motion are two frames ahead at most, so they follow."""
        if not film.is_low and film.video.pace.done > AT_ONCE_SECONDS:
            film.is_low = True
            with contextlib.suppress(OSError, AttributeError):
                # A system that knows no priority of one thread does without.
                os.setpriority(os.PRIO_PROCESS, threading.get_native_id(), _LOW_PRIORITY)
        return film.cancelled.is_set()

    def _drop(self, recording_id: str) -> None:
        with self._lock:
            film = self._films.pop(recording_id, None)
        if film is not None:
            self._end(recording_id, film)

    def _end(self, recording_id: str, film: _Film) -> None:
        """Stop a film that was taken out. Not under the lock: others are told."""
        film.cancelled.set()
        film.path.unlink(missing_ok=True)
        self._forget(recording_id)


def _check_wanted(is_cancelled: Callable[[], bool]) -> None:
    if is_cancelled():
        raise Cancelled("nobody wants this simulation any more")

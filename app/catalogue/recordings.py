"""Which recordings and models a visitor can open. Ids are opaque: no path goes to a page, none comes from one."""

from __future__ import annotations

import logging
import math
import sys
import time
import weakref
from collections import OrderedDict
from collections.abc import Callable
from contextlib import closing
from dataclasses import replace
from functools import partial
from pathlib import Path
from threading import Event, Lock
from typing import TYPE_CHECKING

from app.catalogue.binning import opened_to_fit
from app.catalogue.cut import CutRecording
from app.catalogue.entries import Entry, called_by_its_name, listed, under_its_name
from app.catalogue.folder import VIDEO_SUFFIXES, Watch, recordings_in, sign_of
from app.catalogue.listed_facts import ListedFacts
from app.catalogue.live import LiveFeed
from app.catalogue.models import ModelEntry, digest, offered_models
from app.catalogue.recording_id import RecordingId, known_as, listed_id, whole_id
from app.catalogue.threads import THREADS
from app.catalogue.videos import Videos
from app.catalogue.visitor_uploads import MEGABYTE, UNPACKED, UploadError
from app.config import ViewerConfig
from etnet.errors import EtnetError, RecordingError
from etnet.events.assumptions import NOTHING_ASSUMED, Assumptions
from etnet.events.opened_as import WHOLE_VIEW, OpenedAs, View
from etnet.events.recording import Recording, Remark
from etnet.events.samples import fetch
from etnet.private_folder import PrivateFolder
from etnet.windows import BetweenFrames, ByDensity, Policy

if TYPE_CHECKING:
    from app.catalogue.opening_apart import OpenedApart

KEPT_OPEN = 6
"""Recordings that stay open though nobody looks at them."""
LOOK_EVERY = 1.0
"""Seconds from one look into the --data folder to the next, while anybody is here; more where looking is slow."""
_PATIENCE = 20
LOOK_AFTER = 3.0
"""Seconds after the start in which the first page is drawn; only then the files of the list are looked at."""
OPENS_WITHIN = 1.0
"""Seconds after which a large RAW file is shown as far as it is indexed; the rest follows."""
DEFAULT_DENSITY = 0.35
"""Events per pixel a window where no camera frame says when: near `slider_depth`'s 0.30."""

_log = logging.getLogger(__name__)


class CatalogueError(EtnetError):
    """Something was asked for that the catalogue does not hold."""


class Catalogue:
    """Recordings and models by id; recordings are opened once for all visitors. Safe from every thread."""

    def __init__(
        self,
        config: ViewerConfig,
        live: LiveFeed | None = None,
        forget: Callable[[str], object] = lambda recording_id: None,
    ) -> None:
        """`live`: a source that is one of the recordings; it is closed with the catalogue.

        `forget` is told the id of a recording that is no more though its file is: a film under another setting.
        """
        self._config = config
        self.live = live
        self._open: OrderedDict[str, Recording] = OrderedDict()
        self._opening: dict[str, Lock] = {}
        self._lock = Lock()
        self._closed = Event()
        self._private: dict[str, Entry] = {}
        self.films = Videos(forget)
        self.facts = ListedFacts()
        self._granted: dict[str, OpenedAs] = {}
        self._scratch: PrivateFolder | None = None
        self._models = tuple(offered_models(config))
        self._watch = Watch({} if config.data is None else recordings_in(config.data))
        self._next_look = time.monotonic() + LOOK_EVERY if config.data is not None else math.inf
        self._entries = tuple(listed(config, self._watch.offered))

    def grant(self, recording_id: str, opened: OpenedAs) -> None:
        """Open an id in this way, whoever comes in: it is that of the host's own session file."""
        self._granted[recording_id] = opened

    def entries(self) -> tuple[Entry, ...]:
        """The file of the command line, the bundled recordings, those of the --data folder, those to be fetched.

        A question sets off a look into the folder, if one is due; what it finds is there for the next one.
        """
        with self._lock:
            is_due = time.monotonic() >= self._next_look
            if is_due:
                self._next_look = math.inf
        if is_due:
            THREADS.start(self._look_beside, "watching")
        return (*self._live_entries(), *self._entries)

    def _live_entries(self) -> tuple[Entry, ...]:
        """The live source, and what was recorded of it."""
        if self.live is None:
            return ()
        source = self.live.live.source
        live = Entry(self.live.id, source.name, "live", f"live, {source.sensor}", Path())
        return live, *(
            Entry(file.id, file.path.name, "recorded", f"recorded here, {file.num_events:,} events", file.path)
            for file in self.live.files()
        )

    def look_at_files(self, after: float = LOOK_AFTER) -> None:
        """Learn what the list says of files that can be opened in a moment. Called beside the page, which comes first:
        nothing is opened before `after` seconds have passed."""
        if self._closed.wait(after):
            return
        files = [(entry.id, entry.path) for entry in self._entries if entry.remote is None]
        self.facts.look(files, self._closed.is_set)

    def growing(self) -> tuple[str, ...]:
        """Names of files in the --data folder that are being written; they are offered once they rest."""
        return self._watch.growing

    def look(self, now: float) -> None:
        """Look into the --data folder. `now`: seconds of any steady clock. Not from two threads at once."""
        if self._config.data is None or not self._watch.look(recordings_in(self._config.data), now):
            return
        entries = tuple(listed(self._config, self._watch.offered))
        with self._lock:
            known = {entry.id for entry in entries} | self._private.keys()
            self._entries = entries
            for gone in [key for key in self._open if listed_id(key) not in known]:
                del self._open[gone]  # closed when its last user releases it
            for gone in self._opening.keys() - known:
                del self._opening[gone]
                self.facts.forget(gone)

    def _look_beside(self) -> None:
        began = time.monotonic()
        try:
            self.look(began)
        except Exception:  # a folder may vanish under the look; the next one is another
            _log.warning("the --data folder could not be looked into", exc_info=True)
        finally:
            ended = time.monotonic()
            self._next_look = ended + max(LOOK_EVERY, _PATIENCE * (ended - began))

    def models(self) -> tuple[ModelEntry, ...]:
        """The model of the command line, the bundled ones, weights in the --data folder, untrained baselines."""
        return self._models

    def entry(self, recording_id: str) -> Entry:
        """The entry of an id, a part's too; an error if there is none. A film under another setting has its video's."""
        recording_id = listed_id(recording_id)
        found = self._private.get(recording_id) or next(
            (e for e in (*self._live_entries(), *self._entries) if e.id == recording_id), None
        )
        if found is None:
            raise CatalogueError("this recording is not in the catalogue (any more); choose another one")
        return found

    def model(self, model_id: str) -> ModelEntry:
        """The model of an id; an error if there is none."""
        found = next((entry for entry in self._models if entry.id == model_id), None)
        if found is None:
            raise CatalogueError("this model is not in the catalogue; choose another one")
        return found

    def open(self, recording_id: str, progress: Callable[[float], None] | None = None) -> Recording:
        """The recording of an id, opened on the first call; `known_as` says by which id. EtnetError and nothing else.

        Of a large file that is still being indexed it is the part that is there, and all of it in a later call.
        """
        entry = self.entry(recording_id)
        if self.is_film(entry):
            return self.films.open(recording_id)
        if self.live is not None and entry.kind == "live":
            return self.live.open()
        with self._lock:
            if (held := self._held(recording_id)) is not None:
                return held
            turn = self._opening.setdefault(entry.id, Lock())
        with turn:
            with self._lock:
                if (held := self._held(recording_id)) is not None:
                    return held
            if recording_id != whole_id(recording_id):
                raise CatalogueError(
                    f"{entry.title}: this part of it is closed, for more of it is known; open it again"
                )
            recording = self._read(entry, self._stated(entry, recording_id), self._view(entry, recording_id), progress)
            with self._lock:
                if entry.kind == "upload" and entry.id not in self._private:
                    raise CatalogueError(f"{entry.title}: was removed while it was being opened")
                self._open[known_as(recording_id, recording)] = recording
                self.facts.note(entry.id, recording)
                while len(self._open) > KEPT_OPEN:
                    self._open.popitem(last=False)  # closed when its last user releases it
            return recording

    def _held(self, recording_id: str) -> Recording | None:
        """What is open by this very id; else, of a file that is asked for as a whole, a part that still grows."""
        growing = (
            key
            for key, part in self._open.items()
            if whole_id(key) == recording_id and part.growth is not None and not part.growth.is_over
        )
        key = recording_id if recording_id in self._open else next(growing, None)
        if key is None:
            return None
        self._open.move_to_end(key)
        return self._open[key]

    def take_in(self, entry: Entry) -> None:
        """Let a recording be opened by anybody who knows its id; it stands in no list."""
        with self._lock:
            self._private[entry.id] = entry

    def let_go(self, recording_id: str) -> tuple[Recording, ...]:
        """Forget what was taken in; gives what was open of it, which is closed when its last user releases it."""
        self.films.let_go(recording_id)
        with self._lock:
            self._private.pop(recording_id, None)
            self._opening.pop(recording_id, None)
            self.facts.forget(recording_id)
            return tuple(self._open.pop(key) for key in [key for key in self._open if listed_id(key) == recording_id])

    def is_film(self, entry: Entry) -> bool:
        """Whether an entry is a video that is simulated while it is looked at. A part of one is simulated first."""
        if self.films.holds(entry.id):
            return True
        is_whole = self._config.view(self._config.downsample or 1) == WHOLE_VIEW
        return is_whole and entry.path is not None and entry.path.suffix.lower() in VIDEO_SUFFIXES

    def close(self) -> None:
        """Close every recording that is kept open."""
        self._closed.set()
        self.films.close()
        if self.live is not None:
            self.live.close()
        with self._lock:
            kept, self._open = list(self._open.values()), OrderedDict()
            scratch, self._scratch = self._scratch, None
        for recording in kept:
            recording.close()
        if scratch is not None:
            scratch.close()

    def _read(
        self, entry: Entry, stated: Assumptions, view: View | None, progress: Callable[[float], None] | None
    ) -> Recording:
        from etnet.events.open import open_recording

        try:
            if self.live is not None and entry.kind == "recorded":
                recording = self.live.reopened(entry.id)
                weakref.finalize(recording, recording.source.close)
                return recording
            path, told = entry.path, ()
            if entry.remote is not None:
                path = fetch(entry.remote, progress=progress)
            apart: OpenedApart | None = None
            if path.suffix.lower() in VIDEO_SUFFIXES:
                path, told = self._seen(entry, path, progress)
            elif self.is_strangers(entry):
                apart = self._opened_apart(entry, stated, progress)
                path, stated = apart.path, NOTHING_ASSUMED
            asked = self._config.downsample if view is None else view.downsample
            seen = self._config.view(asked or 1) if view is None else view
            opened = partial(open_recording, path, assume=stated, progress=progress, patience=OPENS_WITHIN)
            recording, binned = opened_to_fit(lambda seen: opened(view=seen), seen, asked is not None)
            if apart is not None:
                recording = apart.completed(recording)
            if binned is not None:
                recording = replace(recording, remarks=(*recording.remarks, binned))
        except EtnetError as error:
            raise under_its_name(error, entry) from error
        except Exception as error:
            said = " ".join(str(error).split())[:300]
            raise under_its_name(RecordingError(f"{entry.title}: cannot be opened ({said})"), entry) from error
        if told:  # a simulated video lies in a scratch file, which nobody opens again
            recording = replace(recording, remarks=(*told, *recording.remarks), opened_as=None)
        recording = called_by_its_name(recording, entry)
        weakref.finalize(recording, recording.source.close)
        return recording

    def is_strangers(self, entry: Entry) -> bool:
        """Whether a file came from somebody whom nobody here knows."""
        return entry.kind == "upload" and self._config.is_open and sys.platform != "win32"

    def _opened_apart(self, entry: Entry, stated: Assumptions, progress: Callable[[float], None] | None) -> OpenedApart:
        from app.catalogue.opening_apart import open_apart

        is_wanted = partial(self._is_wanted, entry)
        largest = UNPACKED * MEGABYTE * (self._config.upload_megabytes or 1)
        if entry.unpacking is not None:
            entry.unpacking.check_unpacked(entry.title, 1)
            largest = min(largest, entry.unpacking.left_unpacked)
        apart = open_apart(entry.path, stated, largest, progress or (lambda share: None), is_wanted)
        try:
            is_wanted()  # another one may have been opened meanwhile
        except UploadError:
            apart.remove()
            raise
        return apart

    def _is_wanted(self, entry: Entry) -> bool:
        """Whether the visitor of a file is still here. An error where too much has been made of their files."""
        if entry.unpacking is not None:
            entry.unpacking.check_unpacked(entry.title)
        return not self._is_gone(entry)

    def _is_gone(self, entry: Entry) -> bool:
        """Whether a visitor has gone with their file, or the viewer is being stopped. Many may ask, and often."""
        return self._closed.is_set() or (entry.kind == "upload" and entry.id not in self._private)

    def can_be_stated(self, entry: Entry) -> bool:
        """Whether a visitor may say what a file does not. Not where others come in: sorting loads all of it."""
        return _is_ones_own(entry) and not self._config.is_open

    def can_be_binned(self, entry: Entry) -> bool:
        """Whether a visitor may choose how its pixels are binned. Not where others come in: a large sensor is slow."""
        return not self._config.is_open and not self.is_film(entry)

    def _view(self, entry: Entry, recording_id: str) -> View | None:
        """How it is seen, as its id says; `None` leaves that to the command line and to the size of the sensor."""
        if recording_id in self._granted:
            return self._granted[recording_id].view
        view = RecordingId.of(recording_id).seen
        if view is not None and self._config.is_open:
            raise CatalogueError(f"{entry.title}: is seen here as the viewer chooses; open it without an option")
        return view

    def _stated(self, entry: Entry, recording_id: str) -> Assumptions:
        """What is stated of a recording: in its id, else on the command line, which speaks of the files it names."""
        if recording_id in self._granted:
            return self._granted[recording_id].assumed
        said = RecordingId.of(recording_id).stated
        if said != NOTHING_ASSUMED and not self.can_be_stated(entry):
            raise CatalogueError(f"{entry.title}: is taken at its word here; open it without a statement")
        is_named = _is_ones_own(entry) and entry.kind != "upload"
        return self._config.stated.assumptions() if is_named and said == NOTHING_ASSUMED else said

    def _seen(
        self, entry: Entry, video: Path, progress: Callable[[float], None] | None
    ) -> tuple[Path, tuple[Remark, ...]]:
        """What an event sensor sees of a video, made once while this catalogue lives; and that it is so."""
        from etnet.simulation.video import VideoConfig, simulate_footage, simulate_video

        config = VideoConfig()
        with self._lock:
            if self._scratch is None:
                self._scratch = PrivateFolder("etnet-video-")
        # A visitor's goes with the visitor.
        folder = video.parent if entry.kind == "upload" else self._scratch.path
        made = folder / f"{video.stem}-{digest(video)}-{sign_of(video)[1]}.h5"

        def is_cancelled() -> bool:
            return not self._is_wanted(entry)

        if not made.exists():
            with self.films.turn(partial(self._is_gone, entry)):
                if self.is_strangers(entry):
                    from app.catalogue.video_apart import FootageApart

                    with closing(FootageApart(video, config, is_cancelled)) as footage:
                        simulate_footage(footage, made, config, progress, is_cancelled)
                else:
                    simulate_video(video, made, config, progress, is_cancelled)
        values = f"contrast {config.contrast:g}, noise {config.noise:g}"
        said = f"simulated from a video (ESIM, {values}); `etnet simulate --video` takes other values"
        return made, (Remark("assumed", said),)


def _is_ones_own(entry: Entry) -> bool:
    """Whether somebody brought it, as a recording: a video is seen by a sensor of which we know everything."""
    return entry.kind in ("file", "data", "upload") and entry.path.suffix.lower() not in VIDEO_SUFFIXES


def suited_policy(recording: Recording) -> Policy:
    """How to cut a recording nobody has said anything about: as it was cut, between its frames, else by density."""
    if isinstance(recording, CutRecording) and recording.policy is not None:
        return recording.policy
    truth = recording.ground_truth
    return BetweenFrames() if truth is not None and len(truth) > 1 else ByDensity(DEFAULT_DENSITY)

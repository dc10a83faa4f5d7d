"""The side of the engine that knows torch: models, playbacks and the one budget of bytes they share.

Used by the engine's thread alone. torch is imported on the first call, never before.
"""

from __future__ import annotations

from bisect import bisect_left
from collections import OrderedDict
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

from app.catalogue.cut import CutRecording, windows_of
from app.catalogue.models import ModelEntry
from app.catalogue.recording_id import is_of
from app.engine.denoised import CleanedRecordings
from app.engine.pace import Pace
from app.engine.requests import FrameKey, FrameRequest, PlaybackKey
from app.engine.trial import check_step, expected_step, trial_milliseconds
from app.engine.warmth import SPARSEST, sparsest_of, windows_seen
from etnet.byte_cache import ByteCache
from etnet.errors import ModelError, WindowError
from etnet.events.recording import Recording
from etnet.nets.intervention import ORIGINAL, Intervention
from etnet.windows import Window, from_window

if TYPE_CHECKING:
    from etnet.events.edit import EventEdit
    from etnet.nets.attention import Attention
    from etnet.nets.runtime import Contract
    from etnet.playback.disk_cache import DiskCache
    from etnet.playback.playback import Playback

WARM_UP = 20
"""Windows after which a cold start is called warm, for models whose card does not say.

Measured with the bundled weights of `etnet-half`: after 20 windows a preview differs from the exact frame by 13–15 % of
the frame's standard deviation (mean absolute; `slider_depth`, `astronaut`), after 8 by 20–27 %, after 30 by 5–9 %.
"""
KEPT_MODELS = 5
KEPT_PLAYBACKS = 8
ATTENTION_SHARE = 0.125
"""Of the byte budget, for the queries and keys of the frames last asked for."""

BRANCH_SHARE = 4
"""A change that is carried on takes this part of its playback's budget."""
FEW_STATES = 8
"""So many states' bytes are left to a playback that was put away: a job may still go on in it."""

SCORE_BYTES = 4 << 20
Scores = ByteCache[tuple[FrameRequest, object, str, "int | None"], Mapping[str, float]]
"""Values by what they depend on: the frame, the contract, the protocol's rule and the camera frame."""
Loader = Callable[[ModelEntry, str, str], Any]
"""(model entry, precision, device) → a reconstructor that is ready to run."""
Made = Callable[[FrameRequest, "LoadedPlayback"], None]
"""Told the playback that was made, and for which request."""

DiskFor = Callable[[FrameRequest], "DiskCache | None"]
"""Where the playback of a request keeps its frames between two runs; `None`: nowhere."""


def nowhere(request: FrameRequest) -> None:
    """Nothing is kept."""
    return


class Library(Protocol):
    """Where recordings and models come from: the catalogue, or a test's stand-in."""

    def open(self, recording_id: str) -> Recording:
        """The recording of an id."""
        ...

    def model(self, model_id: str) -> ModelEntry:
        """The model of an id."""
        ...


@dataclass(eq=False, slots=True)
class LoadedPlayback:
    """One playback with what the engine has to know of it."""

    playback: Playback
    contract: Contract
    warm_up: int
    pace: Pace
    expected_step: float
    """Estimated from a small trial before the first step, ms."""
    state_bytes: int = 0
    sparsest: float = SPARSEST
    """Events per pixel of a window that counts as a whole one while the state warms up."""
    scores: Scores = field(default_factory=lambda: ByteCache(SCORE_BYTES))
    """How good its frames are, of all playbacks: a strip that is asked for again continues."""
    beside: Callable[[FrameRequest], LoadedPlayback] | None = None
    """The whole playback of another request, for a job about several runs; asked on the engine's thread."""
    branch: tuple[tuple[int, Intervention, EventEdit, bool], Playback] | None = None
    """What was changed last in the memory or the events, and the playback that carries it: one for all visitors."""

    def wait(self) -> None:
        """Wait until what was begun is computed, where that is another's work (a GPU's): then clocks tell the truth."""
        from etnet.nets.runtime import device_of, wait_for

        wait_for(device_of(self.playback.model))

    def num_seen(self, index: int, began_at: int) -> int:
        """How far the state of a window is warmed up, 0 … `warm_up`, where it was empty at window `began_at`."""
        num_pixels = self.playback.recording.sensor.num_pixels
        return windows_seen(self.windows, index, self.warm_up, num_pixels, self.sparsest, began_at)

    def playing(self, request: FrameRequest) -> tuple[Playback, Intervention]:
        """The playback in which a request's change is carried, and what is left to change when its frame is decoded."""
        if not request.needs_branch:
            return self.playback, request.intervention
        at = request.index if request.since is None else request.since
        if at > request.index:
            raise ModelError(f"window {request.index} lies before window {at}, at which the change begins")
        if at < self.playback.first:
            raise ModelError(
                f"a change can begin at window {self.playback.first}, where the memory was empty, or later"
            )
        key = (at, request.intervention, request.edit, request.once)
        if self.branch is None or self.branch[0] != key:
            from etnet.inspection.twin import changed

            share = self.budget_bytes
            self.branch = key, changed(self.playback, at, request.intervention, request.edit, request.once)
            self.budget_bytes = share
        return self.branch[1], ORIGINAL

    def reaches(self, index: int) -> bool:
        """Whether a window can be come to as it was: of a live recording, events on the way may have left."""
        recording = self.playback.recording
        if not isinstance(recording, CutRecording) or not recording.is_live:
            return True
        if not self.playback.first <= index < len(self.windows):
            return index >= self.playback.first
        seek = self.playback.plan(index)
        return not recording.is_gone(self.windows[index if seek.num_replayed == 0 else seek.from_index + 1])

    def is_past_all(self, index: int) -> bool:
        """Whether a window lies after every state that is held."""
        states = self.playback.cached().states
        return not states or index >= states[-1].stop

    def grow(self, request: FrameRequest) -> None:
        """Take in what a recording that is still being made has become."""
        latest = self.playback.recording.latest
        if latest is None or request.index < len(self.windows):
            return
        recording = latest()
        num_before = len(self.windows)
        former = () if request.cold_at else self.windows  # those of a cold start are numbered from there
        windows = from_window(windows_of(recording, request.policy, former), request.cold_at)
        self.playback.grow(recording, windows)
        if self.branch is None:
            return
        (at, *_, once), branch = self.branch
        if once and at + 1 >= num_before:  # nothing came after its window, so nothing brings the network back
            share = self.budget_bytes
            self.branch = None
            self.budget_bytes = share
        else:
            branch.grow(recording, windows)

    @property
    def first_there(self) -> int:
        """The first window that can be replayed: of a live recording, the first whose events are all still there."""
        return max(self.playback.first, _first_held(self.playback.recording, self.windows))

    @property
    def budget_bytes(self) -> int:
        """Bytes of the playback, and of its branch while there is one."""
        return self.playback.budget_bytes + (self.branch[1].budget_bytes if self.branch else 0)

    @budget_bytes.setter
    def budget_bytes(self, budget_bytes: int) -> None:
        for_branch = budget_bytes // BRANCH_SHARE if self.branch else 0
        self.playback.budget_bytes = budget_bytes - for_branch
        if self.branch is not None:
            self.branch[1].budget_bytes = for_branch

    def put_away(self) -> None:
        """Give its share of the budget back, but for what a job that goes on in it needs from window to window."""
        held = self.playback.cached()
        num_states = sum(len(states) for states in held.states)
        state_bytes = self.state_bytes or (held.nbytes // num_states if num_states else self.budget_bytes)
        few = FEW_STATES * state_bytes * (BRANCH_SHARE if self.branch else 1)
        self.budget_bytes = min(self.budget_bytes, few)

    @property
    def windows(self) -> Sequence[Window]:
        """The windows it plays."""
        return self.playback.windows

    @property
    def num_states(self) -> int:
        """States that fit into its budget; 0 while a state's size is not known."""
        from etnet.playback.playback import STATE_SHARE

        return int(self.playback.budget_bytes * STATE_SHARE) // self.state_bytes if self.state_bytes else 0


def _first_held(recording: Recording, windows: Sequence[Window]) -> int:
    """The first of these windows of which all events are there; the last where there is none."""
    if not isinstance(recording, CutRecording) or recording.extent is None:
        return 0
    return min(bisect_left(windows, recording.extent().first_held, key=lambda window: window.start), len(windows) - 1)


class PlaybackCache:
    """Loads models, keeps the playbacks that were used last, and divides the budget among them."""

    def __init__(
        self,
        library: Library,
        budget_bytes: int,
        device: str,
        threads: int | None,
        load: Loader | None = None,
        disk_for: DiskFor = nowhere,
        tunes: bool = False,
        longest_step: float | None = None,
        made: Made = lambda request, loaded: None,
    ) -> None:
        """`tunes`: networks run with the kernels that were measured to be fastest here. No playback is made where a
        step is expected to take more than `longest_step` ms. `made` is told of every one that is, whoever needs it.
        """
        self._longest_step, self._tell_made = longest_step, made
        self._library, self._disk_for, self._tunes = library, disk_for, tunes
        self._untried: tuple[Any, int, int] | None = None
        self._budget_bytes, self._device, self._threads = budget_bytes, device, threads
        self.cleaned = CleanedRecordings()
        self._scores: Scores = ByteCache(SCORE_BYTES)
        self._load = load or load_network
        self._models: OrderedDict[tuple[str, str], tuple[Any, float]] = OrderedDict()
        self._stages: OrderedDict[PlaybackKey, LoadedPlayback] = OrderedDict()
        self.version = 0
        """Counts the playbacks that came and went."""
        share = int(budget_bytes * ATTENTION_SHARE)
        self._attention: ByteCache[FrameKey, Attention] = ByteCache(share, overhead=0, fewest=1)

    def start(self) -> None:
        """Import torch and set its threads, for this thread and process."""
        import torch

        if self._threads is not None:
            torch.set_num_threads(self._threads)

    def has_model(self, request: FrameRequest) -> bool:
        """Whether the model of a request is loaded."""
        return (request.model_id, request.precision) in self._models

    def model(self, model_id: str, precision: str) -> tuple[Any, float]:
        """A model, loaded if need be, and the time of its trial step at 128×96, ms."""
        key = (model_id, precision)
        if key not in self._models:
            model = self._load(self._library.model(model_id), precision, self._device)
            self._models[key] = (model, trial_milliseconds(model))
            while len(self._models) > KEPT_MODELS:
                gone, _ = self._models.popitem(last=False)
                self._let_go([name for name in self._stages if name.network == gone])
        self._models.move_to_end(key)
        return self._models[key]

    def loaded(self, request: FrameRequest) -> LoadedPlayback:
        """The playback of a request, made on demand. Raises EtnetError where recording, windows or model do not fit."""
        key = request.playback
        if key not in self._stages:
            self._stages[key] = self._new_stage(request)
            self.version += 1
            self._let_go(list(self._stages)[:-KEPT_PLAYBACKS])
            self._divide()
            self._tell_made(request, self._stages[key])
        self._stages.move_to_end(key)
        self._stages[key].grow(request)
        return self._stages[key]

    def whole(self, request: FrameRequest) -> LoadedPlayback:
        """The same with all windows that there are by now, however far the request's own lies from the last one."""
        loaded = self.reaching(request)
        loaded.grow(replace(request, index=len(loaded.windows)))
        return loaded

    def reaching(self, request: FrameRequest) -> LoadedPlayback:
        """The same; one that cannot come to the newest windows any more, for events on the way have left the buffer,
        begins again from a cold start."""
        loaded = self.loaded(request)
        if not loaded.reaches(request.index) and loaded.is_past_all(request.index):
            self._let_go([request.playback])
            loaded = self.loaded(request)
        return loaded

    def anew(self, request: FrameRequest) -> LoadedPlayback:
        """The same, made anew whatever it holds: without states it begins at the first window that is held."""
        self._let_go([key for key in (request.playback,) if key in self._stages])
        return self.loaded(request)

    def held(self, request: FrameRequest) -> LoadedPlayback | None:
        """The playback for a request if there is one; makes none."""
        return self._stages.get(request.playback)

    def held_keys(self) -> frozenset[PlaybackKey]:
        """Which playbacks are kept, by `FrameRequest.playback`."""
        return frozenset(self._stages)

    def forget(self, recording_id: str) -> None:
        """Forget every playback of a recording, and how good its frames were."""
        self._scores.forget(lambda key: is_of(key[0].recording_id, recording_id))
        self._let_go([key for key in self._stages if is_of(key.recording_id, recording_id)])

    def attention(self, request: FrameRequest) -> Attention | None:
        """The attention of a request's frame, if it is still held."""
        return self._attention.find(request.key)

    def keep_attention(self, request: FrameRequest, attention: Attention) -> None:
        """Hold a frame's attention for the next request; the oldest go when their share of the budget is full."""
        self._attention.keep(request.key, attention, attention.nbytes)

    def _new_stage(self, request: FrameRequest) -> LoadedPlayback:
        from etnet.nets.runtime import contract_of
        from etnet.playback.playback import Playback

        recording = self.cleaned.of(self._library.open(request.recording_id), request.cleaning)
        windows = from_window(windows_of(recording, request.policy), request.cold_at)
        if not windows:
            raise WindowError(f"{recording.name}: holds no events, so there is nothing to reconstruct")
        model, trial = self.model(request.model_id, request.precision)
        expected = expected_step(trial, recording.sensor)
        check_step(expected, recording.sensor, self._longest_step)
        self._tune(model, request, recording)
        is_cut = isinstance(recording, CutRecording)
        first = _first_held(recording, windows)
        disk = None if is_cut else self._disk_for(request)
        playback = Playback(model, recording, windows, self._budget_bytes, disk, first=first)
        warm_up = self._library.model(request.model_id).warm_up or WARM_UP
        sparsest = sparsest_of(self._library.model(request.model_id).trained_band)
        return LoadedPlayback(
            playback, contract_of(model), warm_up, Pace(), expected, 0, sparsest, self._scores, self.whole
        )

    def _tune(self, model: Any, request: FrameRequest, recording: Recording) -> None:
        """Use the kernels measured for this size, where the network has made no frame yet (its contract would change).

        What is not measured is tried when nobody waits (`try_kernels`), for the next start.
        """
        is_in_use = any(key.network == request.playback.network for key in self._stages)
        if not self._tunes or is_in_use or not hasattr(model, "runtime") or not hasattr(model, "config"):
            return
        from etnet.nets.tuning import apply_kept

        size = recording.sensor.height, recording.sensor.width
        if not apply_kept(model, *size):
            self._untried = (model, *size)

    def try_kernels(self) -> None:
        """Measure what is not known yet, beside the engine, for two seconds at most."""
        if self._untried is not None:
            from etnet.nets.tuning import begin_trial

            untried, self._untried = self._untried, None
            begin_trial(*untried)

    @property
    def has_untried(self) -> bool:
        """Whether kernels are to be tried once nobody waits."""
        return self._untried is not None

    def _let_go(self, keys: Sequence[PlaybackKey]) -> None:
        for key in keys:
            self._stages.pop(key).put_away()
            self._attention.forget(lambda frame, of=key: frame[0] == of)
        if keys:
            self.version += 1
            self._divide()

    def _divide(self) -> None:
        share = int(self._budget_bytes * (1 - ATTENTION_SHARE)) // max(len(self._stages), 1)
        for loaded in self._stages.values():
            loaded.budget_bytes = share


def load_network(entry: ModelEntry, precision: str, device: str) -> Any:
    """The network of an entry, ready to run."""
    from etnet.nets.own import load_own
    from etnet.nets.weights import load_model

    if isinstance(entry.source, Path) and entry.source.suffix == ".py":
        network = load_own(entry.source)
        network.name = entry.title  # one name, in the list and in every inspector
        return network
    return load_model(entry.source, device, precision)  # pyright: ignore[reportArgumentType]  "fp32", "bf16", "auto"

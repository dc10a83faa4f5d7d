"""How good a run's frames are: one moment, a strip over time, or a protocol replayed from a cold start."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from jaxtyping import Float64, Int64

from app.engine.frame_scores import Values, frame_values, judges
from app.engine.playbacks import LoadedPlayback
from app.engine.requests import FrameRequest
from app.state.run import Rule
from etnet.windows import Window

if TYPE_CHECKING:
    from etnet.evaluation.match import Pair

MOST_WINDOWS = 600
"""A plan of so many windows is scored whole; of a longer one, the windows whose frames exist."""


@dataclass(frozen=True, slots=True)
class MomentScore:
    """A job: one frame's values, against a camera frame where `frame` names one."""

    request: FrameRequest
    rule: Rule
    frame: int | None

    def run(self, loaded: LoadedPlayback, cancelled: Callable[[], bool]) -> Iterator[tuple[Values, float]]:
        """One answer."""
        values, _ = frame_values(loaded, self.request, self.request.index, self.rule, self.frame, cancelled)
        yield values, 1.0


@dataclass(frozen=True, slots=True, eq=False)
class StripScores:
    """A run's values over time, as far as they are known, in the order of time.

    `frames`: the camera frames that they are held against (−1 without camera); `lags`: µs by which those are later
    than the window's end. `num_wanted`: how many there will be. `is_sparse`: the plan is too long to be scored whole.
    """

    indices: Int64[np.ndarray, " n"]
    stamps: Int64[np.ndarray, " n"]
    frames: Int64[np.ndarray, " n"]
    lags: Int64[np.ndarray, " n"]
    values: Mapping[str, Float64[np.ndarray, " n"]]
    num_wanted: int
    is_sparse: bool


@dataclass(frozen=True, slots=True)
class Strip:
    """A job: every window that ends near a camera frame (every window without a camera), one after the other.

    Those whose frames exist come first. `num_seen` tells one question about a long plan from the next: how many of
    its frames existed when it was asked; of a short plan all are made, and it is −1.
    """

    request: FrameRequest
    rule: Rule
    offset: int = 0
    num_seen: int = -1
    amount: int = 0
    """How much of the recording there is (`amount_of`): at least that is scored."""

    def run(self, loaded: LoadedPlayback, cancelled: Callable[[], bool]) -> Iterator[tuple[StripScores, float]]:
        """An answer a window."""
        playback = loaded.playback
        is_sparse = len(playback.windows) > MOST_WINDOWS
        pairs = _pairs(loaded, is_sparse, self.offset)
        order = sorted(pairs, key=lambda pair: (not playback.has_frame(pair.prediction), pair.prediction))
        found: dict[int, _Scored] = {}
        if not order:
            yield _strip(loaded, found, 0, is_sparse), 1.0
        for done, pair in enumerate(order, start=1):
            frame = pair.frame if pair.frame >= 0 else None
            window = playback.windows[pair.prediction]
            values, is_new = frame_values(loaded, self.request, pair.prediction, self.rule, frame, cancelled)
            found[pair.prediction] = _Scored(window, pair.frame, pair.lag, values)
            if is_new or done == len(order):  # what was known before takes no time and is no news by itself
                yield _strip(loaded, found, len(order), is_sparse), done / len(order)


@dataclass(frozen=True, slots=True, eq=False)
class _Scored:
    """One window of a strip."""

    window: Window
    frame: int
    lag: int
    values: Values


@dataclass(frozen=True, slots=True)
class ProtocolRun:
    """A job: what `etnet evaluate` does with this network and recording, to the last digit."""

    request: FrameRequest
    rule: Rule

    def run(self, loaded: LoadedPlayback, cancelled: Callable[[], bool]) -> Iterator[tuple[Any, float]]:
        """The scores so far, after every window that is fed."""
        from etnet.evaluation.evaluate import Evaluation
        from etnet.evaluation.protocol import PROTOCOLS

        playback = loaded.playback
        evaluation = Evaluation(playback.model, playback.recording, PROTOCOLS[self.rule], judges())
        for share in evaluation.run():
            yield evaluation.scores(), share


def _pairs(loaded: LoadedPlayback, is_sparse: bool, offset: int) -> list[Pair]:
    """Windows and camera frames that belong together; frame −1 where a recording has no camera."""
    from etnet.evaluation.match import Pair, pair_by_stamp

    playback, truth = loaded.playback, loaded.playback.recording.ground_truth
    held = [index for part in playback.cached().frames for index in part][:MOST_WINDOWS]
    indices = held if is_sparse else list(range(len(playback.windows)))
    if truth is None or len(truth) < 2:
        return [Pair(index, -1, 0) for index in indices]
    stamps = [playback.windows[index].t_stop for index in indices]
    nearest = int(np.median(np.diff(truth.stamps))) // 2
    return [
        pair._replace(prediction=indices[pair.prediction])
        for pair in pair_by_stamp(stamps, truth.stamps, nearest, offset)
    ]


def _strip(loaded: LoadedPlayback, found: Mapping[int, _Scored], num_wanted: int, is_sparse: bool) -> StripScores:
    ordered = [found[index] for index in sorted(found)]
    names = dict.fromkeys(name for each in ordered for name in each.values)
    columns = {name: np.array([each.values.get(name, np.nan) for each in ordered], np.float64) for name in names}
    num_events = np.array([each.window.num_events for each in ordered], np.float64)
    durations = np.array([max(each.window.t_stop - each.window.t_start, 1) for each in ordered], np.float64)
    columns["rate"] = num_events * 1e6 / durations
    columns["density"] = num_events / loaded.playback.recording.sensor.num_pixels
    return StripScores(
        np.array(sorted(found), np.int64),
        np.array([each.window.t_stop for each in ordered], np.int64),
        np.array([each.frame for each in ordered], np.int64),
        np.array([each.lag for each in ordered], np.int64),
        columns,
        num_wanted,
        is_sparse,
    )

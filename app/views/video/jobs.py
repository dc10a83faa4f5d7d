"""The reconstruction of a simulated video against the video's own frames, window by window."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64, Int64

from app.catalogue.videos import is_simulated
from app.engine.frame_scores import frame_values
from app.engine.jobs import Job
from app.engine.playbacks import LoadedPlayback
from app.engine.requests import FrameRequest
from app.html.moment import Moment
from app.state.view_state import ViewState
from app.views.page import RunFrame
from app.views.view import NumSeen

SLOT = "video.scores"
MOST_WINDOWS = 300
"""Windows that are scored, from the first on."""
STRIDE = 20
"""Windows by which the plan grows until the question is asked once more; known values are not computed again."""


@dataclass(frozen=True, slots=True, eq=False)
class FilmScores:
    """Values by measure, one for each window from the first on, and the stamps (µs) at which the windows end."""

    stamps: Int64[np.ndarray, " n"]
    values: Mapping[str, Float64[np.ndarray, " n"]]

    def at(self, index: int) -> dict[str, float]:
        """The values of one window; none where it is not scored yet."""
        return {name: float(column[index]) for name, column in self.values.items() if index < len(column)}


@dataclass(frozen=True, slots=True)
class ScoreFilm:
    """A job: the first `num_windows` windows of the original network's run."""

    request: FrameRequest
    num_windows: int

    def run(self, loaded: LoadedPlayback, cancelled: Callable[[], bool]) -> Iterator[tuple[FilmScores, float]]:
        """An answer a window that was not known."""
        playback, rows, stamps = loaded.playback, list[Mapping[str, float]](), list[int]()
        truth = playback.recording.ground_truth
        num_windows = min(self.num_windows, len(playback.windows))
        for index in range(num_windows):
            stamp = playback.windows[index].t_stop
            frame = None if truth is None else truth.nearest(stamp)
            values, is_new = frame_values(loaded, self.request, index, "paper", frame, cancelled)
            rows.append(values)
            stamps.append(stamp)
            if is_new or index == num_windows - 1:
                yield _columns(stamps, rows), (index + 1) / num_windows


def film_jobs(state: ViewState, moment: Moment, runs: Sequence[RunFrame], num_seen: NumSeen) -> Mapping[str, Job]:
    """Nothing of what is no video."""
    if not is_simulated(moment.recording):
        return {}
    request = FrameRequest(
        state.recording_id, state.model_id, state.precision, moment.policy, 0, cleaning=state.cleaning
    )
    num_windows = min(len(moment.windows), MOST_WINDOWS)
    is_whole = moment.recording.latest is None
    return {SLOT: ScoreFilm(request, num_windows if is_whole else max(num_windows // STRIDE * STRIDE, 1))}


def _columns(stamps: list[int], rows: list[Mapping[str, float]]) -> FilmScores:
    names = dict.fromkeys(name for row in rows for name in row)
    columns = {name: np.array([row.get(name, np.nan) for row in rows], np.float64) for name in names}
    return FilmScores(np.array(stamps, np.int64), columns)

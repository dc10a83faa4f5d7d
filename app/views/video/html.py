"""The sensor's settings, how far the video is simulated, and the scores of the reconstruction as a strip."""

from __future__ import annotations

import numpy as np

from app.catalogue.videos import BANDWIDTHS, SIDES, FilmSetting, VideoShown, film_id
from app.engine.jobs import JobResult
from app.html.controls import under_way
from app.html.elements import ON_PICK, bar, empty, panel, segmented
from app.html.moment import Moment
from app.html.uploads import public_handing_html
from app.views.page import Page
from app.views.video.jobs import SLOT, FilmScores, ScoreFilm
from app.views.video.state import Measure, VideoState

MEASURES: dict[Measure, str] = {"lpips": "LPIPS", "ssim": "SSIM", "mse": "MSE"}
_WIDTH, _HEIGHT = 1000, 120


def no_video_html(page: Page) -> str:
    """How a video gets here."""
    how = (
        "Drop a video anywhere on the page: two seconds of it are there at once, as an event camera would have seen "
        "them, then the whole."
    )
    if page.uploads is None:
        how = "Start the viewer with a video, or put one into its --data folder; it is listed under Recording."
        return panel("no-video", empty("No video is open", how))
    return panel("no-video", empty("No video is open", how), public_handing_html(page.uploads))


def choices_html(recording_id: str, setting: FilmSetting) -> str:
    """Bandwidth and size: each button names the film that it asks for."""
    bandwidths = {
        _key(recording_id, FilmSetting(setting.contrast, setting.noise, offered, setting.side)): (
            f"{offered}" if offered else "no limit"
        )
        for offered in BANDWIDTHS
    }
    sides = {
        _key(recording_id, FilmSetting(setting.contrast, setting.noise, setting.bandwidth, offered)): f"{offered}"
        for offered in SIDES
    }
    chosen = _key(recording_id, setting)
    rows = (
        ("Bandwidth, Hz", segmented("Bandwidth of a white pixel, Hz", bandwidths, chosen)),
        ("Size, pixels", segmented("Pixels of the longer side", sides, chosen)),
    )
    listed = "".join(f'<div class="etv-row"><label>{label}</label>{content}</div>' for label, content in rows)
    return f'<div class="et etv-settings" data-testid="film-choices">{listed}</div>'


def film_html(film: VideoShown) -> str:
    """One line, and a bar while it is being made."""
    if film.is_over:
        return panel("film", f'<div class="et-note">{_work(film)}, all of its {film.total:.1f} s are there.</div>')
    if film.work is None:
        return panel("film", '<div class="et-lag"><span>The simulation begins.</span></div>')
    behind = max(film.total - film.done, 0.0)
    share = min(film.done / film.total, 1.0) if film.total else 0.0
    said = (
        f"{film.done:.1f} of {film.total:.1f} s of the video are there. {_work(film)}: "
        f"the last {behind:.1f} s take about {behind * film.work:.0f} s more."
    )
    return panel("film", f'<div class="et-lag"><span>{said}</span>{bar(share)}</div>')


def strip_html(page: Page) -> str:
    """The scores of this window, and one of them over time; a click goes there."""
    moment, result = page.moment, page.results.get(SLOT)
    if moment is None or result is None or not _is_of(result, moment):
        return ""
    scores: FilmScores | None = result.value
    if scores is None or "lpips" not in scores.values or not np.isfinite(scores.values["lpips"]).any():
        why = "Its pictures are too small to be scored." if scores is not None else result.trouble
        return panel("film-scores", empty("No scores", why) if why else under_way(0.0, "scoring against the video"))
    measure = page.state.of(VideoState).measure
    here = scores.at(moment.index)
    options = {
        f"set:video.measure:{name}": f"{words} {here[name]:.3f}" if name in here else words
        for name, words in MEASURES.items()
    }
    heading = segmented("Score over time", options, f"set:video.measure:{measure}")
    going = "" if result.is_whole else under_way(result.share, "scoring")
    column = scores.values[measure]
    num_known = int(np.isfinite(column).sum())
    mean = (
        f"Reconstruction against the video: mean {np.nanmean(column):.3f} over {num_known} "
        f"window{'s' * (num_known != 1)}, {'higher' if measure == 'ssim' else 'lower'} is better."
    )
    return panel("film-scores", heading, _curve(moment, scores, column), f'<div class="et-note">{mean}</div>', going)


def _curve(moment: Moment, scores: FilmScores, column: np.ndarray) -> str:
    span, top = moment.recording.span, max(float(np.nanmax(column)) * 1.08, 1e-6)
    is_known = np.isfinite(column)
    xs = (scores.stamps[is_known] - span.start) / max(span.duration, 1) * _WIDTH
    ys = _HEIGHT * (1 - column[is_known] / top)
    path = " ".join(f"{'L' if i else 'M'}{x:.1f} {y:.1f}" for i, (x, y) in enumerate(zip(xs, ys, strict=True)))
    path += "h4" * (len(xs) == 1)  # one point alone would not be seen
    at = min(max((moment.window.t_stop - span.start) / max(span.duration, 1), 0), 1)
    return (
        f'<div class="et-chart et-pick" data-k="span:0,{span.duration / 1e6:.6f}" {ON_PICK} data-testid="film-strip">'
        f'<svg viewBox="0 0 {_WIDTH} {_HEIGHT}" preserveAspectRatio="none" aria-hidden="true"><path d="{path}"'
        ' fill="none" stroke="#ffffff" stroke-width="2" vector-effect="non-scaling-stroke"/></svg>'
        f'<span class="et-chart-high">{top:.3f}</span><span class="et-chart-low">0</span>'
        f'<i class="et-head-line" style="left:{at:.3%}"></i></div>'
    )


def _is_of(result: JobResult, moment: Moment) -> bool:
    job = result.job
    return isinstance(job, ScoreFilm) and (job.request.recording_id, job.request.policy) == (
        moment.recording_id,
        moment.policy,
    )


def _key(recording_id: str, setting: FilmSetting) -> str:
    return f"reopen:{film_id(recording_id, setting)}"


def _work(film: VideoShown) -> str:
    if film.work is None:
        return "Simulated"
    return f"A second of video takes {film.work:.1f} s of work here"

"""Runs beside each other: as they are, one wiped over another, their difference, their error against the camera."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import isfinite

import numpy as np
from jaxtyping import Float32, UInt8

from app.html.elements import ON_PICK, empty, escape, legend, marker, panel, picture
from app.html.moment import PICTURES, Moment
from app.html.pictures import lag_line, reconstruction_image
from app.html.provenance import density_html
from app.html.tones import Tones
from app.html.units import milliseconds, seconds, short
from app.views.compare.html.run import SAME_TIME, RunShown, Truth, truth_frame
from app.views.compare.state import MOST_RUNS, CompareState
from etnet.render.colours import css_gradient, diverge, diverging
from etnet.render.encode import data_url
from etnet.render.tone import tone_map

TITLES = {"mse": "MSE ↓", "ssim": "SSIM ↑", "lpips": "LPIPS ↓", "sharpness": "sharpness", "contrast": "contrast"}
"""Measures in the order of a card. An arrow says which way is better; the last two have no better."""
RULES = {
    "paper": "ET-Net’s protocol: the raw frame, not clipped; SSIM 7×7 uniform, data range 2",
    "evreal": "EVREAL’s protocol: post-processed where the network asks for it, clipped to 0 … 1; SSIM Gaussian 11×11",
}
ERROR_LIMIT = 0.5
"""Difference at the end of the colours: one scale for all runs and moments, so that they can be compared."""

Box = tuple[int, int, int, int]
"""x, y, width, height of what is shown, pixels of the sensor."""


def runs_html(
    moment: Moment,
    runs: Sequence[RunShown],
    view: CompareState,
    query: tuple[int, int] | None = None,
) -> str:
    """All of the comparison at one moment. Clicks send `cut:x,y,w,h` on a picture, `run:n`, `run:add` and so on."""
    if not runs:
        return ""
    other = runs[min(view.chosen + 1, len(runs) - 1)]
    draw = _Draw(moment, box_of(moment, view.zoom, query), query, _best(runs))
    if view.sight in ("wipe", "difference") and len(runs) > 1:
        picture_ = draw.wipe(runs[0], other, view.wipe) if view.sight == "wipe" else draw.difference(runs[0], other)
        cards = [draw.card(run, other, None) for run in runs]
        body = f'{picture_}<div class="et-runs">{"".join(cards)}</div>'
    else:
        shows = draw.error if view.sight == "error" else draw.frame
        cards = [draw.card(run, other, shows) for run in runs]
        body = f'<div class="et-runs">{"".join(cards)}{draw.camera(runs[0])}</div>'
    more = ""
    if len(runs) <= MOST_RUNS:
        more = f'<button class="et-back" data-k="compare:add" {ON_PICK}>Add a run</button>'
    scale = _scale(view, len(runs)) if view.sight in ("difference", "error") else ""
    lock = f"all at {seconds(moment.seconds[1])} of the recording, each by its window that ends nearest"
    return panel(
        "runs",
        f'<div class="et-note">{lock}</div>',
        body,
        more,
        scale,
        _read_out(moment, runs, query),
        f'<div class="et-note">{_rule_words(moment, view)}</div>',
    )


def box_of(moment: Moment, zoom: int, query: tuple[int, int] | None) -> Box:
    """What a zoom shows: around the chosen pixel, else around the middle; never beyond the sensor."""
    sensor = moment.recording.sensor
    width, height = max(sensor.width // zoom, 1), max(sensor.height // zoom, 1)
    x, y = query or (sensor.width // 2, sensor.height // 2)
    left = min(max(x - width // 2, 0), sensor.width - width)
    return left, min(max(y - height // 2, 0), sensor.height - height), width, height


class _Draw:
    """Pictures of one moment, all cut to one box."""

    def __init__(self, moment: Moment, box: Box, query: tuple[int, int] | None, best: set[tuple[str, int]]) -> None:
        self._best = best
        self._moment = moment
        self._box = box
        self._query = query

    def card(self, run: RunShown, chosen: RunShown, shows: Callable[[RunShown], str] | None) -> str:
        """One run: its name, its picture (by `shows`), what it was given, its numbers."""
        mark = " et-chosen-run" if run is chosen and run.number else ""
        image = "" if shows is None else shows(run)
        lag = "" if run.request is None else lag_line(run.ready, run.request.index, run.working, run.failed)
        trouble = f'<div class="et-failed" role="alert">{escape(run.trouble)}</div>' if run.trouble else ""
        facts = "" if run.request is None else f"{_given(self._moment, run)}{_numbers(run, self._best)}"
        return (
            f'<div class="et-run{mark}" data-testid="run-{run.name}">{self._head(run)}{image}{trouble}{lag}'
            f"{facts}</div>"
        )

    def frame(self, run: RunShown) -> str:
        """A run's reconstruction, as it is displayed."""
        ready = run.ready
        if ready is None:
            return empty("No image yet", "It is computed as soon as nobody waits for another frame.")
        url = self._url(("run", ready.key, run.tones), lambda: reconstruction_image(ready, run.tones), True)
        return self._picture(url, f"Run {run.name}: window {ready.request.index}", not run.is_there)

    def error(self, run: RunShown) -> str:
        """A run's raw frame minus the camera's."""
        ready, truth = run.ready, truth_frame(self._moment, run.truth)
        if truth is None:
            return empty("No camera frame", "No ground truth of the sensor’s size.")
        if ready is None or run.truth is None:
            return self.frame(run)
        key = ("error", ready.key, self._moment.recording_id, run.truth.index)
        url = self._url(key, lambda: diverge(ready.frame - truth, ERROR_LIMIT), False)
        return self._picture(url, f"Run {run.name} minus camera", not run.is_there)

    def camera(self, main: RunShown) -> str:
        """The ground truth as a card of its own, with how far from the window's end it was taken."""
        truth = truth_frame(self._moment, main.truth)
        head = '<div class="et-run-head"><span><b class="et-tag">camera</b>ground truth</span></div>'
        if truth is None or main.truth is None:
            body = empty("No ground truth", "Sharpness and contrast are shown instead: they need none.")
            return f'<div class="et-run" data-testid="run-camera">{head}{body}</div>'
        key = ("camera", self._moment.recording_id, main.truth.index, main.tones)
        url = self._url(key, lambda: _toned(truth, main.tones), True)
        when = f'<div class="et-note">{_apart(main.truth)}</div>'
        return f'<div class="et-run" data-testid="run-camera">{head}{self._picture(url, "Camera frame")}{when}</div>'

    def wipe(self, main: RunShown, other: RunShown, share: float) -> str:
        """The main run left of a line, another right of it."""
        below, above = self.frame(main), self.frame(other)
        words = f"left: {main.name} · right: {other.name}"
        return (
            f'<div class="et-wipe" data-testid="wipe" style="--wipe:{share:.1%}">{above}<div>{below}</div><i></i></div>'
            f'<div class="et-note">{words}</div>'
        )

    def difference(self, main: RunShown, other: RunShown) -> str:
        """Another run's raw frame minus the main one's."""
        one, two = main.ready, other.ready
        if one is None or two is None or one.frame.shape != two.frame.shape:
            return empty("No difference yet", "Both runs need an image first.")
        url = self._url(("difference", one.key, two.key), lambda: diverge(two.frame - one.frame, ERROR_LIMIT), False)
        is_old = not (main.is_there and other.is_there)
        apart = np.abs(two.frame - one.frame)
        mean, largest = short(float(apart.mean())), short(float(apart.max()))
        said = f"{other.name} − {main.name}: mean |difference| {mean}, largest {largest}"
        if not apart.any():
            said = f"{other.name} and {main.name} are the same, bit for bit"
        return (
            f'<div class="et-large">{self._picture(url, f"Run {other.name} minus run {main.name}", is_old)}</div>'
            f'<div class="et-caption"><span data-testid="difference">{escape(said)}</span></div>'
        )

    def _head(self, run: RunShown) -> str:
        tag = f'<b class="et-tag" style="--hue:{run.colour}">{run.name}</b>'
        what = f"{tag}{escape(run.words)}"
        if not run.number:
            return f'<div class="et-run-head"><span>{what}</span></div>'
        return (
            f'<div class="et-run-head"><button data-k="compare:choose:{run.number - 1}" {ON_PICK}>{what}</button>'
            f'<button data-k="compare:remove:{run.number - 1}" {ON_PICK} title="Remove this run">×</button></div>'
        )

    def _url(self, key: tuple[object, ...], make: Callable[[], np.ndarray], is_photograph: bool) -> str:
        def encoded() -> str:
            x, y, width, height = self._box
            return data_url(np.ascontiguousarray(make()[y : y + height, x : x + width]), is_lossless=not is_photograph)

        return PICTURES.text((*key, self._box), encoded)

    def _picture(self, url: str, alt: str, is_old: bool = False) -> str:
        x, y, width, height = self._box
        marks = []
        if self._query is not None:
            across, down = (self._query[0] + 0.5 - x) / width, (self._query[1] + 0.5 - y) / height
            marks = [marker(across, down)] if 0 <= across <= 1 and 0 <= down <= 1 else []
        image = picture(
            url,
            alt,
            key=f"cut:{x},{y},{width},{height}",
            marks=marks,
            size=(width, height),
            classes="et-sharp" if width < 200 else "",
        )
        return f'<div class="{"et-lags" if is_old else ""}">{image}</div>'


def _toned(frame: Float32[np.ndarray, "h w"], tones: Tones) -> UInt8[np.ndarray, "h w"]:
    return tone_map(frame, tones.tone, tones.is_linear_light)


def _given(moment: Moment, run: RunShown) -> str:
    """Events per pixel against the trained band, and whether the memory is warm."""
    assert run.request is not None
    dense = run.events_per_pixel(moment.recording.sensor.num_pixels) or 0.0
    left = run.warm_up_seconds
    since = "" if run.run.cold_from is None else f" · cold start at {_when(moment, run.run.cold_from)}"
    memory = f"warm{since}"
    if left:
        memory = f"warm-up: {f'{seconds(left)} to go' if isfinite(left) else 'not warm in this recording'}{since}"
    return (
        f'<div class="et-note">{density_html(dense, run.trained_band)} events per pixel</div>'
        f'<div class="et-note">window {run.request.index} of 0 – {run.num_windows - 1} · {escape(memory)}</div>'
    )


def _when(moment: Moment, stamp: int) -> str:
    return seconds((stamp - moment.recording.span.start) / 1e6)


def _best(runs: Sequence[RunShown]) -> set[tuple[str, int]]:
    """(measure, run) of the best value there is, once every run has one; none where all are the same."""
    best: set[tuple[str, int]] = set()
    for name, choose in (("mse", min), ("ssim", max), ("lpips", min)):
        values = [run.values[name] for run in runs if run.values is not None and name in run.values]
        if len(values) == len(runs) and len(set(values)) > 1:
            best |= {(name, run.number) for run in runs if run.values and run.values[name] == choose(values)}
    return best


def _numbers(run: RunShown, best: set[tuple[str, int]]) -> str:
    if run.values is None:
        return '<div class="et-note" data-testid="measuring">measuring …</div>' if run.ready is not None else ""
    values = [(name, run.values[name]) for name in TITLES if name in run.values]
    if "mse" in run.values:
        values = values[:3]
    marks = {name: ' class="et-exact" title="best of these runs"' for name, number in best if number == run.number}
    cells = "".join(
        f"<div><dt>{TITLES[name]}</dt><dd{marks.get(name, '')}>{decimals(value)}</dd></div>" for name, value in values
    )
    late = ""
    if run.truth is not None and abs(run.truth.lag) > SAME_TIME:
        late = f'<div class="et-note et-warning">{_apart(run.truth)}: motion between counts as error</div>'
    return f'<dl class="et-figures" data-testid="figures-{run.name}">{cells}</dl>{late}'


def decimals(value: float) -> str:
    """As the tables print it: .0190, .642."""
    if not np.isfinite(value):
        return "n/a"
    return f"{value:.4f}" if abs(value) < 0.1 else f"{value:.3f}"


def _apart(truth: Truth) -> str:
    if abs(truth.lag) < 50:
        return "camera frame taken as the window ends"
    side = "after" if truth.lag > 0 else "before"
    return f"camera frame {milliseconds(abs(truth.lag) / 1000)} {side} the window ends"


def _scale(view: CompareState, num_runs: int) -> str:
    if view.sight == "difference" and num_runs < 2:
        return ""
    what = "reconstruction minus camera" if view.sight == "error" else "difference of the raw frames"
    ticks = [(0.0, f"≤ −{ERROR_LIMIT}: too dark"), (0.5, "0"), (1.0, f"≥ +{ERROR_LIMIT}: too bright")]
    if view.sight == "difference":
        ticks = [(0.0, f"≤ −{ERROR_LIMIT}"), (0.5, "0"), (1.0, f"≥ +{ERROR_LIMIT}")]
    return legend(f"{what}, one scale for all", css_gradient(diverging()), ticks)


def _read_out(moment: Moment, runs: Sequence[RunShown], query: tuple[int, int] | None) -> str:
    """The raw value of every run and of the camera at the chosen pixel."""
    if query is None:
        return '<div class="et-note">Click a picture: every run’s value at that pixel is read out here.</div>'
    x, y = query
    cells = []
    for run in runs:
        if run.ready is not None and y < run.ready.frame.shape[0] and x < run.ready.frame.shape[1]:
            cells.append((run.name, float(run.ready.frame[y, x])))
    truth = truth_frame(moment, runs[0].truth)
    if truth is not None:
        cells.append(("camera", float(truth[y, x])))
    rows = "".join(
        f'<div><dt>{name}</dt><dd data-testid="value-{name}" data-value="{value:.9g}">{value:.3f}</dd></div>'
        for name, value in cells
    )
    return f'<div class="et-note">raw values at pixel ({x}, {y})</div><dl class="et-figures">{rows}</dl>'


def _rule_words(moment: Moment, view: CompareState) -> str:
    truth = moment.recording.ground_truth
    if truth is None or len(truth) == 0:
        return "This recording has no camera frames: sharpness and contrast need none, and noise raises both."
    shifted = f" · frames’ clock shifted by {view.offset / 1000:+.1f} ms" if view.offset else ""
    return f"{RULES[view.rule]}. The brightness setting is for the eye alone{shifted}."


def no_runs_html() -> str:
    """Before a recording is open."""
    return panel("runs", empty("Nothing to compare yet", "Open a recording first."))

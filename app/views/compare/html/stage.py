"""The pictures of all runs at one moment, and the camera's: as they are, swiped, their difference, their error."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from jaxtyping import Float32

from app.engine.requests import Ready
from app.html.elements import chip, empty, escape, marker, picture
from app.html.moment import PICTURES, Moment
from app.html.pictures import cold_start_chip, grey_reads, lag_line, ramp_reads, reconstruction_image, swiped
from app.html.units import milliseconds, short
from app.views.compare.html.heads import section
from app.views.compare.html.run import SAME_TIME, RunShown, Truth, truth_frame
from app.views.compare.html.series import ARROWS, BETTER_HIGH, TITLES, decimals
from app.views.compare.state import NAMES, CompareState, Measure
from etnet.render.colours import css_gradient, diverge, diverging
from etnet.render.encode import data_url
from etnet.render.tone import tone_map

ERROR_LIMIT = 0.5
"""Difference at the end of the colours: one scale for all runs and moments, so that they can be compared."""


def pictures_html(
    moment: Moment, runs: Sequence[RunShown], view: CompareState, query: tuple[int, int] | None = None
) -> str:
    """One card a run, and the camera's as the last."""
    if not runs:
        return ""
    draw = _Draw(moment, runs, view, query)
    cards = "".join(draw.card(run) for run in runs)
    return cards + draw.camera_card()


class _Draw:
    """Pictures of one moment; each has its place on the stage."""

    def __init__(
        self, moment: Moment, runs: Sequence[RunShown], view: CompareState, query: tuple[int, int] | None
    ) -> None:
        self._moment = moment
        self._runs = runs
        self._view = view
        self._query = query
        self._main = runs[0]

    def card(self, run: RunShown) -> str:
        """A run's picture with what may be claimed of it and its number; or why there is none."""
        lag = "" if run.request is None else lag_line(run.ready, run.request.index, run.working, run.failed)
        trouble = f'<div class="et-failed" role="alert">{escape(run.trouble)}</div>' if run.trouble else ""
        body = f'<div class="etv-body">{self._picture_of(run)}{lag}{trouble}{self._chips(run)}</div>'
        return section(f"compare.{run.name}", run.number, len(self._runs) + 1, body, "etv-under", f"run-{run.name}")

    def camera_card(self) -> str:
        """The camera's frame, or a run's error against it, with how far from the window's end it was taken."""
        main, num = self._main, len(self._runs) + 1
        truth = truth_frame(self._moment, main.truth)
        if truth is None or main.truth is None:
            body = empty("No ground truth", "This recording has no camera frames of the sensor’s size.")
        elif self._view.camera != "frame":
            run = self._runs[min(NAMES.index(self._view.camera), len(self._runs) - 1)]
            body = self._error(run) + self._scaled(f"{run.name} − camera")
        elif self._view.sight == "difference":
            body = self._error(main) + self._scaled(f"{main.name} − camera")
        else:
            body = self._frame_of_camera(truth)
            body = self._swiped(body, "camera") if self._view.sight == "swipe" else body
            body += f'<div class="et-chips"><span class="et-note">{_apart(main.truth)}</span></div>'
        return section("compare.camera", num - 1, num, f'<div class="etv-body">{body}</div>', "etv-under", "run-camera")

    def _picture_of(self, run: RunShown) -> str:
        match self._view.sight:
            case "error":
                return self._error(run)
            case "difference" if run.number:
                return self._difference(run)
            case "swipe" if run.number:
                return self._swiped(self._frame(run), run.name)
        return self._frame(run)

    def _frame(self, run: RunShown) -> str:
        """A run's reconstruction, as it is displayed."""
        ready = run.ready
        if ready is None:
            return (
                ""
                if run.trouble
                else empty("No image yet", "It is computed as soon as nobody waits for another frame.")
            )
        key = ("run", ready.key, run.tones)
        url = PICTURES.text(key, lambda: data_url(reconstruction_image(ready, run.tones), is_lossless=False))
        return self._picture(
            url, f"Run {run.name}: window {ready.request.index}", grey_reads(run.tones), not run.is_there
        )

    def _frame_of_camera(self, truth: Float32[np.ndarray, "h w"]) -> str:
        main = self._main
        assert main.truth is not None
        key = ("camera", self._moment.recording_id, main.truth.stamp, main.tones)

        def encoded() -> str:
            return data_url(tone_map(truth, main.tones.tone, main.tones.is_linear_light), is_lossless=False)

        return self._picture(PICTURES.text(key, encoded), "Camera frame", grey_reads(main.tones))

    def _error(self, run: RunShown) -> str:
        """A run's raw frame minus the camera's."""
        ready, truth = run.ready, truth_frame(self._moment, run.truth)
        if truth is None or run.truth is None:
            return empty("No error", "There is no ground truth of the sensor’s size.")
        if ready is None or ready.frame.shape != truth.shape:
            return self._frame(run)
        key = ("error", ready.key, self._moment.recording_id, run.truth.stamp)
        return self._signed(key, lambda: ready.frame - truth, f"Run {run.name} minus camera", not run.is_there)

    def _difference(self, run: RunShown) -> str:
        """A run's raw frame minus the main one's."""
        one, two = self._main.ready, run.ready
        if one is None or two is None or one.frame.shape != two.frame.shape:
            return empty("No difference yet", "Both runs need an image first.")
        is_old = not (self._main.is_there and run.is_there)
        alt = f"Run {run.name} minus run {self._main.name}"
        return self._signed(("difference", one.key, two.key), lambda: two.frame - one.frame, alt, is_old)

    def _signed(self, key: object, make: Callable[[], Float32[np.ndarray, "h w"]], alt: str, is_old: bool) -> str:
        url = PICTURES.text(("signed", key), lambda: data_url(diverge(make(), ERROR_LIMIT), is_lossless=True))
        return self._picture(url, alt, ramp_reads(diverging(), -ERROR_LIMIT, ERROR_LIMIT), is_old)

    def _swiped(self, above: str, name: str) -> str:
        """The main run left of a line that a drag moves, another picture right of it."""
        sensor = self._moment.recording.sensor
        names = self._main.name, name
        return swiped(self._frame(self._main), above, names, sensor.width / sensor.height)

    def _picture(self, url: str, alt: str, reads: str, is_old: bool = False) -> str:
        sensor = self._moment.recording.sensor
        marks = []
        if self._query is not None:
            marks = [marker((self._query[0] + 0.5) / sensor.width, (self._query[1] + 0.5) / sensor.height)]
        image = picture(url, alt, key="pixel", marks=marks, size=(sensor.width, sensor.height), reads=reads)
        return f'<div class="et-shown{" et-lags" if is_old else ""}">{image}</div>'

    def _chips(self, run: RunShown) -> str:
        if run.ready is None or run.request is None:
            return ""
        sight = self._view.sight
        if sight == "error" and run.truth is not None:
            return self._scaled(f"{run.name} − camera", run)
        if sight == "difference" and run.number:
            return self._scaled(f"{run.name} − {self._main.name}", run)
        return f'<div class="et-chips">{_claim(run.ready)}{_late(run)}{self._value(run)}</div>'

    def _scaled(self, what: str, run: RunShown | None = None) -> str:
        """The colour bar of a difference, with what it comes to."""
        apart = "" if run is None or not run.number or self._view.sight != "difference" else self._apart_from_main(run)
        bar = (
            f'<span class="et-scale" data-testid="scale">{escape(what)}<b>−{ERROR_LIMIT}</b>'
            f'<i style="background:{css_gradient(diverging())}"></i><b>+{ERROR_LIMIT}</b></span>'
        )
        return f'<div class="et-chips">{bar}{apart}</div>'

    def _apart_from_main(self, run: RunShown) -> str:
        one, two = self._main.ready, run.ready
        if one is None or two is None or one.frame.shape != two.frame.shape:
            return ""
        apart = np.abs(two.frame - one.frame)
        said = f"mean |difference| {short(float(apart.mean()))}, largest {short(float(apart.max()))}"
        if not apart.any():
            said = "the same, bit for bit"
        return f'<span class="et-note" data-testid="difference">{said}</span>'

    def _value(self, run: RunShown) -> str:
        """The chosen measure of this frame; green where it is the best of all runs."""
        name = _measured(run, self._view.measure)
        if name is None or run.values is None:
            return ""
        best = " et-best" if _is_best(self._runs, run, name) else ""
        return (
            f'<span class="et-note{best}" data-testid="value-of-{run.name}" data-value="{run.values[name]!r}">'
            f"{TITLES[name]} {decimals(run.values[name])}</span>"
        )


def _measured(run: RunShown, wanted: Measure) -> Measure | None:
    """The measure that is shown of a frame: the chosen one, else one that it has."""
    values = run.values or {}
    order: tuple[Measure, ...] = (wanted, "lpips", "sharpness")
    return next((name for name in order if name in values), None)


def _is_best(runs: Sequence[RunShown], run: RunShown, name: Measure) -> bool:
    """Once every run has the value, and not all have the same."""
    values = [each.values[name] for each in runs if each.values is not None and name in each.values]
    if name not in ARROWS or len(values) < max(len(runs), 2) or len(set(values)) == 1 or run.values is None:
        return False
    return run.values[name] == (max(values) if name in BETTER_HIGH else min(values))


def _claim(ready: Ready) -> str:
    """What kind of frame it is."""
    if ready.is_exact and not ready.is_cold:
        return chip("exact", "exact", "Equal, bit for bit, to running every window of this run from its first one on")
    if ready.is_approximate:
        return chip("approximate", "warning", f"From a cold start {ready.num_warm} windows earlier; exact follows")
    if not ready.request.is_original:
        return chip("changed", "warning", "A part of the network or its events is changed")
    if ready.began_at:
        return cold_start_chip(ready)
    if ready.is_cold:
        return chip("warm-up", "plain", "Near its first window the network has seen too little to be sure")
    return chip("not the plain run", "warning", "Something inside the network or its runtime was changed")


def _late(run: RunShown) -> str:
    if run.truth is None or abs(run.truth.lag) <= SAME_TIME:
        return ""
    apart = milliseconds(abs(run.truth.lag) / 1000)
    return chip(f"{apart} from its camera frame", "warning", f"{_apart(run.truth)}: motion between counts as error")


def _apart(truth: Truth) -> str:
    if abs(truth.lag) < 50:
        return "frame at window end"
    side = "after" if truth.lag > 0 else "before"
    return f"{milliseconds(abs(truth.lag) / 1000)} {side} window end"

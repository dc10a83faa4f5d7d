"""What kind of recording this is, against what the weights were trained on; its hot pixels."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from app.html.elements import ON_PICK, bar, empty, escape, panel
from app.html.moment import ARRAYS, Moment
from app.html.provenance import ModelFacts
from app.html.timeline_marks import curve_of, plan_of
from app.html.units import count, milliseconds, short
from app.views.recording.html.examination import part

if TYPE_CHECKING:
    from app.engine.jobs import JobResult
    from etnet.events.fitness import Fitness

_TITLE = "Sensor statistics vs training range"
MOST_HOT = 12
LITTLE_GAIN = 0.05
"""A lag that raises the correlation by less is not worth a correction."""
Row = tuple[str, str, float | None, str, str]
"""What, the value in words, as a number, the card's key for its range, what it means."""


def fitness_html(moment: Moment, result: JobResult | None, model: ModelFacts, offset: int = 0) -> str:
    """One row a property: measured, trained range, verdict. A click on a hot pixel goes to it.

    `offset` is what comparisons add to the camera frames' stamps, µs.
    """
    if result is None or result.value is None:
        if result is not None and result.trouble:
            return part("fitness", _TITLE, empty("Cannot be measured", result.trouble))
        return part("fitness", _TITLE, empty("Measuring", "It is measured while nobody waits for a frame."))
    found: Fitness = result.value
    rows = "".join(_row(row, model) for row in _rows(moment, found)) + _lag_row(found, offset)
    busy = "" if result.is_whole else bar(result.share)
    head = "<tr><th>property</th><th>measured</th><th>trained on</th></tr>"
    title = f'<div class="et-note">Is this what “{escape(model.title)}” was trained for?</div>'
    hot = _hot(found) if result.share >= 0.8 else ""
    lean = '<div class="et-note">Ranges are those on the weights’ card; where it gives none, nothing is guessed.</div>'
    lean += f'<button class="et-button" data-k="tab:filter" {ON_PICK}>Why is it bad here?</button>'
    return part("fitness", _TITLE, f'{title}{busy}<table class="et-fit">{head}{rows}</table>{lean}') + hot


def _rows(moment: Moment, found: Fitness) -> list[Row]:
    rows: list[Row] = []
    density = _density(moment)
    words = "in the middle window of a sample over the recording"
    rows.append(("events per pixel", short(density), density, "events_per_pixel", words))
    activity = found.activity
    if activity is not None:
        on = activity.on_share
        ratio = on / max(1 - on, 1e-9)
        of = f"ON to OFF, of {count(activity.num_looked_at)} events looked at"
        rows.append(("ON : OFF", f"{ratio:.2f}", ratio, "on_off_ratio", of))
        noise = f"{short(activity.noise_rate)} Hz/px"
        meaning = "events nothing near supports within 20 ms: an upper bound"
        rows.append(("noise rate", noise, activity.noise_rate, "noise_rate", meaning))
        if activity.refractory is not None:
            wait = milliseconds(activity.refractory / 1000)
            rows.append(("refractory period", wait, activity.refractory, "refractory_us", "1 wait in 1,000 is shorter"))
    return [*rows, *_against_frames(moment, found)]


def _against_frames(moment: Moment, found: Fitness) -> list[Row]:
    if moment.recording.ground_truth is None:
        why = "needs camera frames, which this recording has not"
        return [("contrast threshold", "–", None, "contrast_threshold", why)]
    rows: list[Row] = []
    if found.thresholds is not None:
        both = f"{found.thresholds.on:.2f} / {found.thresholds.off:.2f}"
        mean = (found.thresholds.on + found.thresholds.off) / 2
        why = f"ON / OFF, log brightness; explains {found.thresholds.explained:.0%} of the frames’ change"
        rows.append(("contrast threshold", both, mean, "contrast_threshold", why))
    return rows


def _lag_row(found: Fitness, offset: int) -> str:
    """How far the frames' clock is off, with a button that corrects it in every comparison."""
    lag = found.lag
    if lag is None:
        return ""
    said = f"correlation {lag.correlation_unshifted:.2f} as stamped, {lag.correlation:.2f} shifted"
    if lag.correlation - lag.correlation_unshifted < LITTLE_GAIN:
        choice = "not worth a correction"
    elif lag.shift == offset:
        choice = '<b class="et-exact">in use</b>'
    else:
        choice = (
            f'<button class="et-button et-strong" data-k="set:compare.offset:{lag.shift}" {ON_PICK}>'
            "Use this offset</button>"
        )
    return (
        f'<tr data-testid="fit-frame–event offset"><td>frame–event offset<div class="et-note">{said}</div></td>'
        f"<td>{lag.shift / 1000:+.0f} ms</td><td>{choice}</td></tr>"
    )


def _row(row: Row, model: ModelFacts) -> str:
    what, words, value, key, meaning = row
    band = model.card.get(key) if key else None
    trained, verdict = ("not on card" if key else "–"), ""
    if isinstance(band, list) and len(band) == 2 and value is not None:
        trained = f"{short(float(band[0]))} to {short(float(band[1]))}"
        inside = band[0] <= value <= band[1]
        verdict = '<b class="et-exact">inside</b>' if inside else '<b class="et-warning">outside</b>'
    return (
        f'<tr data-testid="fit-{what}"><td>{what}<div class="et-note">{escape(meaning)}</div></td>'
        f"<td>{words}</td><td>{trained} {verdict}</td></tr>"
    )


def _density(moment: Moment) -> float:
    """The median of events per pixel over a sample of windows."""

    def make() -> float:
        indices = curve_of(moment).indices[:: max(1, len(curve_of(moment).indices) // 60)]
        counts = [moment.windows[int(index)].num_events for index in indices]
        return float(np.median(counts)) / moment.recording.sensor.num_pixels

    return ARRAYS.get(("median density", *plan_of(moment)), make)


def _hot(found: Fitness) -> str:
    cleaned = f'<button class="et-button" data-k="compare:cleaned" {ON_PICK}>Compare with a filtered run</button>'
    if not found.hot:
        said = '<div class="et-note">None fires 10 times more than all its neighbours.</div>'
        return part("hot", "Hot pixels", said + cleaned)
    listed = "".join(
        f'<button class="et-button" data-k="at:{pixel.x},{pixel.y}" {ON_PICK}>({pixel.x}, {pixel.y}) · '
        f"{count(pixel.num_events)}</button>"
        for pixel in found.hot[:MOST_HOT]
    )
    more = f", the worst {MOST_HOT} of them" if len(found.hot) > MOST_HOT else ""
    note = f'<div class="et-note">{count(len(found.hot))}{more}, with their events; a click goes there.</div>'
    return part("hot", "Hot pixels", f'{note}<div class="et-chips" data-testid="hot">{listed}</div>{cleaned}')


def fitness_button_html() -> str:
    """The way to the sensor statistics while they are not computed."""
    button = f'<button class="et-button" data-k="set:recording.fits:True" {ON_PICK}>Sensor statistics</button>'
    note = '<div class="et-note">Sensor statistics vs training range: noise, contrast, hot pixels, density.</div>'
    return panel("fit", f'<div class="et-chips">{button}</div>', note)

"""Statistics of a recording: what it is, what is odd in it, its rate, its pixels and its clock."""

from __future__ import annotations

from typing import TYPE_CHECKING

import cv2
import numpy as np

from app.html.elements import ON_PICK, bar, empty, escape, panel, picture
from app.html.moment import PICTURES, Moment
from app.html.units import count, of_whole, rate, seconds
from etnet.events.denoise import uncleaned
from etnet.render.colours import css_gradient, sequential
from etnet.render.encode import data_url

if TYPE_CHECKING:
    from app.engine.jobs import JobResult
    from etnet.events.examine import Examination

SIDE = 360
"""Pixels of the count image's longer side; smaller sensors are enlarged, each pixel whole."""
_KINDS = (("repaired", "Repaired"), ("assumed", "Assumed"), ("detected", "Detected"))
_OPEN = f'<button class="et-button" data-k="set:recording.examines:True" {ON_PICK}>Recording statistics</button>'
_COLUMNS, _HIGH = 400, 100


def closed_html() -> str:
    """The way in. Nothing is computed before it is taken."""
    note = "Its rate, its pixels, its clock, and what was repaired or assumed: its events are looked through once."
    return panel("doctor", _OPEN, f'<div class="et-note">{note}</div>')


def doctor_html(moment: Moment, result: JobResult | None) -> str:
    """The statistics in parts that flow over the columns of the stage, or how far they are."""
    if result is not None and result.trouble:
        return part("doctor", "Statistics", empty("Cannot be examined", result.trouble))
    if result is None or result.value is None:
        share = 0.0 if result is None else result.share
        read = f"<span>reading the events, {share:.0%}</span>{bar(share, waits=result is None)}"
        return part("doctor", "Statistics", f'<div class="et-lag">{read}</div>')
    found: Examination = result.value
    advice = "".join(f'<div class="et-warning" data-testid="advice">{escape(said)}</div>' for said in found.advice)
    return (
        part("doctor", "Statistics", advice + _of_how_much(moment, found) + _rows(found))
        + PICTURES.text(("doctor", moment.recording_id, found.num_events, found.stop), lambda: _pictures(found))
        + _told(found)
    )


def part(name: str, title: str, body: str) -> str:
    """One part of the statistics, which no column breaks."""
    return f'<section class="et etv-part" data-testid="{name}"><h4>{escape(title)}</h4>{body}</section>'


def _of_how_much(moment: Moment, found: Examination) -> str:
    """That more came since, or that the filter does not act here: numbers beside these are then of other events."""
    said = []
    if found.num_events < uncleaned(moment.recording).num_events:
        said.append(f"More events have come since: this is of the first {seconds((found.stop - found.start) / 1e6)}.")
    if not moment.cleaning.changes_nothing:
        said.append("Of all its events, also of those that the filter takes out.")
    return f'<div class="et-note" data-testid="of-how-much">{" ".join(said)}</div>' if said else ""


def _rows(found: Examination) -> str:
    length = (found.stop - found.start) / 1e6
    looked = max(found.num_looked_at, 1)
    rows = [
        ("Format", found.format),
        ("Sensor", f"{found.width} × {found.height} pixels"),
        ("Duration", f"{seconds(length)}, timestamps {count(found.start)} … {count(found.stop)} µs"),
        ("Events", f"{count(found.num_events)}; {rate(found.mean_rate)} on average, {rate(found.peak_rate)} at most"),
        ("Polarity", f"{of_whole(found.num_on / looked, 1)} ON, {of_whole(1 - found.num_on / looked, 1)} OFF"),
        ("Gaps", _gaps(found)),
        (
            "Duplicate timestamps",
            f"{count(found.num_equal_stamps)}; at most {count(found.longest_equal_run)} events share one",
        ),
        ("Repeated events", f"{count(found.num_repeated_events)} with timestamp, pixel and polarity of the one before"),
        ("Pixels", _pixels(found)),
        ("Camera frames", _frames(found)),
    ]
    if found.num_events:
        suited = f"{count(found.suggested_events)} events, or {found.suggested_duration / 1000:,.1f} ms"
        rows.append(("Suggested window", suited))
    if found.num_looked_at < found.num_events:
        rows.append(("Looked at", f"{count(found.num_looked_at)} events in blocks spread evenly over it"))
    told = "".join(f"<dt>{name}</dt><dd>{escape(value)}</dd>" for name, value in rows)
    return f'<div class="etv-told"><dl>{told}</dl></div>'


def _pixels(found: Examination) -> str:
    if found.num_silent_pixels is None:
        return f"binned {found.cell}×{found.cell}, because there are too many"
    return f"{count(found.num_silent_pixels)} silent, {len(found.hot_pixels)} hot"


def _gaps(found: Examination) -> str:
    if not found.gaps:
        return "none"
    longest = found.gaps[0]
    lasts, begins = longest.stop - longest.start, longest.start - found.start
    return f"{len(found.gaps)}; the longest {lasts / 1000:,.1f} ms, from {begins / 1e6:.3f} s"


def _frames(found: Examination) -> str:
    frames = found.frames
    if frames is None:
        return "none"
    offset = frames.first_after_first_event / 1000
    side = "after" if offset >= 0 else "before"
    clock = (
        f"the first {abs(offset):,.1f} ms {side} the first event, {frames.num_outside_span} outside the events’ span"
    )
    size = f"{count(frames.num_frames)} of {frames.width} × {frames.height}"
    return f"{size}, {frames.frames_per_second:.1f} a second; {clock}"


def _pictures(found: Examination) -> str:
    length = (found.stop - found.start) / 1e6
    at = f'data-k="span:0,{length}" {ON_PICK}'
    pickable = " et-pick"
    rates = _bars(np.asarray(found.rates))
    steps = _bars(np.log1p(np.asarray(found.step_counts)))
    ticks = "".join(
        f'<span style="grid-column:{i + 1}/span {min(3, len(found.step_edges) - i)}">{_step(edge)}</span>'
        for i, edge in enumerate(found.step_edges)
        if i % 3 == 0
    )
    go = "<span>click to go there</span>"
    over_time = (
        f'<div class="et-chart et-short{pickable}" data-testid="rates" {at}>{rates}</div>'
        f'<div class="et-caption et-ends"><span>0 s</span>{go}<span>{seconds(length)}</span></div>'
    )
    intervals = (
        f'<div class="et-chart et-short" data-testid="steps">{steps}</div>'
        f'<div class="et-caption et-steps">{ticks}</div>'
        '<div class="et-note">Heights are logarithms of counts; the last bar is everything longer.</div>'
    )
    return (
        part("rate", f"Event rate, up to {rate(found.peak_rate)}", over_time)
        + part("intervals", "Inter-event interval", intervals)
        + part("counts", f"Events per {'pixel' if found.cell == 1 else 'cell'}", _counts(found))
    )


def _step(microseconds: int) -> str:
    if microseconds < 1000:
        return f"{microseconds} µs"
    return f"{microseconds // 1000} ms" if microseconds < 1_000_000 else f"{microseconds // 1_000_000} s"


def _bars(heights: np.ndarray) -> str:
    highest = float(heights.max(initial=0.0))
    drawn = ""
    if highest > 0:
        width = _COLUMNS / len(heights)
        drawn = "".join(
            f'<rect x="{i * width:.2f}" width="{max(width - (width > 8), 0.5):.2f}" '
            f'y="{_HIGH - height * _HIGH:.1f}" height="{height * _HIGH:.1f}"/>'
            for i, height in enumerate((heights / highest).tolist())
            if height > 0
        )
    return f'<svg viewBox="0 0 {_COLUMNS} {_HIGH}" preserveAspectRatio="none" aria-hidden="true">{drawn}</svg>'


def _counts(found: Examination) -> str:
    fired = found.count_image[found.count_image > 0]
    limit = float(np.percentile(fired, 99.5)) if fired.size else 1.0
    image = sequential()[(np.clip(found.count_image / limit, 0, 1) * 255).astype(np.uint8)]
    share = SIDE / max(found.width, found.height)
    size = max(1, round(found.width * share)), max(1, round(found.height * share))
    image = cv2.resize(image, size, interpolation=cv2.INTER_AREA if share < 1 else cv2.INTER_NEAREST)
    shown = picture(
        data_url(image, is_lossless=True),
        "events of each pixel",
        key="pixel",
        size=size,
        area=(0, 0, found.width, found.height),
        classes="et-wide",
    )
    bar = f'<div class="et-legend-bar" style="background:{css_gradient(sequential())}"></div>'
    return (
        f'{shown}{bar}<div class="et-caption et-ends"><span>0</span><span>{count(round(limit))} or more '
        "(1 pixel in 200 has more)</span></div>"
    )


def _told(found: Examination) -> str:
    """What the reader noticed, by what it did about it. Order and borders of the sensor are its business."""
    parts = []
    for kind, title in _KINDS:
        said = [remark.removeprefix(f"{kind}: ") for remark in found.remarks if remark.startswith(f"{kind}: ")]
        listed = "".join(f"<li>{escape(one)}</li>" for one in said) or "<li>nothing</li>"
        if said or kind != "detected":
            parts.append(f"<h3>{title}</h3><ul>{listed}</ul>")
    note = (
        "Events out of order or beyond the sensor are never shown as they are: the file is refused, or it is told here."
    )
    return part(
        "import-log", "Import log", f'<div class="etv-told">{"".join(parts)}<div class="et-note">{note}</div></div>'
    )

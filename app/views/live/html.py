"""The tab of the live source, as HTML."""

from __future__ import annotations

from app.catalogue.live import LiveShown
from app.html.elements import empty, escape, panel
from app.html.live import counts_of, record_button, record_words
from app.html.units import count, milliseconds, seconds
from app.views.page import Page

MOST_NOTES = 6


def source_html(page: Page) -> str:
    """What the source is, how its windows are cut, what was lost, and its faults."""
    live = page.live
    if live is None:
        how = "Start the viewer with --live to show a camera, a stream or a replayed recording while it comes."
        return panel("live-source", empty("No live source", how))
    told = [
        ("Source", live.name),
        ("Sensor", f"{live.sensor} pixels"),
        ("Network sees", _seen(live)),
        ("Windows", live.windowing),
        ("Since the start", f"{seconds(live.seconds, 1)}, {count(live.num_events)} events"),
        ("Held", _held(live)),
        ("Lost or merged", counts_of(live) or "nothing"),
        ("Driver", _driver(live)),
    ]
    rows = "".join(f"<dt>{name}</dt><dd>{escape(value)}</dd>" for name, value in told if value)
    notes = "".join(f"<li>{seconds(at, 1)}: {escape(text)}</li>" for at, text in reversed(live.notes[-MOST_NOTES:]))
    faults = f"<h3>Faults</h3><ul>{notes}</ul>" if notes else ""
    return f'<div class="et etv-told" data-testid="live-source"><dl>{rows}</dl>{faults}</div>'


def recording_html(page: Page) -> str:
    """Recording it, for those who may."""
    live = page.live
    if live is None:
        return ""
    words = record_words(live)
    said = f'<div class="et-note">{escape(words)}</div>' if words else ""
    if not live.may_change:
        why = "Only a page on the machine itself records, or changes the source's settings."
        return f'<div class="et" data-testid="live-record">{said}<div class="et-note">{why}</div></div>'
    return f'<div class="et" data-testid="live-record"><div class="et-chips">{record_button(live)}</div>{said}</div>'


def _seen(live: LiveShown) -> str:
    if live.downsample == 1:
        return "every pixel"
    side = f"{live.downsample}×{live.downsample}"
    return f"{live.seen} pixels: binned {side}, so that it keeps up; --downsample 1 shows every pixel"


def _driver(live: LiveShown) -> str:
    """How long what comes lies in the camera's driver, and how much of it; empty without a driver."""
    if live.driver_delay is None:
        return ""
    packets = "packet" if live.driver_backlog == 1 else "packets"
    return f"fetched after {milliseconds(1000 * live.driver_delay)}, {count(live.driver_backlog)} {packets} waiting"


def _held(live: LiveShown) -> str:
    if live.gone_before == 0:
        return f"everything; what is older than {live.keep_seconds:g} s will leave"
    return f"gone: before {seconds(live.gone_before, 1)}; the last {live.keep_seconds:g} s or less are held"

"""What is taken out of the events: hot pixels, and what no neighbour supports; how much that is."""

from __future__ import annotations

from dataclasses import replace

from app.html.elements import escape, segmented
from app.html.units import count, of_whole
from app.views.page import Page
from etnet.events.cleaning import Cleaning
from etnet.events.denoise import num_masked, removed_share

TIMES = (0, 1, 2, 5, 10, 20, 50)
"""Milliseconds of the background-activity filter; 0 is off."""
NEIGHBOURS = (1, 2, 3, 4)


def filter_html(page: Page) -> str:
    """Each button says the whole filter that a click asks for."""
    cleaning = page.state.cleaning
    hot = {_key(replace(cleaning, hot_pixels=is_on)): "masked" if is_on else "kept" for is_on in (False, True)}
    times = {
        _key(replace(cleaning, support_within=1000 * time)): f"{time} ms" if time == TIMES[-1] else str(time) or "off"
        for time in TIMES
    }
    times[_key(replace(cleaning, support_within=0))] = "off"
    rows = [
        ("Hot pixels", segmented("Hot pixels", hot, _key(cleaning)), _masked(page)),
        ("Background activity", segmented("Background activity filter, ms", times, _key(cleaning)), ""),
    ]
    if cleaning.support_within:
        wanted = {_key(replace(cleaning, neighbours=number)): str(number) for number in NEIGHBOURS}
        rows.append(("Neighbours", segmented("Supporting neighbours", wanted, _key(cleaning)), ""))
    listed = "".join(
        f'<div class="etv-row"><label>{label}</label>{content}<span class="et-note">{note}</span></div>'
        for label, content, note in rows
    )
    note = (
        "An event stays if so many of its 8 neighbours fired within the time before it. The filter holds for "
        "everything: windows, frames, runs, exports and links."
    )
    return (
        f'<div class="et etv-settings" data-testid="filter"><div class="etv-headed"><h4>Filter</h4>'
        f'<span class="et-note" data-testid="removed">{escape(_removed(page))}</span></div>{listed}'
        f'<div class="et-note">{note}</div></div>'
    )


def _key(cleaning: Cleaning) -> str:
    """What a click sends; without a time the neighbours mean nothing."""
    return f"filter:{cleaning.text or 'none'}"


def _removed(page: Page) -> str:
    if page.state.cleaning.changes_nothing:
        return "off"
    if page.moment is None:
        return page.trouble or "filtering"
    return f"removes {of_whole(removed_share(page.moment.recording), 1)}"


def _masked(page: Page) -> str:
    if page.moment is None or not page.state.cleaning.hot_pixels:
        return ""
    return f"{count(num_masked(page.moment.recording))} masked"

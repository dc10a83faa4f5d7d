"""What is changed, marked on the timeline: since which window, or in which one."""

from __future__ import annotations

from app.html.attention.changed import change_words, since_words
from app.html.elements import escape
from app.html.timeline_marks import AXIS_WIDTH, place_of
from app.views.inspect.state import InspectState
from app.views.page import Page

_HEIGHT = 34
_FILL = 'fill="var(--warning)"'


def change_on_timeline(page: Page) -> str:
    """SVG over the strip; nothing while nothing is changed."""
    change, moment = page.state.of(InspectState).change, page.moment
    if change.is_nothing or moment is None:
        return ""
    words = f"{change_words(change.intervention, change.edit)} · {since_words(change.since, change.once)}"
    title = f"<title>{escape(words)}</title>"
    if change.since is None or change.since >= len(moment.windows):
        return f'<g data-testid="change-mark">{title}<rect x="0" y="0" width="{AXIS_WIDTH}" height="2" {_FILL}/></g>'
    window = moment.windows[change.since]
    left = place_of(moment, window.t_start)
    right = place_of(moment, window.t_stop) if change.once else AXIS_WIDTH
    return (
        f'<g data-testid="change-mark">{title}<rect x="{left:.2f}" y="0" width="{max(right - left, 2):.2f}" height="2"'
        f' {_FILL}/><rect x="{left:.2f}" y="0" width="1.5" height="{_HEIGHT}" {_FILL}/></g>'
    )

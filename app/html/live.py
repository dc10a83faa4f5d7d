"""What a page says of a live source: the badge at the image, and the line beside the timeline."""

from __future__ import annotations

from app.catalogue.live import LiveShown
from app.html.controls import button
from app.html.elements import chip, escape
from app.html.units import count, milliseconds, seconds


def live_badge(live: LiveShown, follows: bool, stamp_seconds: float | None) -> str:
    """How far the image is behind the source; of one in the past, how long ago it was."""
    if follows:
        late = "" if live.behind is None else f", {milliseconds(1000 * live.behind)} behind"
        hint = "From the arrival of the window's last event to its image"
        return chip("The source has ended" if live.is_over else f"Live{late}", "live", hint)
    if stamp_seconds is None:
        return ""
    return chip(f"{seconds(max(live.seconds - stamp_seconds, 0.0), 1)} ago", "plain", "The source goes on meanwhile")


def live_line(live: LiveShown, is_live: bool, follows: bool, gone: str, is_public: bool = False) -> str:
    """Live or back to it, what was recorded, what was lost, what is new: one line. In public without numbers."""
    parts = [_state(live, is_live, follows), _record(live)]
    if gone:
        parts.append(f'<span class="et-warning" data-testid="gone">{escape(gone)}</span>')
    counts = "" if is_public else counts_of(live)
    if counts:
        parts.append(f'<span data-testid="live-counts">{escape(counts)}</span>')
    if live.news:
        parts.append(f'<span class="et-warning" role="status" data-testid="live-news">{escape(live.news)}</span>')
    return f'<div class="etv-live" data-testid="live">{"".join(parts)}</div>'


def counts_of(live: LiveShown) -> str:
    """What was lost, held up, merged or not seen; empty while nothing was."""
    found = (
        (live.num_lost, "packet lost", "packets lost"),
        (live.num_held_up, "event out of order", "events out of order"),
        (live.num_merged, "window merged", "windows merged"),
        (live.num_unseen, "event unseen", "events unseen"),
    )
    return ", ".join(f"{count(number)} {one if number == 1 else many}" for number, one, many in found if number)


def record_words(live: LiveShown) -> str:
    """The file that is being written; else the last one."""
    if live.recording is not None:
        return f"recording {live.recording.path.name}, {count(live.recording.num_events)} events"
    if live.recorded:
        last = live.recorded[-1]
        missing = f", {count(last.num_missing)} missing" if last.num_missing else ""
        return f"recorded {last.path.name}, {count(last.num_events)} events{missing}"
    return ""


def record_button(live: LiveShown) -> str:
    """Begin a file, or finish it."""
    if live.recording is not None:
        return button("Stop recording", "live:stop", is_on=True, classes="et-recording")
    return button("Record", "live:record", hint="Write what comes from now on to a file")


def _state(live: LiveShown, is_live: bool, follows: bool) -> str:
    if not is_live:
        return button("Show live", f"open:{live.id}")
    if follows:
        return f'<b class="etv-live-mark" data-testid="is-live">{"Ended" if live.is_over else "Live"}</b>'
    return button("Back to live", "live:follow", classes="et-on")


def _record(live: LiveShown) -> str:
    words = record_words(live)
    said = f'<span data-testid="recorded-to">{escape(words)}</span>' if words else ""
    opens = ""
    if live.recording is None and live.recorded:
        opens = button("Open it", f"open:{live.recorded[-1].id}")
    if not live.may_change:
        return said if live.recording is not None else ""
    return record_button(live) + said + opens

"""A stretch of a recording, told in seconds since its first event, as the indices of its events."""

from __future__ import annotations

import math

from etnet.errors import RecordingError
from etnet.events.recording import Recording


def events_between(recording: Recording, begin: float = 0.0, end: float | None = None) -> tuple[int, int]:
    """Indices (start, stop) of the events from `begin` up to, not including, `end`: seconds since the first event.

    Without `end` the last event is in it. Two cuts that share a border share no event and lose none. Raises
    RecordingError where nothing lies between them.
    """
    span = recording.span
    length = span.duration / 1e6
    last = math.inf if end is None else end
    # A comparison with NaN is false, so it is caught here too.
    if not (0 <= begin < last and begin <= length):
        raise RecordingError(
            f"{recording.name}: nothing lies from {begin:g} s to {'the end' if end is None else f'{last:g} s'}; "
            f"it lasts {length:.6f} s, and the first time must be before the second"
        )
    start = recording.index_at(span.start + round(begin * 1e6))
    stop = recording.num_events if last > length else recording.index_at(span.start + round(last * 1e6))
    if start >= stop:
        raise RecordingError(f"{recording.name}: there is no event from {begin:g} s to {last:g} s; widen the cut")
    return start, stop


def stretch_between(recording: Recording, begin: float = 0.0, end: float | None = None) -> tuple[int, int]:
    """The same stretch in µs, whatever its first and last event: a frame that closes its last window belongs to it."""
    span = recording.span
    last = span.stop if end is None else span.start + round(min(end * 1e6, span.duration))
    return span.start + round(begin * 1e6), last

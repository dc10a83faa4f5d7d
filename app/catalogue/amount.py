"""How much of a recording is there: what is measured of all of it is asked for again when more has come."""

from __future__ import annotations

from app.catalogue.cut import is_live
from etnet.events.denoise import uncleaned
from etnet.events.recording import Recording


def latest_of(recording: Recording) -> Recording:
    """What a recording that is still being made is by now; any other as it is."""
    return recording if recording.latest is None else recording.latest()


def amount_of(recording: Recording) -> int:
    """Its events before any filter. Of one that is still being made a power of two, so that what depends on it is made
    at every doubling, not with every window; 0 of a live one, whose beginning leaves: that is measured once."""
    whole = uncleaned(recording)
    if is_live(whole):
        return 0
    return whole.num_events if whole.latest is None else 1 << whole.num_events.bit_length() >> 1

"""A part of a file that is still being indexed has an id of its own: what is computed of it is not the whole's."""

from __future__ import annotations

from etnet.events.recording import Recording

_PART = "^"


def known_as(recording_id: str, recording: Recording) -> str:
    """The id of what was opened by an id: the same, or that of a part, which the number of its events tells."""
    whole = whole_id(recording_id)
    return whole if recording.growth is None else f"{whole}{_PART}{recording.num_events}"


def whole_id(recording_id: str) -> str:
    """The id of the file of which this may be a part."""
    return recording_id.partition(_PART)[0]

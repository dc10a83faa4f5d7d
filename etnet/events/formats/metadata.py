"""metadata.json beside the events: EVREAL's, with the sensor's size, and that of folders that are written here."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from etnet.errors import RecordingError
from etnet.events.events import Sensor
from etnet.events.formats.archive import Store, read_small
from etnet.events.formats.bounds import ANY_PIXELS, declared_sensor
from etnet.plain_values import PlainError, bounded_json

LONGEST = 4 << 20
"""Bytes of such a file: it holds a size, and how a recording was made."""


def metadata_of(store: Store, prefix: str, name: str) -> Mapping[str, Any]:
    """What stands in metadata.json under `prefix` ("" or "a/b/"); nothing where there is none."""
    if prefix + "metadata.json" not in store.names():
        return {}
    try:
        content = bounded_json(read_small(store, prefix + "metadata.json", name), LONGEST, endless="none")
    except PlainError as error:
        raise RecordingError(f"{name}: metadata.json {error}") from None
    return content if isinstance(content, dict) else {}


def metadata_size(content: Mapping[str, Any], name: str) -> Sensor | None:
    """The size that it states as (height, width)."""
    size = content.get("sensor_resolution")
    if not isinstance(size, list) or len(size) < 2:
        return None
    return declared_sensor(size[1], size[0], f"{name}: metadata.json", ANY_PIXELS)

"""Under which names files keep x, y, t and p."""

from __future__ import annotations

from collections.abc import Iterable

NAMES = {
    "x": ("x", "xs", "events_x", "x_pos"),
    "y": ("y", "ys", "events_y", "y_pos"),
    "t": ("t", "ts", "timestamp", "timestamps", "time", "events_t", "events_ts", "t_us", "ts_us"),
    "p": ("p", "ps", "pol", "polarity", "polarities", "events_p", "on"),
}


def column_keys(keys: Iterable[str]) -> dict[str, str] | None:
    """Which of `keys` holds which of x, y, t and p; None if one is missing."""
    lower = {key.lower(): key for key in keys}
    found = {axis: next((lower[name] for name in names if name in lower), None) for axis, names in NAMES.items()}
    whole = {axis: key for axis, key in found.items() if key is not None}
    return whole if len(whole) == len(NAMES) else None

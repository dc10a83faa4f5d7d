"""Stamps as files hold them, turned into the one form: int64 µs."""

from __future__ import annotations

import numpy as np
from jaxtyping import Int64, Shaped

from etnet.errors import RecordingError
from etnet.events.assumptions import TimeUnit
from etnet.events.formats.time_unit import PER_SECOND

LARGEST_STAMP = 2**62
"""µs; beyond it something is no time."""

BLOCK = 1 << 15
"""Events of a long column turned into µs or looked at in one go: read again while they are in the processor's cache."""


def stamps_in_microseconds(
    values: Shaped[np.ndarray, " n"], unit: TimeUnit, name: str, offset: int = 0
) -> Int64[np.ndarray, " n"]:
    """Stamps of any number type as µs, rounded half to even, plus `offset` (µs); the same array where it is that."""
    if values.dtype.kind == "f":
        stamps = _rounded(values, unit, name)
    elif values.dtype.kind not in "iu":
        raise RecordingError(f"{name}: its stamps are of type {values.dtype}; numbers are wanted")
    else:
        limit = LARGEST_STAMP // max(1, 10**6 // PER_SECOND[unit])
        if values.dtype.itemsize > 4 and len(values) and (int(values.max()) >= limit or int(values.min()) <= -limit):
            raise RecordingError(f"{name}: stamps up to {values.max()} {unit} do not fit 64 bits of µs; mend the file")
        if unit == "us":
            is_it = values.dtype == np.int64 and offset == 0
            return values if is_it else np.add(values, offset, dtype=np.int64)
        whole = values.astype(np.int64)
        stamps = from_nanoseconds(whole) if unit == "ns" else whole * (10**6 // PER_SECOND[unit])
    if offset:
        stamps += offset
    return stamps


def _rounded(values: Shaped[np.ndarray, " n"], unit: TimeUnit, name: str) -> Int64[np.ndarray, " n"]:
    stamps = np.empty(len(values), np.int64)
    scratch = np.empty(min(len(values), BLOCK), np.float64)
    for start in range(0, len(values), BLOCK):
        part = values[start : start + BLOCK]
        scaled = np.multiply(part, 10**6 / PER_SECOND[unit], out=scratch[: len(part)], dtype=np.float64)
        # A comparison with NaN is false, so it is caught here too.
        if not (scaled.max() < LARGEST_STAMP and scaled.min() > -LARGEST_STAMP):
            first = start + int(np.argmin(np.abs(scaled) < LARGEST_STAMP))
            raise RecordingError(
                f"{name}: the stamp of event {first} is {values[first]} {unit}, which is no time; mend it"
            )
        stamps[start : start + len(part)] = np.rint(scaled, out=scaled)
    return stamps


def is_ordered(t: Int64[np.ndarray, " n"]) -> bool:
    """Whether no stamp is smaller than the one before it."""
    for start in range(0, len(t) - 1, BLOCK):
        part = t[start : start + BLOCK + 1]
        if bool((part[1:] < part[:-1]).any()):
            return False
    return True


def from_nanoseconds(t: Int64[np.ndarray, " n"]) -> Int64[np.ndarray, " n"]:
    """Nanoseconds to µs, half to even."""
    whole, rest = np.divmod(t, 1000)
    return whole + ((rest > 500) | ((rest == 500) & ((whole & 1) == 1)))

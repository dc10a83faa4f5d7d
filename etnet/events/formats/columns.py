"""Columns as files hold them, turned into the one form: pixels u16, stamps int64 µs, polarity ±1."""

from __future__ import annotations

import numpy as np
from jaxtyping import Int8, Int64, Shaped, UInt16

from etnet.errors import RecordingError
from etnet.events.assumptions import Assumptions, TimeUnit, said_unit
from etnet.events.events import Sensor
from etnet.events.formats.base import Remarks

_PER_SECOND = {"s": 1, "ms": 10**3, "us": 10**6, "ns": 10**9}
LARGEST_STAMP = 2**62
"""µs; beyond it something is no time."""

BLOCK = 1 << 15
"""Events of a long column turned into µs or looked at in one go: read again while they are in the processor's cache."""

KNOWN_SENSORS = (
    (34, 34, "N-MNIST's crop"),
    (128, 128, "DVS128"),
    (240, 180, "DAVIS240"),
    (304, 240, "ATIS"),
    (320, 240, "DVXplorer Lite"),
    (320, 320, "GenX320"),
    (346, 260, "DAVIS346"),
    (480, 360, "Gen3 VGA crop"),
    (640, 480, "Gen3 or DVXplorer"),
    (1280, 720, "Gen4 or IMX636"),
)
LARGEST_DEDUCED_SIDE = 4096
"""Events that reach farther than any sensor built so far mean that the file is read wrongly."""


def stamps_in_microseconds(
    values: Shaped[np.ndarray, " n"], unit: TimeUnit, name: str, offset: int = 0
) -> Int64[np.ndarray, " n"]:
    """Stamps of any number type as µs, rounded half to even, plus `offset` (µs); the same array where it is that."""
    if values.dtype.kind == "f":
        stamps = _rounded(values, unit, name)
    elif values.dtype.kind not in "iu":
        raise RecordingError(f"{name}: its stamps are of type {values.dtype}; numbers are wanted")
    else:
        limit = LARGEST_STAMP // max(1, 10**6 // _PER_SECOND[unit])
        if values.dtype.itemsize > 4 and len(values) and (int(values.max()) >= limit or int(values.min()) <= -limit):
            raise RecordingError(f"{name}: stamps up to {values.max()} {unit} do not fit 64 bits of µs; mend the file")
        if unit == "us":
            is_it = values.dtype == np.int64 and offset == 0
            return values if is_it else np.add(values, offset, dtype=np.int64)
        whole = values.astype(np.int64)
        stamps = from_nanoseconds(whole) if unit == "ns" else whole * (10**6 // _PER_SECOND[unit])
    if offset:
        stamps += offset
    return stamps


def _rounded(values: Shaped[np.ndarray, " n"], unit: TimeUnit, name: str) -> Int64[np.ndarray, " n"]:
    stamps = np.empty(len(values), np.int64)
    scratch = np.empty(min(len(values), BLOCK), np.float64)
    for start in range(0, len(values), BLOCK):
        part = values[start : start + BLOCK]
        scaled = np.multiply(part, 10**6 / _PER_SECOND[unit], out=scratch[: len(part)], dtype=np.float64)
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


def guessed_unit(sample: Shaped[np.ndarray, " n"], assume: Assumptions, remarks: Remarks) -> TimeUnit:
    """The unit that nothing declares: fractions are seconds, whole numbers µs, ns where µs would be absurd."""
    if assume.time_unit is not None:
        remarks.assumed(said_unit(assume.time_unit))
        return assume.time_unit
    if sample.dtype.kind == "f" and bool((sample != np.rint(sample)).any()):
        unit, why = "s", "they have fractions"
    elif len(sample) and abs(float(sample[-1])) > 1e17:
        unit, why = "ns", "they are beyond 10¹⁷"
    else:
        unit, why = "us", "they are whole numbers"
    remarks.assumed(f"stamps count {unit}, because {why}; --time-unit overrules")
    return unit


def signed_polarity(
    values: Shaped[np.ndarray, " n"], assume: Assumptions, name: str, out: Int8[np.ndarray, " n"] | None = None
) -> Int8[np.ndarray, " n"]:
    """0/1, bool and −1/+1 as ±1, in `out` if given; other codings are an error unless `assume` allows them."""
    signs = np.empty(len(values), np.int8) if out is None else out
    if values.dtype.kind == "b":
        signs.view(np.bool_)[:] = values
    elif values.dtype.kind not in "iuf":
        raise RecordingError(f"{name}: its polarity column is of type {values.dtype}; numbers or booleans are wanted")
    else:
        np.greater(values, 0, out=signs.view(np.bool_))
        if assume.polarity != "positive" and len(values):
            _check_coding(values, name)
    signs *= -2 if assume.polarity == "inverted" else 2
    signs += 1 if assume.polarity == "inverted" else -1
    return signs


def say_coding(lowest: float, is_bool: bool, remarks: Remarks) -> None:
    """How a file writes polarity, by the lowest value that was seen; nothing where a reader told of it already."""
    if not any("polarity" in remark.text for remark in remarks.kept):
        remarks.detected(f"polarity is coded {'as booleans' if is_bool else '−1/+1' if lowest < 0 else '0/1'}")


def _check_coding(values: Shaped[np.ndarray, " n"], name: str) -> None:
    low, high = values.min(), values.max()
    if (low in (0, 1) and high in (0, 1)) or (low == -1 and high in (-1, 1)):
        if values.dtype.kind != "f" and low >= 0:
            return
        if bool(((values == high) | (values == low)).all()):
            return
    raise RecordingError(
        f"{name}: polarity runs from {low} to {high}; 0/1 or −1/+1 is wanted: "
        "--polarity positive takes all above 0 as ON"
    )


def pixel_column(values: Shaped[np.ndarray, " n"], axis: str, name: str) -> UInt16[np.ndarray, " n"]:
    """Coordinates as u16; fractions, negative ones and those beyond 65,535 are an error that names the event."""
    if values.dtype == np.uint16:
        return values
    if values.dtype.kind not in "iuf":
        raise RecordingError(f"{name}: its {axis} column is of type {values.dtype}; whole numbers are wanted")
    if len(values) == 0:
        return np.empty(0, np.uint16)
    if values.dtype.kind != "f" and int(values.min()) >= 0 and int(values.max()) < 65_536:
        return values.view(np.uint16) if values.dtype == np.int16 else values.astype(np.uint16)
    fine = (values >= 0) & (values < 65_536) & (values == np.floor(values))
    if not fine.all():
        first = int(np.argmin(fine))
        raise RecordingError(
            f"{name}: event {first} of this part has {axis} = {values[first]}; pixels are whole numbers from 0"
            " (rectified coordinates must be rounded first)"
        )
    return values.astype(np.uint16)


def deduced_sensor(reach_x: int, reach_y: int, name: str, remarks: Remarks, where: str = "the events") -> Sensor:
    """The sensor of a file that names none: a known size that the events nearly fill, else just what they reach."""
    if max(reach_x, reach_y) >= LARGEST_DEDUCED_SIDE:
        raise RecordingError(
            f"{name}: it names no sensor and its events reach pixel ({reach_x}, {reach_y}), which no sensor has; "
            "state the size with --assume width=…,height=… or check that the format is right"
        )
    for width, height, model in KNOWN_SENSORS:
        if 0.9 * width <= reach_x + 1 <= width and 0.9 * height <= reach_y + 1 <= height:
            remarks.assumed(
                f"sensor {width}×{height} ({model}): the file names none and {where} reach "
                f"pixel ({reach_x}, {reach_y}); --assume width=…,height=… overrules"
            )
            return Sensor(width, height)
    sensor = Sensor(reach_x + 1, reach_y + 1)
    remarks.assumed(
        f"sensor {sensor}: the file names none and {where} reach pixel ({reach_x}, {reach_y}); "
        "--assume width=…,height=… overrules"
    )
    return sensor

"""How a file writes polarity: 0/1, −1/+1, booleans, 1/2, 0/255, or −1 that was cast to a type without a sign."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from jaxtyping import Int8, Shaped

from etnet.errors import RecordingError
from etnet.events.assumptions import Assumptions
from etnet.events.formats.base import Remarks

_CAST = (2**8 - 1, 2**16 - 1, 2**32 - 1, 2**64 - 1)
"""−1 as a type of 8, 16, 32 or 64 bits without a sign holds it."""


class Coding(NamedTuple):
    """The two values of a file that writes neither 0/1 nor −1/+1."""

    on: int
    off: int


def unusual_coding(low: float, high: float) -> Coding | None:
    """Of a file whose polarities run from `low` to `high`: what they mean, if that is certain and not 0/1 or −1/+1."""
    if (low, high) in ((1, 2), (0, 255)):
        return Coding(on=int(high), off=int(low))
    if high in _CAST and (low == 1 or (low == high and high > 255)):
        return Coding(on=1, off=int(high))
    return None


def signed_polarity(
    values: Shaped[np.ndarray, " n"],
    assume: Assumptions,
    name: str,
    out: Int8[np.ndarray, " n"] | None = None,
    *,
    coding: Coding | None = None,
) -> Int8[np.ndarray, " n"]:
    """Polarity as ±1, in `out` if given; values whose meaning is not certain are an error unless `assume` settles it.

    `coding` is what the whole file tells; a part of it may hold one value alone.
    """
    signs = np.empty(len(values), np.int8) if out is None else out
    is_on = signs.view(np.bool_)
    if values.dtype.kind == "b":
        is_on[:] = values
    elif values.dtype.kind not in "iuf":
        raise RecordingError(f"{name}: its polarity column is of type {values.dtype}; numbers or booleans are wanted")
    elif coding is not None and assume.polarity != "positive":
        np.equal(values, coding.on, out=is_on)
        if not bool((is_on | (values == coding.off)).all()):
            raise _unknown(values, name)
    else:
        np.greater(values, 0, out=is_on)
        if assume.polarity != "positive" and len(values):
            _check_usual(values, name)
    signs *= -2 if assume.polarity == "inverted" else 2
    signs += 1 if assume.polarity == "inverted" else -1
    return signs


def _check_usual(values: Shaped[np.ndarray, " n"], name: str) -> None:
    low, high = values.min(), values.max()
    if (low in (0, 1) and high in (0, 1)) or (low == -1 and high in (-1, 1)):
        # Between 0 and 1 there is nothing else but in floats; between −1 and 1 there is 0.
        if values.dtype.kind != "f" and low >= 0:
            return
        if bool(((values == high) | (values == low)).all()):
            return
    raise _unknown(values, name)


def _unknown(values: Shaped[np.ndarray, " n"], name: str) -> RecordingError:
    low, high = values.min(), values.max()
    wanted = "wanted 0/1, −1/+1, 1/2 or booleans"
    if low > 0:
        return RecordingError(f"{name}: polarity runs from {low} to {high}; {wanted}: is it the right column?")
    return RecordingError(
        f"{name}: polarity runs from {low} to {high}, which is no coding that is known; {wanted}. If all above 0 is "
        "ON and all else OFF, open it with --polarity positive"
    )


def say_coding(lowest: float, is_bool: bool, remarks: Remarks) -> None:
    """How a file writes polarity, by the lowest value that was seen; nothing where a reader told of it already."""
    if not any("polarity" in remark.text for remark in remarks.kept):
        remarks.detected(f"polarity is coded {'as booleans' if is_bool else '−1/+1' if lowest < 0 else '0/1'}")


def say_unusual(coding: Coding, remarks: Remarks) -> None:
    """The same for one that had to be recognised."""
    if coding.on > 1:
        remarks.repaired(f"polarity {coding.off}/{coding.on} was read as OFF/ON")
    else:
        remarks.repaired(f"polarity {coding.off} was read as −1, OFF: a −1 that was stored without its sign")

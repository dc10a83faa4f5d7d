"""Which column of a table of four is t, x, y and p, told by what they hold, in any order."""

from __future__ import annotations

import numpy as np
from jaxtyping import Shaped

from etnet.events.formats.polarity import unusual_coding

_USUAL = ("txyp", "xytp", "xypt")
"""Orders that people write; where values leave a choice, the first that fits is taken."""


_MOSTLY = 0.9
"""Share of steps in one direction from which on a column is a clock out of order; of pixels half go each way."""


def table_order(sample: Shaped[np.ndarray, "n 4"], name_is_events: bool = True) -> str | None:
    """The order, such as "txyp", of which x comes before y; None where these are no events.

    `sample`: rows in the order of the file. `name_is_events`: the table is called so; then it is taken for events also
    where its values are odd.
    """
    columns = [sample[:, i] for i in range(4)]
    if len(sample) == 0:
        return "txyp" if name_is_events else None
    signs = [i for i in range(4) if is_polarity(columns[i])]
    times = [i for i in range(4) if _is_ordered(columns[i])]
    fitting = _fitting(columns, signs, times)
    if not fitting and name_is_events:
        fitting = _fitting(columns, signs, [i for i in range(4) if _is_mostly_ordered(columns[i])])
    if not fitting and name_is_events:
        fractions = [i for i in range(4) if not _is_whole(columns[i])]
        farthest = max((i for i in range(4) if i not in signs), key=lambda i: _range(columns[i]), default=0)
        fitting = _fitting(columns, signs, fractions if len(fractions) == 1 else [farthest])
    if fitting:
        latest = max(_range(columns[order.index("t")]) for order in fitting)
        return next(order for order in fitting if _range(columns[order.index("t")]) == latest)
    return _by_size(columns) if name_is_events else None


def _fitting(columns: list[np.ndarray], signs: list[int], times: list[int]) -> list[str]:
    """Orders with polarity and time in one of these columns, and pixels in the others."""
    return [
        order
        for order in (*_USUAL, *_others())
        if order.index("p") in signs and order.index("t") in times and _are_pixels(columns, order)
    ]


def is_polarity(values: Shaped[np.ndarray, " n"]) -> bool:
    """Whether a column holds nothing but ON and OFF in a known coding."""
    low, high = values.min().item(), values.max().item()
    if not bool(((values == low) | (values == high)).all()):
        return False
    return (low, high) in ((0, 0), (0, 1), (1, 1), (-1, 1), (-1, -1)) or unusual_coding(low, high) is not None


def _others() -> list[str]:
    """Every order with x before y."""
    found = []
    for t in range(4):
        for p in range(4):
            if t != p:
                order = ["", "", "", ""]
                order[t], order[p] = "t", "p"
                rest = [i for i in range(4) if not order[i]]
                order[rest[0]], order[rest[1]] = "x", "y"
                found.append("".join(order))
    return found


def _is_ordered(values: Shaped[np.ndarray, " n"]) -> bool:
    return bool((values[1:] >= values[:-1]).all())


def _is_mostly_ordered(values: Shaped[np.ndarray, " n"]) -> bool:
    """Also of a clock that wraps, or of rows from last to first."""
    num_up, num_down = np.count_nonzero(values[1:] > values[:-1]), np.count_nonzero(values[1:] < values[:-1])
    return bool(max(num_up, num_down) > _MOSTLY * max(1, num_up + num_down))


def _are_pixels(columns: list[np.ndarray], order: str) -> bool:
    return all(_is_whole(columns[order.index(axis)]) for axis in "xy")


def _is_whole(values: Shaped[np.ndarray, " n"]) -> bool:
    return values.dtype.kind in "iub" or bool((values == np.floor(values)).all())


def _range(values: Shaped[np.ndarray, " n"]) -> float:
    """How far it goes; fractions make it a time whatever else is in order."""
    return float(values.max()) - float(values.min()) if _is_whole(values) else np.inf


def _by_size(columns: list[np.ndarray]) -> str:
    """Polarity is odd: p is the last column, t has fractions or the largest numbers."""
    has_fractions = [i for i in (0, 2) if not _is_whole(columns[i])]
    if len(has_fractions) == 1:
        return "txyp" if has_fractions == [0] else "xytp"
    if is_polarity(columns[2]) and not is_polarity(columns[3]):
        return "xypt"
    return "txyp" if columns[0].max() > columns[2].max() else "xytp"

"""What the numbers of a camera's pictures go up to, judged over a few of them, and the pictures as grey in 0 … 1."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from jaxtyping import Float32, Shaped

from etnet.errors import RecordingError
from etnet.events.cache import grey
from etnet.events.formats.base import Remarks

MOST_LOOKED_AT = 5
"""Pictures by which the range is judged, spread evenly."""

_DEPTHS = (8, 10, 12, 14, 16)
"""Bits that cameras count in."""

ReadRaw = Callable[[int], Shaped[np.ndarray, "..."]]


def judged_range(count: int, read_raw: ReadRaw, remarks: Remarks, stated: float | None = None) -> tuple[float, float]:
    """The numbers that stand for black and white. `stated` is what the file itself says of white.

    8-bit whole numbers and floats up to 1 are what they seem; 10, 12 or 14 bits in a wider type, floats up to 255 and
    floats from −1 to 1 are recognised, and that is said.
    """
    if stated is not None:
        return 0.0, stated
    looked_at = [read_raw(i) for i in sorted({int(i) for i in np.linspace(0, count - 1, MOST_LOOKED_AT)})]
    kinds = {picture.dtype for picture in looked_at}
    if kinds <= {np.dtype(np.uint8), np.dtype(np.bool_)}:
        return 0.0, 255.0 if np.dtype(np.uint8) in kinds else 1.0
    finite = [picture[np.isfinite(picture)] for picture in looked_at]
    high = max((float(part.max()) for part in finite if part.size), default=0.0)
    low = min((float(part.min()) for part in finite if part.size), default=0.0)
    kind = looked_at[0].dtype
    if kind.kind == "f" and -1 - 1e-6 <= low < -0.5 and 0 < high <= 1 + 1e-6:
        remarks.assumed(f"frames are {kind} from {low:g} to {high:g}: −1 was taken for black and 1 for white")
        return -1.0, 1.0
    if kind.kind == "f" and high <= 1.0 + 1e-6:
        white = 1.0
    else:
        white = next((2.0**bits - 1 for bits in _DEPTHS if high <= 2.0**bits - 1 + 1e-6), high)
    is_as_it_seems = white == (1.0 if kind.kind == "f" else float(np.iinfo(kind).max))
    if not is_as_it_seems:
        remarks.assumed(f"frames are {kind} up to {high:g}: {white:g} was taken for white")
    if low < 0:
        remarks.advise(f"frames go down to {low:g}; what is below 0 is black")
    return 0.0, white


def with_colours_last(picture: Shaped[np.ndarray, ...]) -> Shaped[np.ndarray, ...]:
    """A picture of colour × height × width, as networks take it, turned to height × width × colour."""
    return np.moveaxis(picture, 0, 2) if is_colours_first(picture.shape) else picture


def is_colours_first(shape: tuple[int, ...]) -> bool:
    """Whether the first side is that of the colours: 1, 3 or 4, and the last is none of them."""
    return len(shape) == 3 and shape[0] in (1, 3, 4) and shape[2] > 4


def colour_picture(
    picture: Shaped[np.ndarray, ...], black: float, white: float, where: str, is_bgr: bool
) -> Float32[np.ndarray, "h w 3"]:
    """One picture as blue, green, red in 0 … 1; one without colours has three equal ones."""
    if picture.ndim == 2 or picture.shape[2] < 3:
        grey_values = grey_picture(picture, black, white, where, is_bgr)
        return np.repeat(grey_values[..., None], 3, 2)
    colours = picture[..., :3] if is_bgr else picture[..., 2::-1]
    flat = (colours.astype(np.float32) - np.float32(black)) / np.float32(white - black)
    return np.nan_to_num(np.clip(flat, 0, 1), nan=0.0)


def grey_picture(
    picture: Shaped[np.ndarray, ...], black: float, white: float, where: str, is_bgr: bool
) -> Float32[np.ndarray, "h w"]:
    """One picture (h × w, or with 1, 3 or 4 colours) as luminance in 0 … 1."""
    if picture.ndim not in (2, 3) or picture.dtype.kind not in "uifb" or 0 in picture.shape:
        raise RecordingError(f"{where} is {picture.dtype} of the shape {picture.shape}; wanted a picture")
    flat = (grey(picture.astype(np.float32), is_bgr=is_bgr) - np.float32(black)) / np.float32(white - black)
    if picture.dtype.kind in "if":
        return np.nan_to_num(np.clip(flat, 0, 1), nan=0.0)
    return np.minimum(flat, np.float32(1))

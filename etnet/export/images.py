"""Frames as PNG files with their stamps beside them."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
from jaxtyping import Float32, UInt8

from etnet.errors import EtnetError
from etnet.files import write_atomically


def check_gamma(gamma: float) -> None:
    """An error unless frames can be shown with this display gamma."""
    if not 0.1 <= gamma <= 10:
        raise EtnetError(f"display gamma is {gamma:g}; it takes a number from 0.1 to 10")


def to_uint8(frame: Float32[np.ndarray, "h w"], gamma: float = 1.0) -> UInt8[np.ndarray, "h w"]:
    """Clip to 0 … 1, apply frame^(1/gamma), round half to even to 0 … 255."""
    clipped = np.clip(frame, 0.0, 1.0)
    return np.rint((clipped if gamma == 1.0 else clipped ** (1 / gamma)) * 255).astype(np.uint8)


def write_png(path: Path, image: UInt8[np.ndarray, "h w"] | UInt8[np.ndarray, "h w 3"]) -> None:
    """Write one grey or RGB image, whole or not at all; a run of many is not flushed to the disk picture by picture."""
    is_encoded, content = cv2.imencode(".png", image if image.ndim == 2 else image[..., ::-1])
    if not is_encoded:
        raise EtnetError(f"{path.name}: an image of shape {image.shape} cannot be written as PNG")
    write_atomically(path, content.tobytes(), flushes=False)

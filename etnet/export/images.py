"""Frames as PNG files with their stamps beside them."""

from __future__ import annotations

import os
from pathlib import Path

import cv2
import numpy as np
from jaxtyping import Float32, UInt8

from etnet.errors import EtnetError
from etnet.files import check_target


def to_uint8(frame: Float32[np.ndarray, "h w"], gamma: float = 1.0) -> UInt8[np.ndarray, "h w"]:
    """Clip to 0 … 1, apply frame^(1/gamma), round half to even to 0 … 255."""
    clipped = np.clip(frame, 0.0, 1.0)
    return np.rint((clipped if gamma == 1.0 else clipped ** (1 / gamma)) * 255).astype(np.uint8)


def write_png(path: Path, image: UInt8[np.ndarray, "h w"] | UInt8[np.ndarray, "h w 3"]) -> None:
    """Write one grey or RGB image, atomically."""
    is_encoded, content = cv2.imencode(".png", image if image.ndim == 2 else image[..., ::-1])
    if not is_encoded:
        raise EtnetError(f"{path.name}: an image of shape {image.shape} cannot be written as PNG")
    write_atomically(path, content.tobytes())


def write_atomically(path: Path, content: bytes) -> None:
    """Write a whole file or nothing."""
    check_target(path)
    temporary = path.with_name(f"{path.name}.{os.getpid()}.tmp")
    try:
        temporary.write_bytes(content)
        os.replace(temporary, path)
    finally:
        temporary.unlink(missing_ok=True)

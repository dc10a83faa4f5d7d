"""uint8 images → PNG, JPEG and WebP bytes, and the data: URLs that a page shows."""

from __future__ import annotations

import base64

import cv2
import numpy as np
from jaxtyping import UInt8

Image = UInt8[np.ndarray, "h w"] | UInt8[np.ndarray, "h w 3"] | UInt8[np.ndarray, "h w 4"]


def png(image: Image) -> bytes:
    """Lossless; RGB or RGBA order."""
    return _encode(image, ".png", [cv2.IMWRITE_PNG_COMPRESSION, 1])


def jpeg(image: Image, quality: int = 88) -> bytes:
    """Small; for greys and photographs. RGB order, colour at full resolution."""
    options = [cv2.IMWRITE_JPEG_QUALITY, quality]
    options += [cv2.IMWRITE_JPEG_SAMPLING_FACTOR, cv2.IMWRITE_JPEG_SAMPLING_FACTOR_444]
    return _encode(image, ".jpg", options)


def webp(image: Image, quality: int | None) -> bytes:
    """Smaller than both, for files that have to be small; `quality` `None` is lossless. Grey, RGB or RGBA order."""
    return _encode(image, ".webp", [cv2.IMWRITE_WEBP_QUALITY, 101 if quality is None else quality])


def data_url(image: Image, is_lossless: bool) -> str:
    """The image inside a URL: PNG where every pixel counts, else JPEG."""
    kind, content = ("png", png(image)) if is_lossless else ("jpeg", jpeg(image))
    return f"data:image/{kind};base64,{base64.b64encode(content).decode('ascii')}"


def _encode(image: Image, suffix: str, options: list[int]) -> bytes:
    channels = 1 if image.ndim == 2 else image.shape[2]
    if channels == 3:
        image = cv2.cvtColor(image, cv2.COLOR_RGB2BGR)
    elif channels == 4:
        image = cv2.cvtColor(image, cv2.COLOR_RGBA2BGRA)
    return cv2.imencode(suffix, image, options)[1].tobytes()

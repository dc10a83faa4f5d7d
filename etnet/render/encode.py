"""uint8 images → PNG, JPEG and WebP bytes, and the data: URLs that a page shows."""

from __future__ import annotations

import base64
import io
from dataclasses import dataclass

import cv2
import numpy as np
import PIL.Image
from jaxtyping import UInt8

Image = UInt8[np.ndarray, "h w"] | UInt8[np.ndarray, "h w 3"] | UInt8[np.ndarray, "h w 4"]


@dataclass(frozen=True, slots=True, eq=False)
class Indexed:
    """An image of few colours by their numbers: a third of the bytes, and a fraction of the work to write it."""

    level: UInt8[np.ndarray, "h w"]
    palette: UInt8[np.ndarray, "n 3"]
    """At most 256 colours."""

    @property
    def colours(self) -> UInt8[np.ndarray, "h w 3"]:
        """The same as an RGB image."""
        return self.palette[self.level]

    @property
    def nbytes(self) -> int:
        """Bytes of its pixels."""
        return self.level.nbytes


def png(image: Image | Indexed) -> bytes:
    """Lossless; RGB or RGBA order."""
    if isinstance(image, Indexed):
        return _indexed_png(image)
    return _encode(image, ".png", [cv2.IMWRITE_PNG_COMPRESSION, 1])


def jpeg(image: Image, quality: int = 88) -> bytes:
    """Small; for greys and photographs. RGB order, colour at full resolution."""
    options = [cv2.IMWRITE_JPEG_QUALITY, quality]
    options += [cv2.IMWRITE_JPEG_SAMPLING_FACTOR, cv2.IMWRITE_JPEG_SAMPLING_FACTOR_444]
    return _encode(image, ".jpg", options)


def webp(image: Image, quality: int | None) -> bytes:
    """Smaller than both, for files that have to be small; `quality` `None` is lossless. Grey, RGB or RGBA order."""
    return _encode(image, ".webp", [cv2.IMWRITE_WEBP_QUALITY, 101 if quality is None else quality])


def data_url(image: Image | Indexed, is_lossless: bool) -> str:
    """The image inside a URL: PNG where every pixel counts, else JPEG; an image of few colours is a PNG."""
    if is_lossless or isinstance(image, Indexed):
        kind, content = "png", png(image)
    else:
        kind, content = "jpeg", jpeg(image)
    return f"data:image/{kind};base64,{base64.b64encode(content).decode('ascii')}"


def _indexed_png(image: Indexed) -> bytes:
    """OpenCV writes no palettes."""
    picture = PIL.Image.fromarray(image.level, "P")
    picture.putpalette(image.palette.tobytes())
    content = io.BytesIO()
    picture.save(content, "PNG", compress_level=1)
    return content.getvalue()


def _encode(image: Image, suffix: str, options: list[int]) -> bytes:
    channels = 1 if image.ndim == 2 else image.shape[2]
    if channels == 3:
        image = cv2.cvtColor(image, cv2.COLOR_RGB2BGR)
    elif channels == 4:
        image = cv2.cvtColor(image, cv2.COLOR_RGBA2BGRA)
    return cv2.imencode(suffix, image, options)[1].tobytes()

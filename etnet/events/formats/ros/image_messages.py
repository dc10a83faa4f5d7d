"""ROS messages with pictures: sensor_msgs/Image in the encodings that cameras use, and sensor_msgs/CompressedImage."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from jaxtyping import Shaped

from etnet.events.formats.bounds import check_picture
from etnet.events.formats.ros.messages import Cursor

RAW_IMAGES = ("sensor_msgs/Image",)
COMPRESSED_IMAGES = ("sensor_msgs/CompressedImage",)
IMAGES = RAW_IMAGES + COMPRESSED_IMAGES

_PIXELS = {
    "mono8": ("u1", 1),
    "8UC1": ("u1", 1),
    "mono16": ("<u2", 1),
    "16UC1": ("<u2", 1),
    "bgr8": ("u1", 3),
    "8UC3": ("u1", 3),
    "rgb8": ("u1", 3),
    "bgra8": ("u1", 4),
    "8UC4": ("u1", 4),
    "rgba8": ("u1", 4),
    "bgr16": ("<u2", 3),
    "rgb16": ("<u2", 3),
    "yuv422": ("u1", 2),
    "uyvy": ("u1", 2),
    "yuv422_yuy2": ("u1", 2),
    "yuyv": ("u1", 2),
}
_BRIGHTNESS = {"yuv422": 1, "uyvy": 1, "yuv422_yuy2": 0, "yuyv": 0}
"""Which of a pixel's two bytes is its brightness."""

_BAYER = {
    "rggb": cv2.COLOR_BayerBG2GRAY,
    "bggr": cv2.COLOR_BayerRG2GRAY,
    "gbrg": cv2.COLOR_BayerGR2GRAY,
    "grbg": cv2.COLOR_BayerGB2GRAY,
}
"""OpenCV names a mosaic by its second row and column, ROS by its first."""


class UnreadPicture(ValueError):
    """A picture in a form that is not read; its message is the form's name."""


@dataclass(frozen=True)
class Picture:
    """A picture's pixels; `stamp` in ns."""

    stamp: int
    pixels: Shaped[np.ndarray, ...]
    is_bgr: bool
    encoding: str = ""


def parse_picture(content: bytes, is_cdr: bool) -> Picture:
    """A sensor_msgs/Image with 8 or 16 bits a channel; a mosaic of colours (Bayer) becomes grey."""
    cursor = Cursor(content, is_cdr)
    stamp = cursor.header()
    height, width, encoding = cursor.number("I"), cursor.number("I"), cursor.text()
    is_big_endian, step = cursor.number("B"), cursor.number("I")
    octets = cursor.octets()
    mosaic = encoding.removeprefix("bayer_")[:4] if encoding.startswith("bayer_") else ""
    bayer_code = "<u2" if encoding.endswith("16") else "u1"
    code, channels = (bayer_code, 1) if mosaic in _BAYER else _PIXELS.get(encoding, ("", 0))
    if not channels:
        raise UnreadPicture(encoding[:40])
    row = width * channels * np.dtype(code).itemsize
    if not (width and height) or step < row or len(octets) < step * height:
        raise ValueError(f"a picture of {width} × {height} that ends early")
    rows = np.frombuffer(octets, np.uint8, step * height).reshape(height, step)[:, :row]
    pixels = np.ascontiguousarray(rows).view(code if not is_big_endian else code.replace("<", ">"))
    pixels = pixels.astype(pixels.dtype.newbyteorder("="))
    if mosaic in _BAYER:
        # OpenCV's filter wants two pixels a side.
        pixels = cv2.cvtColor(pixels, _BAYER[mosaic]) if min(width, height) > 2 else pixels
    elif encoding in _BRIGHTNESS:
        pixels = np.ascontiguousarray(pixels[:, _BRIGHTNESS[encoding] :: 2])
    elif channels > 1:
        pixels = pixels.reshape(height, width, channels)
    return Picture(stamp, pixels, encoding.startswith("bgr") or encoding in ("8UC3", "8UC4"), encoding)


def parse_compressed(content: bytes, is_cdr: bool, max_pixels: int) -> Picture:
    """A sensor_msgs/CompressedImage with a PNG or JPEG; depth, which has a head of its own, is not read."""
    cursor = Cursor(content, is_cdr)
    stamp = cursor.header()
    form = cursor.text()
    if "compressedDepth" in form or form in ("h264", "hevc", "h265"):
        raise UnreadPicture(form[:40])
    octets = cursor.octets()
    check_picture(octets, "the picture", max_pixels)
    pixels = cv2.imdecode(np.frombuffer(octets, np.uint8), cv2.IMREAD_UNCHANGED)
    if pixels is None:
        raise ValueError(f'a compressed picture ("{form[:40]}") that cannot be decoded')
    mosaic = form.partition(";")[0].strip().removeprefix("bayer_")[:4]
    if pixels.ndim == 2 and form.startswith("bayer_") and mosaic in _BAYER:
        pixels = cv2.cvtColor(pixels, _BAYER[mosaic])
    return Picture(stamp, pixels, True, f"compressed {form[:40]}")

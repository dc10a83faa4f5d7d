"""A camera's pictures: files of one picture each as numbers, and frames in the order of time."""

from __future__ import annotations

import cv2
import numpy as np
from jaxtyping import Shaped

from etnet.errors import RecordingError
from etnet.events.formats.base import Remarks, contained
from etnet.events.formats.bounds import MAX_PIXELS, check_picture
from etnet.events.recording import GroundTruth


def picture_numbers(content: bytes, label: str, max_pixels: int = MAX_PIXELS) -> Shaped[np.ndarray, ...]:
    """PNG, JPEG and what else `check_picture` knows, as it is stored: colours are blue, green, red.

    The header is looked at before anything is decoded. `label` begins with the recording's name.
    """
    check_picture(content, label, max_pixels)
    with contained(label, "the picture"):
        picture = cv2.imdecode(np.frombuffer(content, np.uint8), cv2.IMREAD_UNCHANGED)
    if picture is None:
        raise RecordingError(f"{label}: not a picture that can be read; it may be truncated")
    return picture


def in_order(stamps: np.ndarray, truth: GroundTruth, remarks: Remarks) -> GroundTruth:
    """Frames in the order of their stamps."""
    if len(stamps) < 2 or bool((np.diff(stamps) >= 0).all()):
        return truth
    order = np.argsort(stamps, kind="stable")
    remarks.repaired("frames were not in the order of their stamps and were sorted")
    read_flow, read_colour = truth.read_flow, truth.read_colour
    return GroundTruth(
        stamps[order],
        lambda i: truth.read_frame(int(order[i])),
        None if read_flow is None else lambda i: read_flow(int(order[i])),
        truth.white,
        None if read_colour is None else lambda i: read_colour(int(order[i])),
    )

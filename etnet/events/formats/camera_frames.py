"""Camera pictures as files, and the table of their stamps: the Event-Camera Dataset's images.txt ("t images/….png")."""

from __future__ import annotations

from decimal import ROUND_HALF_EVEN, Decimal, InvalidOperation
from threading import Lock

import cv2
import numpy as np
from jaxtyping import Float32

from etnet.errors import RecordingError
from etnet.events.assumptions import TimeUnit
from etnet.events.cache import grey
from etnet.events.formats.archive import Store, read_small
from etnet.events.formats.base import Remarks, contained
from etnet.events.formats.columns import stamps_in_microseconds
from etnet.events.recording import GroundTruth

LARGEST_SIDE = 4096
"""Pixels of a picture's side: as many as those of a sensor that is deduced."""


def picture_list(
    store: Store, events_member: str, label: str, remarks: Remarks, unit: TimeUnit | None
) -> GroundTruth | None:
    """The pictures beside `events_member`; None where there is no images.txt. They are read one at a time."""
    folder = events_member.rpartition("/")[0]
    prefix = folder + "/" if folder else ""
    table = prefix + "images.txt"
    names = set(store.names())
    if table not in names:
        return None
    stamps: list[int] = []
    files: list[str] = []
    missing = 0
    for number, line in enumerate(read_small(store, table, label).decode("utf-8", "replace").splitlines(), 1):
        tokens = line.split()
        if not tokens or tokens[0].startswith("#"):
            continue
        if len(tokens) != 2:
            raise RecordingError(f'{label}: line {number} of images.txt reads "{line[:60]}"; wanted "stamp file"')
        if prefix + tokens[1] not in names:
            missing += 1
            continue
        stamps.append(_stamp(tokens[0], unit, label, number))
        files.append(prefix + tokens[1])
    if missing:
        remarks.repaired(f"{missing} pictures that images.txt names are missing and were left out")
    if not files:
        return None
    lock = Lock()

    def read_frame(index: int) -> Float32[np.ndarray, "h w"]:
        with lock:
            return decoded_picture(read_small(store, files[index], label), f"{label}: {files[index]}")

    return in_order(np.array(stamps, np.int64), GroundTruth(np.array(stamps, np.int64), read_frame), remarks)


def decoded_picture(content: bytes, label: str) -> Float32[np.ndarray, "h w"]:
    """PNG, JPEG and what else OpenCV reads, as grey in 0 … 1."""
    with contained(label, "the picture"):
        picture = cv2.imdecode(np.frombuffer(content, np.uint8), cv2.IMREAD_UNCHANGED)
    if picture is None:
        raise RecordingError(f"{label}: not a picture that can be read; it may be truncated")
    return grey(picture, is_bgr=True)


def check_size(shape: tuple[int, ...], label: str) -> None:
    """An error for a picture (height, width, …) that is larger than any camera beside an event sensor takes."""
    if max(shape[:2], default=0) > LARGEST_SIDE:
        sides = " × ".join(map(str, shape))
        raise RecordingError(f"{label} has {sides} pixels; at most {LARGEST_SIDE} a side are read: make it smaller")


def in_order(stamps: np.ndarray, truth: GroundTruth, remarks: Remarks) -> GroundTruth:
    """Frames in the order of their stamps."""
    if len(stamps) < 2 or bool((np.diff(stamps) >= 0).all()):
        return truth
    order = np.argsort(stamps, kind="stable")
    remarks.repaired("frames were not in the order of their stamps and were sorted")
    read_flow = truth.read_flow
    return GroundTruth(
        stamps[order],
        lambda i: truth.read_frame(int(order[i])),
        None if read_flow is None else lambda i: read_flow(int(order[i])),
    )


def _stamp(token: str, unit: TimeUnit | None, label: str, number: int) -> int:
    try:
        value = Decimal(token)
        if unit is None or unit == "s":
            return int((value * 10**6).to_integral_value(ROUND_HALF_EVEN))
        return int(stamps_in_microseconds(np.array([int(value)]), unit, label)[0])
    except (InvalidOperation, ValueError, OverflowError) as slip:
        raise RecordingError(f'{label}: line {number} of images.txt has the stamp "{token}"; wanted a number') from slip

"""What a small foreign file may cost: sizes are judged by headers, before anything is decoded or allocated."""

import struct

import cv2
import numpy as np
import pytest

from etnet.errors import RecordingError
from etnet.events.events import Sensor
from etnet.events.formats import bounds
from etnet.events.formats.bounds import (
    Unpacked,
    check_bytes,
    check_growth,
    check_picture,
    declared_sensor,
    picture_size,
)


@pytest.mark.parametrize("suffix", [".png", ".jpg", ".bmp", ".webp", ".tif", ".pgm", ".ppm"])
@pytest.mark.parametrize("shape", [(7, 300), (61, 5), (40, 30, 3)])
def test_a_picture_tells_its_size_by_its_header(suffix, shape):
    if suffix == ".pgm" and len(shape) == 3:
        suffix = ".png"
    if suffix == ".ppm" and len(shape) == 2:
        shape = (*shape, 3)
    fine, content = cv2.imencode(suffix, np.zeros(shape, np.uint8))
    assert fine
    assert picture_size(content.tobytes()) == shape[:2]


def test_a_lossless_webp_tells_its_size_too():
    content = cv2.imencode(".webp", np.zeros((9, 11, 3), np.uint8), [cv2.IMWRITE_WEBP_QUALITY, 101])[1].tobytes()
    assert picture_size(content) == (9, 11)


@pytest.mark.parametrize(
    "content", [b"", b"\x89PNG\r\n\x1a\n", b"\xff\xd8\xff\xe0\x00", b"BM", b"II*\x00", b"P5 #", b"xyz"]
)
def test_what_breaks_off_or_is_no_picture_has_no_size(content):
    assert picture_size(content) is None
    with pytest.raises(RecordingError, match="not a picture"):
        check_picture(content, "a.zip: b.png")


def test_a_vast_picture_is_refused_by_its_header():
    header = b"\x89PNG\r\n\x1a\n" + struct.pack(">I4sIIBBBBB", 13, b"IHDR", 32_000, 32_000, 16, 2, 0, 0, 0)
    with pytest.raises(RecordingError, match=r"32000 × 32000 pixels.*--max-pixels"):
        check_picture(header, "a.zip: b.png")
    assert check_picture(header, "a.zip: b.png", 1 << 30) == (32_000, 32_000)


def test_a_declared_sensor_is_bounded_and_can_be_allowed():
    assert declared_sensor(np.int32(640), "480", "a.h5") == Sensor(640, 480)
    with pytest.raises(RecordingError, match="--max-pixels 4294967296"):
        declared_sensor(65_536, 65_536, "a.h5")
    assert declared_sensor(65_536, 65_536, "a.h5", 1 << 32) == Sensor(65_536, 65_536)


@pytest.mark.parametrize(
    "sides", [(0, 5), (5, -1), (5.5, 5), (float("nan"), 5), (70_000, 5), ("x", 5), ([1, 2], 5), (None, 5)]
)
def test_what_is_no_size_is_one_clear_error(sides):
    with pytest.raises(RecordingError, match="gives the sensor"):
        declared_sensor(*sides, "a.h5")


def test_what_grows_like_a_bomb_is_stopped(monkeypatch):
    monkeypatch.setattr(bounds, "FREE_SIZE", 1000)
    check_growth(10, 2000, "a.zip")
    with pytest.raises(RecordingError, match="bomb"):
        check_growth(10, 2001, "a.zip")
    unpacked = Unpacked(10, "a.gz")
    unpacked.take(2000)
    with pytest.raises(RecordingError, match="bomb"):
        unpacked.take(1)


def test_a_record_of_absurd_size_is_refused():
    check_bytes(1 << 20, "a.bag: message 3")
    for count in (-1, 1 << 40):
        with pytest.raises(RecordingError, match="message 3 asks for"):
            check_bytes(count, "a.bag: message 3")

"""What a small foreign file may cost: sizes are judged by headers, before anything is decoded or allocated."""

import gzip
import struct

import cv2
import numpy as np
import pytest

from etnet.cli.main import main
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
from etnet.events.stated import Stated


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


@pytest.fixture
def tight(monkeypatch):
    """Whatever unpacks to more than its own size and 1,000 bytes is a bomb; nothing is allowed beyond it."""
    for name, value in {"FREE_SIZE": 1000, "MAX_RATIO": 1, "_allowed": 0}.items():
        monkeypatch.setattr(bounds, name, value)


def test_what_may_be_unpacked_can_be_lifted(tight):
    with pytest.raises(RecordingError, match="--unpack-limit"):
        check_growth(10, 2 << 20, "a.zip")
    bounds.allow_unpacking(2 << 20)
    check_growth(10, 2 << 20, "a.zip")
    Unpacked(10, "a.gz").take(2 << 20)
    check_bytes(2 << 20, "a.bag: message 3", limit=1 << 20)
    for refused in (lambda: check_growth(10, (2 << 20) + 1, "a.zip"), lambda: Unpacked(10, "a.gz").take((2 << 20) + 1)):
        with pytest.raises(RecordingError, match="bomb"):
            refused()
    assert bounds.at_most(4 << 20) == 4 << 20


def test_a_command_line_lifts_it_for_its_own_files(tight, tmp_path, capsys):
    rows = "".join(f"{i / 1e4:.4f} {i % 20} {i % 12} {i % 2}\n" for i in range(4000))
    (tmp_path / "a.txt.gz").write_bytes(gzip.compress(rows.encode()))
    command = ["inspect", str(tmp_path / "a.txt.gz")]
    assert main(command) == 1
    said = capsys.readouterr().err.strip()
    assert "--unpack-limit" in said
    assert "\n" not in said
    assert main([*command, "--unpack-limit", "1"]) == 0
    assert "4,000" in capsys.readouterr().out


@pytest.mark.parametrize("limit", [0, -1, 1 << 30])
def test_a_limit_that_makes_no_sense_is_refused(limit):
    with pytest.raises(RecordingError, match="--unpack-limit"):
        Stated(unpack_limit=limit)


def test_a_record_of_absurd_size_is_refused():
    check_bytes(1 << 20, "a.bag: message 3")
    for count in (-1, 1 << 40):
        with pytest.raises(RecordingError, match="message 3 asks for"):
            check_bytes(count, "a.bag: message 3")

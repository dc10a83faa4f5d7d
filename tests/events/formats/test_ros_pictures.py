"""The pictures of ROS recordings, in the forms that cameras publish, and whose they are."""

from __future__ import annotations

import sqlite3

import cv2
import numpy as np
import pytest

from etnet.errors import RecordingError
from etnet.events.formats.ros.image_messages import UnreadPicture, parse_compressed, parse_picture
from etnet.events.open import Assumptions, open_recording
from tests.events.formats.test_ros import event_array, header_of, serialise, store_of
from tests.strategies import make_events

STORES = {is_cdr: store_of(is_cdr) for is_cdr in (False, True)}
EVENTS = event_array(make_events(50), STORES[True], True)
TYPES = {
    "events": "dvs_msgs/msg/EventArray",
    "raw": "sensor_msgs/msg/Image",
    "packed": "sensor_msgs/msg/CompressedImage",
}
ANY_SIZE = 1 << 24


def raw_picture(pixels: np.ndarray, encoding: str, is_cdr: bool = True) -> bytes:
    store = STORES[is_cdr]
    rows = np.ascontiguousarray(pixels).reshape(pixels.shape[0], -1).view(np.uint8)
    fields = {"height": pixels.shape[0], "width": pixels.shape[1], "encoding": encoding, "is_bigendian": 0}
    message = store.types[TYPES["raw"]](
        header=header_of(store, is_cdr, "x"), step=rows.shape[1], data=rows.reshape(-1), **fields
    )
    return serialise(store, message, TYPES["raw"], is_cdr)


def packed_picture(content: bytes, form: str, is_cdr: bool = True) -> bytes:
    store = STORES[is_cdr]
    octets = np.frombuffer(content, np.uint8)
    message = store.types[TYPES["packed"]](header=header_of(store, is_cdr, "x"), format=form, data=octets)
    return serialise(store, message, TYPES["packed"], is_cdr)


def encoded(pixels: np.ndarray, suffix: str) -> bytes:
    return cv2.imencode(suffix, pixels)[1].tobytes()


def record(path, messages: list[tuple[str, str, bytes]]):
    """Messages as (topic, kind, content) in their order."""
    database = sqlite3.connect(path)
    database.execute("CREATE TABLE topics(id INTEGER PRIMARY KEY, name TEXT, type TEXT)")
    database.execute("CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id INTEGER, timestamp INTEGER, data BLOB)")
    topics = list(dict.fromkeys((topic, kind) for topic, kind, _ in messages))
    rows = [(number, topic, TYPES[kind]) for number, (topic, kind) in enumerate(topics)]
    database.executemany("INSERT INTO topics VALUES (?, ?, ?)", rows)
    rows = [(topics.index((topic, kind)), time, content) for time, (topic, kind, content) in enumerate(messages)]
    database.executemany("INSERT INTO messages(topic_id, timestamp, data) VALUES (?, ?, ?)", rows)
    database.commit()
    database.close()
    return path


COLOURS = np.zeros((8, 12, 3), np.uint8)
COLOURS[:, :4], COLOURS[:, 4:8], COLOURS[:, 8:] = (255, 0, 0), (0, 255, 0), (0, 0, 255)
"""Red, green and blue, as RGB."""


@pytest.mark.parametrize("pattern", ["rggb", "bggr", "gbrg", "grbg"])
@pytest.mark.parametrize("bits", [8, 16])
@pytest.mark.parametrize("is_cdr", [False, True])
def test_a_mosaic_becomes_the_brightness_of_its_colours(pattern, bits, is_cdr):
    places = np.array([["rgb".index(letter) for letter in pattern]]).reshape(2, 2)
    tiled = np.tile(places, (4, 6))
    mosaic = np.take_along_axis(COLOURS, tiled[:, :, None], 2)[:, :, 0].astype(f"u{bits // 8}") * (
        257 if bits == 16 else 1
    )
    picture = parse_picture(raw_picture(mosaic, f"bayer_{pattern}{bits}", is_cdr), is_cdr)
    full = 65_535 if bits == 16 else 255
    for column, weight in ((1, 0.299), (5, 0.587), (10, 0.114)):
        assert picture.pixels[4, column] / full == pytest.approx(weight, abs=0.02)


@pytest.mark.parametrize(("encoding", "place"), [("yuv422", 1), ("yuv422_yuy2", 0)])
def test_of_a_picture_in_yuv_the_brightness_is_taken(encoding, place):
    brightness = np.arange(24, dtype=np.uint8).reshape(4, 6)
    pixels = np.full((4, 6, 2), 128, np.uint8)
    pixels[:, :, place] = brightness
    np.testing.assert_array_equal(parse_picture(raw_picture(pixels, encoding), True).pixels, brightness)


@pytest.mark.parametrize("is_cdr", [False, True])
@pytest.mark.parametrize(("suffix", "form"), [(".png", "png"), (".jpg", "mono8; jpeg compressed mono8")])
def test_compressed_pictures_of_both_serialisations(is_cdr, suffix, form):
    pixels = np.tile(np.arange(0, 240, 10, np.uint8), (16, 1))
    picture = parse_compressed(packed_picture(encoded(pixels, suffix), form, is_cdr), is_cdr, ANY_SIZE)
    assert picture.stamp == 5_000_001_500
    np.testing.assert_allclose(picture.pixels.astype(int), pixels, atol=0 if suffix == ".png" else 6)


def test_a_vast_compressed_picture_is_refused_by_its_header():
    content = packed_picture(encoded(np.zeros((300, 400), np.uint8), ".png"), "png")
    with pytest.raises(RecordingError, match="400 × 300"):
        parse_compressed(content, True, 100_000)


def test_depth_and_what_no_camera_writes_are_named_not_guessed():
    with pytest.raises(UnreadPicture, match="32FC1"):
        parse_picture(raw_picture(np.zeros((4, 6), np.float32), "32FC1"), True)
    with pytest.raises(UnreadPicture, match="compressedDepth"):
        parse_compressed(packed_picture(b"\0" * 20, "16UC1; compressedDepth"), True, ANY_SIZE)


def grey(value: int) -> bytes:
    return raw_picture(np.full((12, 20), value, np.uint8), "mono8")


def packed_grey(value: int) -> bytes:
    return packed_picture(encoded(np.full((12, 20), value, np.uint8), ".png"), "png")


def shown(path, topic: str | None = None) -> tuple[float, str]:
    with open_recording(path, assume=Assumptions(topic=topic)) as recording:
        frame = recording.ground_truth.read_frame(0) if recording.ground_truth is not None else np.array(-1)
        return round(float(frame.mean()) * 255), "\n".join(map(str, recording.remarks))


def test_compressed_pictures_alone_are_shown(tmp_path):
    path = record(
        tmp_path / "a.db3",
        [("/dvs/events", "events", EVENTS), ("/dvs/image_raw/compressed", "packed", packed_grey(90))],
    )
    assert shown(path)[0] == 90


@pytest.mark.parametrize("is_turned", [False, True])
def test_of_topics_equally_near_the_cameras_own_picture_is_shown(tmp_path, is_turned):
    pictures = [
        ("/dvs/dvs_rendering", "raw", grey(10)),
        ("/dvs/image_rect", "raw", grey(20)),
        ("/dvs/image_raw/compressed", "packed", packed_grey(30)),
        ("/dvs/image_raw", "raw", grey(40)),
    ]
    messages = [("/dvs/events", "events", EVENTS), *(pictures[::-1] if is_turned else pictures)]
    assert shown(record(tmp_path / "a.db3", messages))[0] == 40


def test_an_encoding_that_is_dropped_is_named(tmp_path):
    odd = raw_picture(np.zeros((12, 20), np.float32), "32FC1")
    path = record(tmp_path / "a.db3", [("/dvs/events", "events", EVENTS), *[("/dvs/image_raw", "raw", odd)] * 3])
    value, said = shown(path)
    assert value == -255
    assert '3 pictures of /dvs/image_raw in "32FC1", which is not read' in said


def test_a_damaged_picture_costs_neither_the_events_nor_the_others(tmp_path):
    broken = packed_picture(encoded(np.zeros((12, 20), np.uint8), ".png")[:40], "png")
    messages = [
        ("/dvs/events", "events", EVENTS),
        *(("/dvs/c", "packed", content) for content in (packed_grey(70), broken)),
    ]
    value, said = shown(record(tmp_path / "a.db3", messages))
    assert value == 70
    assert "1 pictures that are damaged" in said


def two_cameras(tmp_path):
    other = event_array(make_events(20), STORES[True], True)
    return record(
        tmp_path / "a.db3",
        [
            ("/left/events", "events", EVENTS),
            ("/right/events", "events", other),
            ("/left/image_raw", "raw", grey(10)),
            ("/right/image_raw", "raw", grey(20)),
        ],
    )


@pytest.mark.parametrize(
    ("topic", "num_events", "value"),
    [
        (None, 50, 10),
        ("/right/events", 20, 20),
        ("/right/events,/left/image_raw", 20, 10),
        (",/right/image_raw", 50, 20),
    ],
)
def test_of_two_cameras_a_person_chooses(tmp_path, topic, num_events, value):
    path = two_cameras(tmp_path)
    assert shown(path, topic)[0] == value
    with open_recording(path, assume=Assumptions(topic=topic)) as recording:
        assert recording.num_events == num_events


def test_a_topic_that_is_not_there_is_refused_with_those_that_are(tmp_path):
    with pytest.raises(RecordingError, match="/left/events, /right/events"):
        open_recording(two_cameras(tmp_path), assume=Assumptions(topic="/middle/events"))
    assert "/left/image_raw, /right/image_raw" in shown(two_cameras(tmp_path / ".."), ",/middle/image")[1]


def test_a_recording_without_events_tells_its_topics(tmp_path):
    path = record(tmp_path / "a.db3", [("/cam/image_raw", "raw", grey(1))])
    with pytest.raises(RecordingError, match=r"it holds /cam/image_raw \(sensor_msgs/Image\)"):
        open_recording(path)


@pytest.mark.parametrize(("bits", "is_told"), [(10, True), (12, True), (16, False)])
def test_pictures_of_fewer_bits_than_their_type_are_as_bright_as_they_were(tmp_path, bits, is_told):
    pixels = np.full((12, 20), (1 << bits) // 2, np.uint16)
    pixels[0, 0] = (1 << bits) - 1
    picture = raw_picture(pixels, "mono16")
    value, said = shown(record(tmp_path / "a.db3", [("/dvs/events", "events", EVENTS), ("/dvs/i", "raw", picture)]))
    assert value == 128
    assert ("was taken for white" in said) == is_told

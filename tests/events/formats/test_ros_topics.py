"""Of several cameras in one ROS recording, events and pictures are those of one."""

from __future__ import annotations

import sqlite3

import numpy as np
import pytest

from etnet.errors import RecordingError
from etnet.events import cache
from etnet.events.open import open_recording
from tests.events.formats.test_ros import event_array, header_of, serialise, store_of
from tests.strategies import make_events

LEFT, RIGHT = "/davis/left", "/davis/right"
STORE = store_of(True)


def picture(grey: int, size: tuple[int, int] = (12, 20)) -> bytes:
    kind = STORE.types["sensor_msgs/msg/Image"]
    pixels = np.full(size[0] * size[1], grey, np.uint8)
    fields = {"height": size[0], "width": size[1], "encoding": "mono8", "is_bigendian": 0, "step": size[1]}
    return serialise(
        STORE, kind(header=header_of(STORE, True, "c"), data=pixels, **fields), "sensor_msgs/msg/Image", True
    )


def record(path, messages: list[tuple[str, bytes]]) -> None:
    """Messages in their order; a topic named "…events" holds arrays of events, any other pictures."""
    database = sqlite3.connect(path)
    database.execute("CREATE TABLE topics(id INTEGER PRIMARY KEY, name TEXT, type TEXT)")
    database.execute("CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id INTEGER, timestamp INTEGER, data BLOB)")
    topics = list(dict.fromkeys(topic for topic, _ in messages))
    for number, topic in enumerate(topics):
        kind = "dvs_msgs/msg/EventArray" if topic.endswith("events") else "sensor_msgs/msg/Image"
        database.execute("INSERT INTO topics VALUES (?, ?, ?)", (number, topic, kind))
    rows = [(topics.index(topic), time, content) for time, (topic, content) in enumerate(messages)]
    database.executemany("INSERT INTO messages(topic_id, timestamp, data) VALUES (?, ?, ?)", rows)
    database.commit()
    database.close()


EVENTS = ("{}/events", event_array(make_events(50), STORE, True))
PICTURES = {LEFT: (f"{LEFT}/image_raw", picture(50)), RIGHT: (f"{RIGHT}/image_raw", picture(200))}


@pytest.mark.parametrize("order", ["left right events", "right left events", "events right left", "right events left"])
@pytest.mark.parametrize("side", [LEFT, RIGHT])
def test_the_pictures_are_those_of_the_events_camera(side, order, tmp_path, monkeypatch):
    monkeypatch.setattr(cache, "MEMORY_CAP", 1000)  # all of it goes through the scratch files
    path = tmp_path / "a.db3"
    events = (EVENTS[0].format(side), EVENTS[1])
    parts = {"left": [PICTURES[LEFT]] * 5, "right": [PICTURES[RIGHT]] * 7, "events": [events]}
    record(path, [message for name in order.split() for message in parts[name]])
    with open_recording(path) as recording:
        truth = recording.ground_truth
        assert len(truth) == (5 if side == LEFT else 7)
        for index in range(len(truth)):
            np.testing.assert_allclose(truth.read_frame(index) * 255, 50 if side == LEFT else 200, rtol=1e-5)
        said = [remark.text for remark in recording.remarks]
        other = RIGHT if side == LEFT else LEFT
        assert any(f"{side}/image_raw" in text and f"{other}/image_raw" in text for text in said)


def test_one_picture_topic_is_taken_without_a_word_wherever_it_is(tmp_path):
    record(tmp_path / "a.db3", [PICTURES[RIGHT], ("/dvs/events", EVENTS[1])])
    with open_recording(tmp_path / "a.db3") as recording:
        assert len(recording.ground_truth) == 1
        assert not any("image_raw" in remark.text for remark in recording.remarks)


def test_of_topics_equally_near_the_first_is_taken_and_that_is_said(tmp_path):
    first, second = ("/a/image_raw", picture(10)), ("/b/image_raw", picture(20))
    record(tmp_path / "a.db3", [first, second, ("/dvs/events", EVENTS[1]), first, second])
    with open_recording(tmp_path / "a.db3") as recording:
        assert len(recording.ground_truth) == 2
        np.testing.assert_allclose(recording.ground_truth.read_frame(1) * 255, 10, rtol=1e-5)
        assert any("/a/image_raw" in remark.text and "/b/image_raw" in remark.text for remark in recording.remarks)


def test_pictures_left_out_are_counted_of_the_topic_that_is_shown(tmp_path):
    odd = (PICTURES[RIGHT][0], picture(1, (3, 3)))
    record(tmp_path / "a.db3", [PICTURES[RIGHT], odd, PICTURES[LEFT], (f"{LEFT}/events", EVENTS[1])])
    with open_recording(tmp_path / "a.db3") as recording:
        assert not any("left out" in remark.text for remark in recording.remarks)


def test_of_two_event_topics_both_are_told(tmp_path):
    record(tmp_path / "a.db3", [(f"{RIGHT}/events", EVENTS[1]), (f"{LEFT}/events", EVENTS[1]), PICTURES[LEFT]])
    with open_recording(tmp_path / "a.db3") as recording:
        said = [remark.text for remark in recording.remarks]
        assert any(f"events of topic {RIGHT}/events" in text for text in said)
        assert any(f"{LEFT}/events" in text for text in said)


@pytest.mark.parametrize("name", ["/davis/\nleft/events", "/" + "x" * 5_000 + "/image", "/a" * 3_000 + "/events"])
def test_a_damaged_name_of_a_topic_is_one_short_line(name, tmp_path):
    path = tmp_path / "a.db3"
    record(path, [(name, EVENTS[1] if name.endswith("events") else picture(9))])
    try:
        with open_recording(path) as recording:
            said = [remark.text for remark in recording.remarks]
    except RecordingError as error:
        said = [str(error)]
    assert said
    assert all("\n" not in text and len(text) < 1_000 for text in said)

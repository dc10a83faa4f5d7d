"""Triggers that a ROS driver publishes beside the events, as stamps on a topic of their own."""

from __future__ import annotations

import pytest
from rosbags.rosbag1 import Writer as Bag
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as Folder

from etnet.events.open import open_recording
from tests.events.formats.test_ros import event_array, header_of, serialise, store_of
from tests.strategies import make_events

EVENTS = make_events(50)


def stamped(store, kind: str, micros: int, is_cdr: bool) -> bytes:
    stamp = store.types["builtin_interfaces/msg/Time"](sec=micros // 10**6, nanosec=micros % 10**6 * 1000)
    header = header_of(store, is_cdr, "cam")
    header = type(header)(**{**vars(header), "stamp": stamp})
    if kind.endswith("Time"):
        message = store.types[kind](data=stamp) if "std_msgs" in kind else stamp
    elif kind.endswith("Bool"):
        message = store.types[kind](data=True)
    else:
        message = header
        if kind.endswith("TimeReference"):
            message = store.types[kind](header=header, time_ref=stamp, source="pps")
    return serialise(store, message, kind, is_cdr)


def record(path, is_cdr: bool, topics: dict[str, tuple[str, list[int]]]):
    """A bag of ROS 1, or a folder of ROS 2: the events, then the triggers of each topic."""
    store, array = store_of(is_cdr), "dvs_msgs/msg/EventArray"
    writer = Folder(path, version=9, storage_plugin=StoragePlugin.MCAP) if is_cdr else Bag(path)
    with writer:
        events = writer.add_connection("/dvs/events", array, typestore=store)
        writer.write(events, 0, event_array(EVENTS, store, is_cdr))
        for topic, (kind, stamps) in topics.items():
            connection = writer.add_connection(topic, kind, typestore=store)
            for micros in stamps:
                writer.write(connection, micros * 1000, stamped(store, kind, micros, is_cdr))
    return path


def opened(path):
    with open_recording(path) as recording:
        return recording.triggers, "\n".join(map(str, recording.remarks))


@pytest.mark.parametrize(
    ("is_cdr", "kind"),
    [
        (False, "std_msgs/msg/Time"),
        (False, "sensor_msgs/msg/TimeReference"),
        (False, "std_msgs/msg/Header"),
        (True, "builtin_interfaces/msg/Time"),
        (True, "sensor_msgs/msg/TimeReference"),
        (True, "std_msgs/msg/Header"),
    ],
)
def test_stamps_on_a_topic_of_triggers_are_triggers_of_an_input(tmp_path, is_cdr, kind):
    topics = {"/dvs/trigger_b": (kind, [700]), "/dvs/trigger_a": (kind, [30_000, 200]), "/gps/time": (kind, [5])}
    triggers, said = opened(record(tmp_path / ("a" if is_cdr else "a.bag"), is_cdr, topics))
    assert triggers is not None
    assert triggers.stamps.tolist() == [200, 700, 30_000]
    assert triggers.channels.tolist() == [0, 1, 0]
    assert triggers.edges.tolist() == [0, 0, 0]
    assert "input 0 are the triggers of topic /dvs/trigger_a" in said
    assert "gps" not in said


def test_triggers_that_cannot_be_read_or_placed_are_named(tmp_path):
    topics = {"/trigger": ("std_msgs/msg/Bool", [5]), "/trigger_host": ("std_msgs/msg/Header", [10**15])}
    triggers, said = opened(record(tmp_path / "a.bag", False, topics))
    assert triggers is None
    assert "topic /trigger (std_msgs/Bool) is not read" in said
    assert "1 triggers of /trigger_host are on another clock than the events" in said

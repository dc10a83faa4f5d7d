"""ROS messages parsed from raw bytes are what rosbags' generic serialiser wrote; containers change nothing."""

from __future__ import annotations

import sqlite3
import struct

import lz4.frame
import numpy as np
import pytest
from backports import zstd
from rosbags.rosbag1 import Writer as Ros1Writer
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from etnet.events.formats.ros.event_packets import decode_libcaer, decode_libcaer_cmp
from etnet.events.formats.ros.image_messages import parse_picture
from etnet.events.formats.ros.messages import Packet, parse_array, parse_packet
from etnet.events.open import open_recording
from tests.events.containers import all_events
from tests.strategies import make_events

EVENT = "uint16 x\nuint16 y\nbuiltin_interfaces/Time ts\nbool polarity\n"
ARRAY = "std_msgs/Header header\nuint32 height\nuint32 width\ndvs_msgs/Event[] events\n"
PACKET = (
    "std_msgs/Header header\nuint32 height\nuint32 width\nuint64 seq\nuint64 time_base\n"
    "string encoding\nbool is_bigendian\nuint8[] events\n"
)


def store_of(is_cdr: bool):
    store = get_typestore(Stores.ROS2_HUMBLE if is_cdr else Stores.ROS1_NOETIC)
    types = get_types_from_msg(EVENT, "dvs_msgs/msg/Event") | get_types_from_msg(ARRAY, "dvs_msgs/msg/EventArray")
    store.register(types | get_types_from_msg(PACKET, "event_camera_msgs/msg/EventPacket"))
    return store


def serialise(store, message, kind: str, is_cdr: bool) -> bytes:
    return bytes(store.serialize_cdr(message, kind) if is_cdr else store.serialize_ros1(message, kind))


def header_of(store, is_cdr: bool, frame: str):
    stamp = store.types["builtin_interfaces/msg/Time"](sec=5, nanosec=1500)
    extra = {} if is_cdr else {"seq": 1}
    return store.types["std_msgs/msg/Header"](stamp=stamp, frame_id=frame, **extra)


def event_array(events, store, is_cdr: bool, frame: str = "cam") -> bytes:
    time, event = store.types["builtin_interfaces/msg/Time"], store.types["dvs_msgs/msg/Event"]
    listed = [
        event(x=int(x), y=int(y), ts=time(sec=int(t) // 10**6, nanosec=int(t) % 10**6 * 1000), polarity=bool(p > 0))
        for x, y, t, p in zip(events.x, events.y, events.t, events.p, strict=True)
    ]
    kind = store.types["dvs_msgs/msg/EventArray"]
    message = kind(header=header_of(store, is_cdr, frame), height=12, width=20, events=listed)
    return serialise(store, message, "dvs_msgs/msg/EventArray", is_cdr)


@pytest.mark.parametrize("is_cdr", [False, True])
@pytest.mark.parametrize("count", [0, 1, 2, 3, 50])
@pytest.mark.parametrize("frame", ["", "c", "ca", "cam", "came"])
def test_event_arrays_of_both_serialisations(is_cdr, count, frame):
    events = make_events(count)
    array = parse_array(event_array(events, store_of(is_cdr), is_cdr, frame), is_cdr)
    assert (array.width, array.height) == (20, 12)
    np.testing.assert_array_equal(array.events.x, events.x)
    np.testing.assert_array_equal(array.events.y, events.y)
    np.testing.assert_array_equal(array.events.t, events.t)
    np.testing.assert_array_equal(np.asarray(array.events.p) > 0, events.p > 0)


PACKET_TYPE = "event_camera_msgs/msg/EventPacket"


def event_packet(payload: bytes, store, is_cdr: bool) -> bytes:
    fields = {"height": 7, "width": 9, "seq": 3, "time_base": 10**18 + 1, "encoding": "evt3", "is_bigendian": False}
    octets = np.frombuffer(payload, np.uint8)
    message = store.types[PACKET_TYPE](header=header_of(store, is_cdr, "c"), events=octets, **fields)
    return serialise(store, message, PACKET_TYPE, is_cdr)


@pytest.mark.parametrize("is_cdr", [False, True])
def test_packets_of_both_serialisations(is_cdr):
    payload = bytes(range(11))
    packet = parse_packet(event_packet(payload, store_of(is_cdr), is_cdr), is_cdr)
    assert packet == Packet(9, 7, 10**18 + 1, "evt3", payload)


@pytest.mark.parametrize("is_cdr", [False, True])
@pytest.mark.parametrize(
    ("encoding", "shape", "code"), [("mono8", (4, 6), "u1"), ("bgr8", (4, 6, 3), "u1"), ("mono16", (4, 6), "u2")]
)
def test_pictures_of_both_serialisations_with_padded_rows(is_cdr, encoding, shape, code):
    store = store_of(is_cdr)
    pixels = np.arange(np.prod(shape)).reshape(shape).astype(code)
    rows = pixels.reshape(shape[0], -1).view(np.uint8)
    padded = np.pad(rows, ((0, 0), (0, 3)))
    kind = store.types["sensor_msgs/msg/Image"]
    fields = {"height": shape[0], "width": shape[1], "encoding": encoding, "is_bigendian": 0, "step": padded.shape[1]}
    message = kind(header=header_of(store, is_cdr, "x"), data=padded.reshape(-1), **fields)
    picture = parse_picture(serialise(store, message, "sensor_msgs/msg/Image", is_cdr), is_cdr)
    assert picture.stamp == 5_000_001_500
    np.testing.assert_array_equal(picture.pixels, pixels)


def test_libcaer_words_follow_their_layout():
    words = [(1 | 1 << 1 | 5 << 2 | 9 << 17, 100), (0, 100), (1 | 6 << 2 | 8 << 17, 103)]
    content = b"".join(struct.pack("<II", *word) for word in words)
    events = decode_libcaer(Packet(20, 20, 7_000_000, "libcaer", content))
    assert (events.x.tolist(), events.y.tolist(), events.p.tolist()) == ([9, 8], [5, 6], [1, 0])
    assert events.t.tolist() == [7100, 7103]


def test_libcaer_packets_share_a_time_base_until_the_sensors_31_bits_turn():
    began, turn = 10**18, 1 << 31
    clock = [100, 1_000_100, turn - 2, turn - 2, turn + 3, turn + 9]
    packets = [clock[:1], clock[1:2], clock[2:5], clock[5:]]
    stamps: list[int] = []
    for packet in packets:
        # The driver's rule: the start in ns, and of the first event's time what 31 bits do not hold.
        base = began + packet[0] // turn * turn * 1000
        content = b"".join(struct.pack("<II", 1, t % turn) for t in packet)
        stamps += decode_libcaer(Packet(20, 20, base, "libcaer", content)).t.tolist()
    assert stamps == [began // 1000 + t for t in clock]


def test_compressed_libcaer_words_follow_their_layout():
    high, low, x, y, base, mask = ((code << 12) for code in range(6))
    words = [high | 1, low | 5, x | 30, y | 1 << 11 | 40, x | 31, base | 100, mask | 0b10000001, mask | 0b10]
    content = struct.pack(f"<{len(words)}H", *words)
    events = decode_libcaer_cmp(Packet(346, 260, 2_000_000_000, "libcaer_cmp", content))
    assert events.x.tolist() == [30, 31, 31, 31]
    assert events.y.tolist() == [40, 100, 107, 109]
    assert events.p.tolist() == [1, 0, 0, 0]
    assert set(events.t.tolist()) == {2_000_000 + (1 << 12 | 5)}


def record(kind: int, content: bytes) -> bytes:
    return struct.pack("<BQ", kind, len(content)) + content


def text(value: str) -> bytes:
    return struct.pack("<I", len(value)) + value.encode()


def write_mcap(path, messages: list[bytes], compression: str, kind: str = "dvs_msgs/msg/EventArray") -> None:
    """One chunk with everything in it, by the specification."""
    write_channels(path, [("/dvs/events", kind, "cdr", messages)], compression)


def write_channels(path, channels: list[tuple[str, str, str, list[bytes]]], compression: str = "") -> None:
    """Of each channel its topic, type, serialisation and messages."""
    inner = b""
    for number, (topic, kind, encoding, messages) in enumerate(channels, 1):
        inner += record(3, struct.pack("<H", number) + text(kind) + text(f"{encoding}msg") + text(""))
        head = struct.pack("<HH", number, number)
        inner += record(4, head + text(topic) + text(encoding) + struct.pack("<I", 0))
        for place, content in enumerate(messages):
            inner += record(5, struct.pack("<HIQQ", number, place, 0, 0) + content)
    packed = {"": lambda b: b, "lz4": lz4.frame.compress, "zstd": zstd.compress}[compression](inner)
    chunk = struct.pack("<QQQI", 0, 0, len(inner), 0) + text(compression) + struct.pack("<Q", len(packed)) + packed
    magic = b"\x89MCAP0\r\n"
    path.write_bytes(magic + record(1, text("ros2") + text("t")) + record(6, chunk) + record(15, b"\0" * 4) + magic)


def write_database(path, messages: list[bytes]) -> None:
    database = sqlite3.connect(path)
    database.execute("CREATE TABLE topics(id INTEGER PRIMARY KEY, name TEXT, type TEXT)")
    database.execute("CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id INTEGER, timestamp INTEGER, data BLOB)")
    database.execute("INSERT INTO topics VALUES (1, '/dvs/events', 'dvs_msgs/msg/EventArray')")
    database.executemany("INSERT INTO messages(topic_id, timestamp, data) VALUES (1, ?, ?)", enumerate(messages))
    database.commit()
    database.close()


@pytest.mark.parametrize("container", ["mcap", "mcap lz4", "mcap zstd", "db3", "folder"])
def test_ros2_containers_give_the_events_that_went_in(container, tmp_path):
    events, store = make_events(90), store_of(True)
    messages = [event_array(events[i : i + 30], store, True) for i in (0, 30, 60)]
    path = tmp_path / "bag"
    if container == "folder":
        path.mkdir()
        write_mcap(path / "bag_0.mcap", messages[:2], "")
        write_mcap(path / "bag_1.mcap", messages[2:], "zstd")
        (path / "metadata.yaml").write_text("rosbag2_bagfile_information: {}\n")
    elif container == "db3":
        path = tmp_path / "bag.db3"
        write_database(path, messages)
    else:
        write_mcap(path, messages, container.removeprefix("mcap").strip())
    with open_recording(path) as recording:
        found = all_events(recording)
        assert (recording.sensor.width, recording.sensor.height) == (20, 12)
        for axis in ("x", "y", "t", "p"):
            np.testing.assert_array_equal(getattr(found, axis), getattr(events, axis))


def test_a_cut_mcap_keeps_what_came_before_and_says_so(tmp_path):
    messages = [event_array(make_events(30), store_of(True), True)]
    path = tmp_path / "a.mcap"
    write_mcap(path, messages, "")
    path.write_bytes(path.read_bytes()[:-20] + record(6, b"")[:-2])
    with open_recording(path) as recording:
        assert recording.num_events == 30
        assert any("breaks off" in remark.text for remark in recording.remarks)


def write_bag(path, messages: list[bytes]) -> None:
    store = store_of(False)
    with Ros1Writer(path) as bag:
        topic = bag.add_connection("/events", PACKET_TYPE, typestore=store)
        for number, content in enumerate(messages):
            bag.write(topic, number, content)


@pytest.mark.parametrize("is_cdr", [False, True])
def test_evt3_packets_are_one_stream_that_keeps_its_clock_and_tells_what_was_odd(tmp_path, is_cdr):
    high, low, pixel = 0x8 << 12, 0x6 << 12, 0x2 << 12
    # The first packet begins before any time word; the second ends in half a word; the clock begins anew unseen.
    packets = [[pixel | 1, high | 4094, low | 7, 5, pixel | 2], [pixel | 3], [high | 1, low | 9, pixel | 4]]
    contents = [np.array(words, "<u2").tobytes() for words in packets]
    contents[1] += b"\x00"
    messages = [event_packet(content, store_of(is_cdr), is_cdr) for content in contents]
    path = tmp_path / ("a.mcap" if is_cdr else "a.bag")
    if is_cdr:
        write_mcap(path, messages, "", PACKET_TYPE)
    else:
        write_bag(path, messages)
    with open_recording(path) as recording:
        found = all_events(recording)
        told = [remark.text for remark in recording.remarks if remark.kind == "repaired"]
    assert (found.x.tolist(), found.y.tolist()) == ([2, 3, 4], [5, 5, 5])
    assert found.t.tolist() == [4094 << 12 | 7, 4094 << 12 | 7, 4097 << 12 | 9]
    assert told == [
        "1 words before the stream's first time were left out",
        "1 packets end within a word, which was left out; they may be truncated",
    ]

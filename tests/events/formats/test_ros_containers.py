"""What a ROS container may cost: a killed recording is read as far as it goes, a hostile one is one line."""

from __future__ import annotations

import bz2
import sqlite3
import struct
import time

import cv2
import lz4.frame
import numpy as np
import pytest
from backports import zstd
from rosbags.rosbag1 import Writer as Ros1Writer

from etnet.errors import Cancelled, RecordingError
from etnet.events.formats.prophesee.evt2_evt3 import Notes, State
from etnet.events.formats.prophesee.evt21 import EVT21
from etnet.events.formats.ros import bag1, database, mcap
from etnet.events.open import Assumptions, open_recording
from tests.events.containers import all_events
from tests.events.formats.test_ros import (
    PACKET_TYPE,
    event_array,
    header_of,
    record,
    serialise,
    store_of,
    text,
    write_channels,
    write_database,
    write_mcap,
)
from tests.events.formats.test_ros_pictures import packed_picture, raw_picture
from tests.events.formats.test_triggers import EDGES, found, raw_words
from tests.strategies import make_events

ROS1 = store_of(False)
EVENTS = make_events(1200)
SIZE = Assumptions(width=20, height=12)


def bag(path, compression: str | None = None):
    """Forty messages, a few in a chunk."""
    made = Ros1Writer(path)
    made.chunk_threshold = 1000
    if compression is not None:
        made.set_compression(Ros1Writer.CompressionFormat[compression])
    with made as writer:
        topic = writer.add_connection("/dvs/events", "dvs_msgs/msg/EventArray", typestore=ROS1)
        for number in range(40):
            writer.write(topic, number, event_array(EVENTS[30 * number : 30 * number + 30], ROS1, False))
    return path


@pytest.mark.parametrize("compression", [None, "BZ2", "LZ4"])
def test_bags_of_every_compression_hold_the_events_that_went_in(tmp_path, compression):
    with open_recording(bag(tmp_path / "a.bag", compression)) as recording:
        read = all_events(recording)
        for axis in "xytp":
            np.testing.assert_array_equal(getattr(read, axis), getattr(EVENTS, axis))
        assert not any("index" in remark.text for remark in recording.remarks)


def killed_bag(path, share: float = 0.8, compression: str | None = None):
    """A bag that lost its end, as of a recorder that was killed."""
    content = bytearray(bag(path.with_name("whole.bag"), compression).read_bytes())
    path.with_name("whole.bag").unlink()
    place = content.index(b"index_pos=") + len(b"index_pos=")
    content[place : place + 8] = bytes(8)
    # The first record is padded to 4096 bytes.
    path.write_bytes(content[: 4096 + int((len(content) - 4096) * share)])
    return path


@pytest.mark.parametrize("compression", [None, "LZ4"])
@pytest.mark.parametrize("share", [0.3, 0.5, 0.8])
def test_a_killed_bag_is_read_as_far_as_it_goes(tmp_path, compression, share):
    with open_recording(killed_bag(tmp_path / "a.bag.active", share, compression)) as recording:
        read = all_events(recording)
        assert 0 < len(read) < 1200
        assert len(read) % 30 == 0
        np.testing.assert_array_equal(read.t, EVENTS.t[: len(read)])
        said = "\n".join(remark.text for remark in recording.remarks)
    assert "has no index" in said
    assert "breaks off" in said


@pytest.mark.parametrize("is_packed", [False, True])
def test_a_bag_of_ros_1_in_an_mcap_is_read_with_its_pictures_and_triggers(tmp_path, is_packed):
    picture = np.full((12, 20), 90, np.uint8)
    packed = packed_picture(cv2.imencode(".png", picture)[1].tobytes(), "png", False)
    images = ("CompressedImage", packed) if is_packed else ("Image", raw_picture(picture, "mono8", False))
    arrays = [event_array(EVENTS[i : i + 400], ROS1, False) for i in (0, 400, 800)]
    channels = [
        ("/dvs/events", "dvs_msgs/EventArray", "ros1", arrays),
        ("/dvs/image_raw", f"sensor_msgs/{images[0]}", "ros1", [images[1]] * 2),
        ("/dvs/trigger", "std_msgs/Time", "ros1", [struct.pack("<II", 0, 700_000)]),
        # Of a program that adds what ROS 2 says.
        ("/more/trigger", "builtin_interfaces/msg/Time", "cdr", [b"\0\1\0\0" + struct.pack("<II", 0, 900_000)]),
    ]
    write_channels(tmp_path / "a.mcap", channels, "zstd")
    with open_recording(tmp_path / "a.mcap") as recording:
        read = all_events(recording)
        for axis in "xytp":
            np.testing.assert_array_equal(getattr(read, axis), getattr(EVENTS, axis))
        assert len(recording.ground_truth) == 2
        np.testing.assert_allclose(recording.ground_truth.read_frame(1), picture / 255, atol=1e-6)
        assert recording.triggers.stamps.tolist() == [700, 900]


def bag_record(header: dict[bytes, bytes], data: bytes) -> bytes:
    fields = b"".join(struct.pack("<I", len(k) + 1 + len(v)) + k + b"=" + v for k, v in header.items())
    return struct.pack("<I", len(fields)) + fields + struct.pack("<I", len(data)) + data


PACKERS = {"bz2": bz2.compress, "lz4": lz4.frame.compress}


@pytest.mark.parametrize("compression", ["bz2", "lz4"])
@pytest.mark.parametrize("claimed", ["truly", "too little", "too much"])
def test_a_bag_that_unpacks_to_gigabytes_is_refused_at_once(tmp_path, monkeypatch, compression, claimed):
    monkeypatch.setattr(bag1, "MAX_BLOCK", 1 << 22)
    monkeypatch.setattr("etnet.events.formats.bounds.FREE_SIZE", 1 << 22)
    packed = PACKERS[compression](bytes(1 << 22))
    size = {"truly": 1 << 22, "too little": 100, "too much": 1 << 30}[claimed]
    fields = {b"op": b"\x05", b"compression": compression.encode(), b"size": struct.pack("<I", size)}
    path = tmp_path / "a.bag"
    path.write_bytes(b"#ROSBAG V2.0\n" + bag_record(fields, packed) * 5)
    with pytest.raises(RecordingError) as told:
        open_recording(path)
    assert "\n" not in str(told.value)


def mcap_chunk(packed: bytes, compression: str, size: int) -> bytes:
    head = struct.pack("<QQQI", 0, 0, size, 0) + text(compression) + struct.pack("<Q", len(packed))
    return record(6, head + packed)


@pytest.mark.parametrize("compression", ["lz4", "zstd"])
def test_an_mcap_that_unpacks_to_gigabytes_is_refused_at_once(tmp_path, monkeypatch, compression):
    monkeypatch.setattr(mcap, "MAX_BLOCK", 1 << 22)
    monkeypatch.setattr("etnet.events.formats.bounds.FREE_SIZE", 1 << 22)
    packed = {"lz4": lz4.frame.compress, "zstd": zstd.compress}[compression](record(0x7F, bytes(1 << 20)) * 3)
    path = tmp_path / "a.mcap"
    path.write_bytes(mcap.MAGIC + mcap_chunk(packed, compression, 1 << 22) * 40)
    with pytest.raises(RecordingError, match="like a bomb"):
        open_recording(path)


def test_a_chunk_of_countless_empty_records_ends(tmp_path, monkeypatch):
    monkeypatch.setattr(mcap, "_MOST_RECORDS", 1000)
    path = tmp_path / "a.mcap"
    inner = record(0x7F, b"") * 2000
    path.write_bytes(mcap.MAGIC + mcap_chunk(zstd.compress(inner), "zstd", len(inner)))
    with pytest.raises(RecordingError, match="more than 1000 records"):
        open_recording(path)


HOSTILE = {
    "a view that counts without end": """
        CREATE VIEW messages AS WITH RECURSIVE n(i) AS (SELECT 1 UNION ALL SELECT i + 1 FROM n)
        SELECT i AS id, 1 AS topic_id, i AS timestamp, x'00' AS data FROM n""",
    "a computed column": """
        CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id INTEGER, timestamp INTEGER,
        data BLOB AS (zeroblob(1000000000)))""",
    "a virtual table": "CREATE VIRTUAL TABLE messages USING fts5(topic_id, timestamp, data)",
    "no messages": "CREATE TABLE others(id INTEGER)",
}


@pytest.mark.parametrize("kind", list(HOSTILE))
def test_a_database_that_is_more_than_tables_is_refused_at_once(tmp_path, kind):
    path = tmp_path / "a.db3"
    with sqlite3.connect(path) as made:
        made.execute("CREATE TABLE topics(id INTEGER PRIMARY KEY, name TEXT, type TEXT)")
        made.execute("INSERT INTO topics VALUES (1, '/dvs/events', 'dvs_msgs/msg/EventArray')")
        made.execute(HOSTILE[kind])
    made.close()
    began = time.monotonic()
    with pytest.raises(RecordingError, match="messages") as told:
        open_recording(path)
    assert time.monotonic() - began < 5
    assert "\n" not in str(told.value)


def test_a_blob_beyond_the_bound_is_not_loaded(tmp_path, monkeypatch):
    monkeypatch.setattr(database, "MAX_BLOCK", 1 << 20)
    path = tmp_path / "a.db3"
    write_database(path, [event_array(EVENTS, store_of(True), True), bytes(1 << 21)])
    with open_recording(path) as recording:
        assert recording.num_events == 1200
        assert any("too big" in remark.text for remark in recording.remarks)


def test_a_query_that_gives_no_row_is_given_up(tmp_path, monkeypatch):
    monkeypatch.setattr(database, "_LOOK", 1)
    monkeypatch.setattr(database, "_MOST_LOOKS", 3)
    path = tmp_path / "a.db3"
    write_database(path, [event_array(EVENTS, store_of(True), True)])
    with pytest.raises(RecordingError, match="a query that does not end"):
        open_recording(path)


@pytest.mark.parametrize("kind", ["db3", "mcap", "bag"])
def test_opening_can_be_cancelled_within_a_container(tmp_path, monkeypatch, kind):
    monkeypatch.setattr(database, "_LOOK", 1)
    path = tmp_path / f"a.{kind}"
    messages = [event_array(EVENTS, store_of(True), True)] * 3
    if kind == "bag":
        bag(path)
    else:
        (write_database if kind == "db3" else lambda p, m: write_mcap(p, m, ""))(path, messages)

    def stop(_: float) -> None:
        raise Cancelled("nobody waits for it")

    with pytest.raises(Cancelled):
        open_recording(path, progress=stop)


PACKED_EVENTS = [(1000 * i, i % 60, i % 30, i % 2) for i in range(40)]


def write_packets(path, encoding: str, data: bytes) -> None:
    """Two packets of a Prophesee camera's words."""
    store = store_of(True)
    fields = {"height": 32, "width": 64, "seq": 3, "time_base": 0, "encoding": encoding, "is_bigendian": False}
    half = len(data) // 16 * 8
    messages = []
    for part in (data[:half], data[half:]):
        octets = np.frombuffer(part, np.uint8)
        packet = store.types[PACKET_TYPE](header=header_of(store, True, "c"), events=octets, **fields)
        messages.append(serialise(store, packet, PACKET_TYPE, True))
    write_mcap(path, messages, "", PACKET_TYPE)


def words_of(version: str) -> bytes:
    content = raw_words(version, PACKED_EVENTS, EDGES)
    return content[content.index(b"% end\n") + 6 :]


def packets_of_evt21(path) -> None:
    """As a camera of EVT 2.1 sends them."""
    write_packets(path, "evt21", words_of("2.1"))


@pytest.mark.parametrize(("encoding", "version"), [("evt2", "2.0"), ("evt21", "2.1"), ("evt3", "3.0")])
@pytest.mark.parametrize("is_legacy", [False, True])
def test_packets_of_every_prophesee_encoding_are_one_stream_with_its_triggers(tmp_path, encoding, version, is_legacy):
    data = words_of(version)
    if is_legacy and encoding == "evt21":
        data = np.ascontiguousarray(np.frombuffer(data, "<u4").reshape(-1, 2)[:, ::-1]).tobytes()
    write_packets(tmp_path / "a.mcap", encoding, data)
    with open_recording(tmp_path / "a.mcap") as recording:
        read = all_events(recording)
        assert read.t.tolist() == [t for t, *_ in PACKED_EVENTS]
        assert read.x.tolist() == [x for _, x, _, _ in PACKED_EVENTS]
        assert found(recording) == EDGES


def test_evt21_words_in_blocks_are_read_as_one_after_the_other():
    content = raw_words("2.1", [(900 * i, i % 60, i % 30, i % 2) for i in range(200)], EDGES)
    words = np.frombuffer(content[content.index(b"% end\n") + 6 :], "<u8")
    whole, after = EVT21.decode(words, State(), Notes())
    for cut in (0, 1, 7, 100, len(words)):
        notes = Notes()
        first, state = EVT21.decode(words[:cut], State(), notes)
        second, state = EVT21.decode(words[cut:], state, notes)
        assert state == after
        for axis in "xytp":
            joined = np.concatenate([getattr(first, axis), getattr(second, axis)])
            np.testing.assert_array_equal(joined, getattr(whole, axis))
        assert notes.triggers.num_triggers == len(EDGES)

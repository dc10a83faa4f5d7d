"""ROS recordings: ROS 1 bags (through `rosbags`), ROS 2 MCAP and SQLite files, alone or in their folder."""

from __future__ import annotations

import sqlite3
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from rosbags.rosbag1 import Reader as Ros1Reader

from etnet.errors import RecordingError
from etnet.events.events import Sensor
from etnet.events.formats.archive import FolderStore
from etnet.events.formats.base import Format, Opened, Remarks, Request, contained
from etnet.events.formats.decode import Collected, Decoded, collect
from etnet.events.formats.prophesee.evt2_evt3 import EVT
from etnet.events.formats.prophesee.index import BLOCK_BYTES
from etnet.events.formats.prophesee.indexed import decode_words
from etnet.events.formats.ros.event_packets import decode_libcaer, decode_libcaer_cmp
from etnet.events.formats.ros.folder import SUFFIXES, parts_in_order
from etnet.events.formats.ros.mcap import MAGIC, Message, read_mcap
from etnet.events.formats.ros.messages import (
    EVENT_ARRAYS,
    EVENT_PACKETS,
    IMAGES,
    Packet,
    parse_array,
    parse_packet,
    plain_type,
)
from etnet.events.formats.ros.pictures import Pictures

_SQLITE = b"SQLite format 3\0"


@dataclass
class _Bag:
    """The messages that matter, as they pass: events of one topic go on, pictures are kept."""

    request: Request
    is_cdr: bool
    pictures: Pictures
    event_topic: str = ""
    sensor: Sensor | None = None
    encoding: str = ""
    others: set[str] = field(default_factory=set)
    cut: str | None = None
    done: float = 0.0
    """How much of the file the messages so far are, 0 … 1."""

    def take(self, message: Message) -> Decoded | Packet | None:
        """Events of a message, decoded or still in their packet; None if it holds none of the topic that is read."""
        self.done = message.fraction
        kind = plain_type(message.type)
        if kind in IMAGES:
            self.pictures.take(message)
            return None
        if kind not in EVENT_ARRAYS and kind not in EVENT_PACKETS:
            return None
        if not self.event_topic:
            self.event_topic = message.topic
            self.pictures.belong_to(message.topic)
        if message.topic != self.event_topic:
            self.others.add(message.topic)
            return None
        if kind in EVENT_ARRAYS:
            array = parse_array(message.content, self.is_cdr)
            self._size(array.width, array.height)
            return array.events._replace(fraction=message.fraction)
        packet = parse_packet(message.content, self.is_cdr)
        self._size(packet.width, packet.height)
        self.encoding = self.encoding or packet.encoding
        if packet.encoding == "libcaer":
            return decode_libcaer(packet)._replace(fraction=message.fraction)
        if packet.encoding == "libcaer_cmp":
            return decode_libcaer_cmp(packet)._replace(fraction=message.fraction)
        if packet.encoding != "evt3":
            raise RecordingError(
                f'{self.request.name}: event packets in "{packet.encoding}"; evt3, libcaer and libcaer_cmp are read'
            )
        return packet

    def _size(self, width: int, height: int) -> None:
        if self.sensor is None and width and height:
            self.sensor = Sensor(width, height)


def _messages_of_bag(path: Path) -> Iterator[Message]:
    with Ros1Reader(path) as reader:
        wanted = [c for c in reader.connections if plain_type(c.msgtype) in EVENT_ARRAYS + EVENT_PACKETS + IMAGES]
        total = max(1, sum(connection.msgcount for connection in wanted))
        if not wanted:
            return
        for done, (connection, _, content) in enumerate(reader.messages(wanted), 1):
            yield Message(connection.topic, connection.msgtype, bytes(content), done / total)


def _messages_of_database(path: Path) -> Iterator[Message]:
    # A URI with mode=ro and immutable=1 writes no journal beside the file.
    database = sqlite3.connect(f"{path.resolve().as_uri()}?mode=ro&immutable=1", uri=True)
    try:
        total = max(1, database.execute("SELECT count(*) FROM messages").fetchone()[0])
        rows = database.execute(
            "SELECT topics.name, topics.type, messages.data FROM messages JOIN topics ON messages.topic_id = topics.id "
            "ORDER BY messages.timestamp, messages.id"
        )
        for done, (topic, kind, content) in enumerate(rows, 1):
            yield Message(str(topic), str(kind), bytes(content), done / total)
    finally:
        database.close()


def _guarded(bag: _Bag, messages: Iterator[Message], what: str) -> Iterator[Decoded | Packet]:
    """Events out of messages; a file that breaks off keeps what came before."""
    num_parts = 0
    while True:
        try:
            with contained(bag.request.name, what):
                message = next(messages, None)
                part = None if message is None else bag.take(message)
        except RecordingError as slip:
            if num_parts == 0 or slip.__cause__ is None:
                raise
            bag.cut = str(slip.__cause__)
            return
        if message is None:
            return
        if part is not None:
            num_parts += 1
            yield part


def _open_messages(request: Request, what: str, messages: Iterator[Message], is_cdr: bool, remarks: Remarks) -> Opened:
    bag = _Bag(request, is_cdr, Pictures(request.scratch, is_cdr))
    parts = _guarded(bag, messages, what)
    first = next(parts, None)
    if first is None:
        raise RecordingError(
            f"{request.name}: no events; wanted messages of {', '.join(EVENT_ARRAYS[:1] + EVENT_PACKETS[:1])}"
        )
    if isinstance(first, Packet):
        collected = _from_evt3(bag, first, parts, remarks)
    else:
        collected = collect(request, _decoded(first, parts), bag.sensor, remarks)
    label = f"{what}, {bag.encoding or 'dvs_msgs'}"
    remarks.detected(f"events of topic {bag.event_topic}")
    for topic in sorted(bag.others):
        remarks.detected(f"another event topic, {topic}, is not shown")
    if bag.cut is not None:
        remarks.repaired(f"the file breaks off ({bag.cut}); what comes before is kept")
    truth = bag.pictures.ground_truth(collected.span, remarks)
    return Opened(label, collected.source, collected.sensor, collected.span, tuple(remarks.kept), truth)


def _decoded(first: Decoded, parts: Iterator[Decoded | Packet]) -> Iterator[Decoded]:
    yield first
    for part in parts:
        if isinstance(part, Decoded):
            yield part


def _from_evt3(bag: _Bag, first: Packet, parts: Iterator[Decoded | Packet], remarks: Remarks) -> Collected:
    """The packets are one stream: what a word means is told by the packets before its own."""
    evt3, num_cut = EVT["3.0"], 0

    def words() -> Iterator[tuple[np.ndarray, float]]:
        nonlocal num_cut
        for joined in _joined(first, parts):
            num_cut += sum(len(packet.content) % evt3.word.itemsize for packet in joined)
            whole = b"".join(packet.content[: len(packet.content) // 2 * 2] for packet in joined)
            yield np.frombuffer(whole, evt3.word), bag.done

    collected = decode_words(bag.request, evt3, words(), 0, bag.sensor, remarks)
    if num_cut:
        remarks.repaired(f"{num_cut} packets end in half a word, which was left out; they may be truncated")
    return collected


def _joined(first: Packet, parts: Iterator[Decoded | Packet]) -> Iterator[list[Packet]]:
    """Packets that together are worth a call of the decoder."""
    packets, size = [first], len(first.content)
    for part in parts:
        if isinstance(part, Packet):
            packets.append(part)
            size += len(part.content)
        if size >= BLOCK_BYTES:
            yield packets
            packets, size = [], 0
    if packets:
        yield packets


def _opener(what: str, messages: Callable[[Path], Iterator[Message]], is_cdr: bool) -> Callable[[Request], Opened]:
    return lambda request: _open_messages(request, what, messages(request.path), is_cdr, Remarks())


def _open_folder(request: Request) -> Opened:
    """The folder of a ROS 2 recording: its parts one after the other."""
    remarks, store = Remarks(), FolderStore(request.path)
    parts = [store.local_path(name) for name in parts_in_order(request, remarks)]

    def messages() -> Iterator[Message]:
        for number, part in enumerate(parts):
            reader = read_mcap if part.suffix == ".mcap" else _messages_of_database
            for message in reader(part):
                yield message._replace(fraction=(number + message.fraction) / len(parts))

    return _open_messages(request, "ROS 2 folder", messages(), True, remarks)


def _is_folder(request: Request) -> bool:
    return request.path.is_dir() and any(name.endswith(SUFFIXES) for name in request.members)


ROS1_BAG = Format(
    "ROS 1 bag", (".bag",), lambda r: r.head[:8] == b"#ROSBAG ", _opener("ROS 1 bag", _messages_of_bag, False)
)
MCAP = Format("ROS 2 MCAP", (".mcap",), lambda r: r.head[:8] == MAGIC, _opener("ROS 2 MCAP", read_mcap, True))
ROS2_DATABASE = Format(
    "ROS 2 SQLite", (".db3",), lambda r: r.head[:16] == _SQLITE, _opener("ROS 2 SQLite", _messages_of_database, True)
)
ROS2_FOLDER = Format("ROS 2 folder", ("",), _is_folder, _open_folder)

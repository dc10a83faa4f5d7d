"""ROS recordings: ROS 1 bags, ROS 2 MCAP and SQLite files, alone or in their folder."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path

import numpy as np

from etnet.errors import RecordingError
from etnet.events.events import Sensor
from etnet.events.formats.archive import FolderStore
from etnet.events.formats.base import Format, Opened, Remarks, Request, contained
from etnet.events.formats.bounds import declared_sensor
from etnet.events.formats.declared_size import unless_stated
from etnet.events.formats.decode import Collected, Decoded, collect
from etnet.events.formats.prophesee.evt2_evt3 import EVT, Version
from etnet.events.formats.prophesee.evt21 import EVT21, judged_version
from etnet.events.formats.prophesee.index import BLOCK_BYTES
from etnet.events.formats.prophesee.indexed import decode_words
from etnet.events.formats.ros.bag1 import read_bag
from etnet.events.formats.ros.containers import Contents, Message, plain_type
from etnet.events.formats.ros.database import read_database
from etnet.events.formats.ros.event_packets import decode_libcaer, decode_libcaer_cmp
from etnet.events.formats.ros.folder import SUFFIXES, parts_in_order
from etnet.events.formats.ros.image_messages import IMAGES
from etnet.events.formats.ros.mcap import MAGIC, read_mcap
from etnet.events.formats.ros.messages import EVENT_ARRAYS, EVENT_PACKETS, Packet, parse_array, parse_packet
from etnet.events.formats.ros.pictures import Pictures
from etnet.events.formats.ros.trigger_messages import STAMPED, TopicTriggers

_SQLITE = b"SQLite format 3\0"
_LONGEST_NAME = 80
_STREAMS = {"evt3": EVT["3.0"], "evt2": EVT["2.0"], "evt21": EVT21}
"""Encodings of packets that put together are a stream of a Prophesee camera."""

ReadMessages = Callable[[Path, Contents], Iterator[Message]]


@dataclass
class _Bag:
    """The messages that matter, as they pass: events of one topic go on, pictures are kept."""

    request: Request
    pictures: Pictures
    event_topic: str = ""
    sensor: Sensor | None = None
    encoding: str = ""
    others: set[str] = field(default_factory=set)
    triggers: TopicTriggers = field(default_factory=TopicTriggers)
    cut: str | None = None
    done: float = 0.0
    """How much of the file the messages so far are, 0 … 1."""
    is_chosen: bool = False
    """Whether a person named the topic of the events."""

    def take(self, message: Message) -> Decoded | Packet | None:
        """Events of a message, decoded or still in their packet; None if it holds none of the topic that is read."""
        self.done = message.fraction
        kind = plain_type(message.type)
        if kind in IMAGES:
            self.pictures.take(message)
            return None
        if kind in STAMPED:
            self.triggers.take(message)
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
            array = parse_array(message.content, message.is_cdr)
            self._size(array.width, array.height)
            return array.events._replace(fraction=message.fraction)
        packet = parse_packet(message.content, message.is_cdr)
        self._size(packet.width, packet.height)
        self.encoding = self.encoding or packet.encoding
        if packet.encoding == "libcaer":
            return decode_libcaer(packet)._replace(fraction=message.fraction)
        if packet.encoding == "libcaer_cmp":
            return decode_libcaer_cmp(packet)._replace(fraction=message.fraction)
        if packet.encoding not in _STREAMS:
            raise RecordingError(
                f'{self.request.name}: event packets in "{packet.encoding[:40]}"; evt2, evt21, evt3, libcaer and '
                "libcaer_cmp are read"
            )
        return packet

    def _size(self, width: int, height: int) -> None:
        if self.sensor is None and width and height:
            where = f"{self.request.name}: a message of {_told(self.event_topic)}"
            most = self.request.assume.max_pixels
            self.sensor = unless_stated(self.request, lambda: declared_sensor(width, height, where, most))


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


def _new_bag(request: Request) -> _Bag:
    """What a person chose stands before anything is read."""
    events, _, pictures = (request.assume.topic or "").partition(",")
    bag = _Bag(request, Pictures(request.scratch, max_pixels=request.assume.max_pixels))
    bag.pictures.wanted = pictures.strip()
    bag.event_topic, bag.is_chosen = events.strip(), bool(events.strip())
    bag.pictures.belong_to(bag.event_topic)
    return bag


def _told(name: str) -> str:
    """A file's name for something, as a message can hold it: a damaged one may be kilobytes of many lines."""
    line = " ".join(name.split())
    return line if len(line) <= _LONGEST_NAME else f"{line[:_LONGEST_NAME]}…"


def _without_events(bag: _Bag, contents: Contents) -> RecordingError:
    """What there is instead of the events that are wanted."""
    with_events = [topic for topic, kind in contents.topics.items() if kind in EVENT_ARRAYS + EVENT_PACKETS]
    if bag.is_chosen and with_events:
        return RecordingError(
            f"{bag.request.name}: no events of topic {bag.event_topic}; those with events are "
            f"{', '.join(map(_told, sorted(with_events)[:8]))}"
        )
    there = [f"{_told(topic)} ({_told(kind)})" for topic, kind in sorted(contents.topics.items())]
    more = f" and {len(there) - 8} more" if len(there) > 8 else ""
    return RecordingError(
        f"{bag.request.name}: no events; it holds {', '.join(there[:8]) or 'no topics'}{more}; wanted messages of "
        f"{', '.join(EVENT_ARRAYS[:1] + EVENT_PACKETS[:1])}"
    )


def _open_messages(
    request: Request, what: str, messages: Iterator[Message], contents: Contents, remarks: Remarks
) -> Opened:
    bag = _new_bag(request)
    parts = _guarded(bag, messages, what)
    first = next(parts, None)
    if first is None:
        raise _without_events(bag, contents)
    if isinstance(first, Packet):
        collected = _from_stream(bag, first, parts, remarks)
    else:
        collected = collect(request, _decoded(first, parts), bag.sensor, remarks)
    label = f"{what}, {bag.encoding or 'dvs_msgs'}"
    remarks.detected(f"events of topic {_told(bag.event_topic)}")
    for topic in sorted(bag.others):
        remarks.detected(f"another event topic, {_told(topic)}, is not shown; --topic {_told(topic)} shows it")
    if not contents.is_indexed:
        remarks.repaired("the bag has no index, for its recording was not closed, and was read from front to back")
    if bag.cut is not None:
        remarks.repaired(f"the file breaks off ({bag.cut}); what comes before is kept")
    truth = bag.pictures.ground_truth(collected.span, remarks)
    triggers = collected.triggers
    if triggers is None:
        triggers = bag.triggers.triggers(collected.span, contents.topics, remarks)
    elif bag.triggers.stamps:
        remarks.detected(
            f"the packets have triggers, so those of {', '.join(sorted(bag.triggers.stamps))} are not shown"
        )
    kept = tuple(remarks.kept)
    return Opened(label, collected.source, collected.sensor, collected.span, kept, truth, triggers=triggers)


def _decoded(first: Decoded, parts: Iterator[Decoded | Packet]) -> Iterator[Decoded]:
    yield first
    for part in parts:
        if isinstance(part, Decoded):
            yield part


def _from_stream(bag: _Bag, first: Packet, parts: Iterator[Decoded | Packet], remarks: Remarks) -> Collected:
    """The packets are one stream: what a word means is told by the packets before its own."""
    version, num_cut = _version(first, remarks), 0
    size = version.word.itemsize

    def words() -> Iterator[tuple[np.ndarray, float]]:
        nonlocal num_cut
        for joined in _joined(first, parts):
            num_cut += sum(len(packet.content) % size != 0 for packet in joined)
            whole = b"".join(packet.content[: len(packet.content) // size * size] for packet in joined)
            yield np.frombuffer(whole, version.word), bag.done

    collected = decode_words(bag.request, version, words(), 0, bag.sensor, remarks)
    if num_cut:
        remarks.repaired(f"{num_cut} packets end within a word, which was left out; they may be truncated")
    return collected


def _version(first: Packet, remarks: Remarks) -> Version:
    """EVT 2.1 comes in two orders of its halves, which packets do not tell."""
    if first.encoding != "evt21":
        return _STREAMS[first.encoding]
    return judged_version(first.content, "the first packet", remarks)


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


def _contents(request: Request) -> Contents:
    wanted = EVENT_ARRAYS + EVENT_PACKETS + IMAGES + STAMPED
    return Contents(lambda kind: kind in wanted, lambda fraction: request.progress(min(fraction, 0.99)))


def _opener(what: str, read: ReadMessages) -> Callable[[Request], Opened]:
    def opened(request: Request) -> Opened:
        contents = _contents(request)
        return _open_messages(request, what, read(request.path, contents), contents, Remarks())

    return opened


def _tell_part(request: Request, number: int, count: int, fraction: float) -> None:
    request.progress(min((number + fraction) / count, 0.99))


def _open_folder(request: Request) -> Opened:
    """The folder of a ROS 2 recording: its parts one after the other."""
    remarks, store, contents = Remarks(), FolderStore(request.path), _contents(request)
    parts = [store.local_path(name) for name in parts_in_order(request, remarks)]

    def messages() -> Iterator[Message]:
        for number, part in enumerate(parts):
            reader = read_mcap if part.suffix == ".mcap" else read_database
            contents.tick = partial(_tell_part, request, number, len(parts))
            for message in reader(part, contents):
                yield message._replace(fraction=(number + message.fraction) / len(parts))

    return _open_messages(request, "ROS 2 folder", messages(), contents, remarks)


def _is_folder(request: Request) -> bool:
    return request.path.is_dir() and any(name.endswith(SUFFIXES) for name in request.members)


ROS1_BAG = Format("ROS 1 bag", (".bag", ".active"), lambda r: r.head[:8] == b"#ROSBAG ", _opener("ROS 1 bag", read_bag))
MCAP = Format("MCAP", (".mcap",), lambda r: r.head[:8] == MAGIC, _opener("MCAP", read_mcap))
ROS2_DATABASE = Format(
    "ROS 2 SQLite", (".db3",), lambda r: r.head[:16] == _SQLITE, _opener("ROS 2 SQLite", read_database)
)
ROS2_FOLDER = Format("ROS 2 folder", ("",), _is_folder, _open_folder)

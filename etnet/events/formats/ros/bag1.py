"""ROS 1 bags, read front to back as far as they go: the index at the end is not needed, so a killed recording opens.

Layout: wiki.ros.org/Bags/Format/2.0. A record is a header of named fields and some data; messages lie in chunks or by
themselves, each connection (a topic and its type) comes before its messages.
"""

from __future__ import annotations

import bz2
import struct
from collections.abc import Iterator
from dataclasses import dataclass, field
from io import BufferedIOBase, BytesIO
from pathlib import Path

from etnet.errors import RecordingError
from etnet.events.formats.bounds import MAX_BLOCK, Unpacked, at_most
from etnet.events.formats.ros.containers import Contents, CutOff, Message

_VERSION = b"#ROSBAG V2.0\n"
_MESSAGE, _BAG_HEADER, _CHUNK, _CONNECTION = 2, 3, 5, 7
_LARGEST_HEADER = 1 << 20
_MOST_RECORDS = 1 << 21
"""Of one chunk, which a recorder closes at less than a megabyte."""

_TICKS = 1 << 10

Fields = dict[bytes, bytes]


@dataclass
class _Bag:
    """Connections as they are met; only those that are wanted are kept."""

    contents: Contents
    connections: dict[int, tuple[str, str]] = field(default_factory=dict)

    def meet(self, header: Fields, data: bytes) -> None:
        described = _fields(data)
        kind, topic = _text(described.get(b"type", b"")), _text(header.get(b"topic", b""))
        if self.contents.note(topic, kind):
            self.connections[_number(header, b"conn")] = (topic, kind)

    def message(self, header: Fields, data: bytes, fraction: float) -> Message | None:
        """The message, if its connection is wanted."""
        connection = self.connections.get(_number(header, b"conn"))
        return None if connection is None else Message(*connection, data, fraction, is_cdr=False)


def read_bag(path: Path, contents: Contents) -> Iterator[Message]:
    """The wanted messages in the file's order. Raises CutOff where the file ends within a record."""
    bag, size = _Bag(contents), path.stat().st_size
    unpacked = Unpacked(size, path.name)
    with path.open("rb") as file:
        if file.read(len(_VERSION)) != _VERSION:
            raise RecordingError(f"{path.name}: a ROS bag of another version; bags of version 2.0 are read")
        for number, (header, data) in enumerate(_records(file)):
            fraction = file.tell() / size
            if number % _TICKS == 0:
                contents.tick(fraction)
            kind = _kind(header)
            if kind == _BAG_HEADER:
                contents.is_indexed = _number(header, b"index_pos", 8) != 0
            elif kind == _CHUNK:
                content = _unpacked(header, data)
                unpacked.take(len(content))
                contents.tick(fraction)
                yield from _messages(bag, BytesIO(content), fraction)
            elif kind == _CONNECTION:
                bag.meet(header, data)
            elif kind == _MESSAGE and (message := bag.message(header, data, fraction)) is not None:
                yield message


def _messages(bag: _Bag, chunk: BytesIO, fraction: float) -> Iterator[Message]:
    for number, (header, data) in enumerate(_records(chunk)):
        if number >= _MOST_RECORDS:
            raise CutOff(f"a chunk of more than {_MOST_RECORDS} records")
        kind = _kind(header)
        if kind == _CONNECTION:
            bag.meet(header, data)
        elif kind == _MESSAGE and (message := bag.message(header, data, fraction)) is not None:
            yield message


def _records(stream: BufferedIOBase) -> Iterator[tuple[Fields, bytes]]:
    while head := stream.read(4):
        content, is_whole = _sized(stream, head, _LARGEST_HEADER)
        if not is_whole:
            raise CutOff("ends within a record")
        header = _fields(content)
        data, is_whole = _sized(stream, stream.read(4), at_most(MAX_BLOCK))
        if is_whole or _kind(header) == _CHUNK:
            # The messages at the beginning of a chunk are whole.
            yield header, data
        if not is_whole:
            raise CutOff("ends within a record")


def _sized(stream: BufferedIOBase, head: bytes, limit: int) -> tuple[bytes, bool]:
    """What follows a length, and whether all of it is there."""
    if len(head) < 4:
        raise CutOff("ends within a record")
    length = struct.unpack("<I", head)[0]
    if length > limit:
        raise CutOff(f"a record that claims {length} bytes")
    content = stream.read(length)
    return content, len(content) == length


def _fields(content: bytes) -> Fields:
    """Fields "name=value", each with its length before it."""
    found: Fields = {}
    place = 0
    while place < len(content):
        if place + 4 > len(content):
            raise CutOff("a header that ends within a field")
        stop = place + 4 + struct.unpack_from("<I", content, place)[0]
        name, is_named, value = content[place + 4 : stop].partition(b"=")
        if not is_named or stop > len(content):
            raise CutOff("a header that ends within a field")
        found[name] = value
        place = stop
    return found


def _kind(header: Fields) -> int:
    return _number(header, b"op", 1)


def _number(header: Fields, name: bytes, size: int = 4) -> int:
    value = header.get(name, b"")
    if len(value) != size:
        raise CutOff(f"a record without the field {name.decode()}")
    return int.from_bytes(value, "little")


def _text(value: bytes) -> str:
    return value.decode("utf-8", "replace")


def _unpacked(header: Fields, data: bytes) -> bytes:
    """A chunk's records; no more of them than the chunk declares."""
    size, compression = _number(header, b"size"), _text(header.get(b"compression", b""))
    if size > at_most(MAX_BLOCK):
        raise CutOff(f"a chunk that claims {size} bytes")
    if compression == "none":
        return data
    if compression == "bz2":
        return bz2.BZ2Decompressor().decompress(data, max_length=size)
    if compression == "lz4":
        import lz4.frame

        return lz4.frame.LZ4FrameDecompressor().decompress(data, max_length=size)
    raise CutOff(f'a chunk compressed with "{compression[:40]}"')

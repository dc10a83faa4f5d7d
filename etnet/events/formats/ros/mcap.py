"""MCAP containers, read front to back: every message with its topic and type. Specification: mcap.dev/spec.

Read here, for `rosbags` wants a metadata.yaml beside the file and stumbles over schemas in IDL.
"""

from __future__ import annotations

import struct
import sys
from collections.abc import Iterator
from io import BufferedIOBase, BytesIO
from pathlib import Path

from etnet.events.formats.bounds import MAX_BLOCK, Unpacked, at_most
from etnet.events.formats.ros.containers import Contents, CutOff, Message

MAGIC = b"\x89MCAP0\r\n"
_SCHEMA, _CHANNEL, _MESSAGE, _CHUNK, _DATA_END = 0x03, 0x04, 0x05, 0x06, 0x0F
_MOST_RECORDS = 1 << 21
"""Of one chunk, which a recorder closes at some megabytes."""

_TICKS = 1 << 10
_ROS1 = "ros1"
"""How a channel calls the serialisation of ROS 1."""

_CHUNK_HEAD = 64
"""Bytes in which a chunk says what it is."""


class _Channels:
    """Schemas and channels as they are met."""

    def __init__(self, contents: Contents) -> None:
        self._contents = contents
        self._schemas: dict[int, str] = {}
        self._wanted: dict[int, tuple[str, str, bool]] = {}

    def message(self, kind: int, body: bytes, fraction: float) -> Message | None:
        """A wanted message; schemas and channels are noted."""
        if kind == _SCHEMA:
            self._schemas[struct.unpack_from("<H", body)[0]] = _text(body, 2)[0]
        elif kind == _CHANNEL:
            number, schema = struct.unpack_from("<HH", body)
            (topic, place), type_name = _text(body, 4), self._schemas.get(schema, "")
            if self._contents.note(topic, type_name):
                self._wanted[number] = (topic, type_name, _text(body, place)[0] != _ROS1)
        elif kind == _MESSAGE and (channel := self._wanted.get(struct.unpack_from("<H", body)[0])) is not None:
            topic, type_name, is_cdr = channel
            return Message(topic, type_name, body[22:], fraction, is_cdr)
        return None


def read_mcap(path: Path, contents: Contents) -> Iterator[Message]:
    """The wanted messages in the file's order. Raises CutOff where the file ends too early."""
    channels, size = _Channels(contents), path.stat().st_size
    unpacked = Unpacked(size, path.name)
    with path.open("rb") as file:
        file.read(len(MAGIC))
        for number, (kind, content) in enumerate(_records(file)):
            if kind == _DATA_END:
                return
            fraction = file.tell() / size
            if kind == _CHUNK or number % _TICKS == 0:
                contents.tick(fraction)
            if kind != _CHUNK:
                inner = iter([(kind, content)])
            else:
                chunk = _unpacked(content)
                unpacked.take(len(chunk))
                inner = _few(_records(BytesIO(chunk)))
            for part, body in inner:
                if (message := channels.message(part, body, fraction)) is not None:
                    yield message


def _few(records: Iterator[tuple[int, bytes]]) -> Iterator[tuple[int, bytes]]:
    for number, record in enumerate(records):
        if number >= _MOST_RECORDS:
            raise CutOff(f"a chunk of more than {_MOST_RECORDS} records")
        yield record


def _records(stream: BufferedIOBase) -> Iterator[tuple[int, bytes]]:
    while head := stream.read(9):
        if len(head) < 9 or head[:8] == MAGIC:
            raise CutOff("ends within a record")
        length = struct.unpack_from("<Q", head, 1)[0]
        if length > at_most(MAX_BLOCK):
            raise CutOff(f"a record that claims {length} bytes")
        content = stream.read(length)
        if len(content) == length or (head[0] == _CHUNK and len(content) > _CHUNK_HEAD):
            # The messages at the beginning of a chunk are whole.
            yield head[0], content
        if len(content) < length:
            raise CutOff("ends within a record")


def _unpacked(chunk: bytes) -> bytes:
    size = struct.unpack_from("<Q", chunk, 16)[0]
    if size > at_most(MAX_BLOCK):
        raise CutOff(f"a chunk that claims {size} bytes")
    compression, place = _text(chunk, 28)
    packed = chunk[place + 8 :]
    if compression == "":
        return packed
    if compression == "lz4":
        import lz4.frame

        return lz4.frame.LZ4FrameDecompressor().decompress(packed, max_length=size)
    if compression == "zstd":
        if sys.version_info >= (3, 14):
            from compression import zstd
        else:
            from backports import zstd
        return zstd.ZstdDecompressor().decompress(packed, max_length=size)
    raise CutOff(f'a chunk compressed with "{compression}"')


def _text(content: bytes, place: int) -> tuple[str, int]:
    length = struct.unpack_from("<I", content, place)[0]
    stop = place + 4 + length
    return content[place + 4 : stop].decode("utf-8", "replace"), stop

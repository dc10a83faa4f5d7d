"""MCAP containers, read front to back: every message with its topic and type. Specification: mcap.dev/spec.

Read here, for `rosbags` wants a metadata.yaml beside the file and stumbles over schemas in IDL.
"""

from __future__ import annotations

import struct
import sys
from collections.abc import Iterator
from io import BufferedIOBase, BytesIO
from pathlib import Path
from typing import NamedTuple

import lz4.frame

if sys.version_info >= (3, 14):
    from compression import zstd
else:
    from backports import zstd

MAGIC = b"\x89MCAP0\r\n"
LARGEST_RECORD = 1 << 30
_SCHEMA, _CHANNEL, _MESSAGE, _CHUNK, _DATA_END = 0x03, 0x04, 0x05, 0x06, 0x0F


class Message(NamedTuple):
    """One message as it was recorded."""

    topic: str
    type: str
    content: bytes
    fraction: float


class CutOff(ValueError):
    """The container ends within a record."""


def read_mcap(path: Path) -> Iterator[Message]:
    """All messages in the file's order. Raises CutOff where the file ends too early."""
    schemas: dict[int, str] = {}
    channels: dict[int, tuple[str, int]] = {}
    size = path.stat().st_size
    with path.open("rb") as file:
        file.read(len(MAGIC))
        for kind, content in _records(file):
            if kind == _DATA_END:
                return
            fraction = file.tell() / size
            inner = _records(BytesIO(_unpacked(content))) if kind == _CHUNK else iter([(kind, content)])
            for part, body in inner:
                if part == _SCHEMA:
                    schemas[struct.unpack_from("<H", body)[0]] = _text(body, 2)[0]
                elif part == _CHANNEL:
                    number, schema = struct.unpack_from("<HH", body)
                    channels[number] = (_text(body, 4)[0], schema)
                elif part == _MESSAGE:
                    topic, schema = channels.get(struct.unpack_from("<H", body)[0], ("", 0))
                    yield Message(topic, schemas.get(schema, ""), body[22:], fraction)


def _records(stream: BufferedIOBase) -> Iterator[tuple[int, bytes]]:
    while head := stream.read(9):
        if len(head) < 9 or head[:8] == MAGIC:
            raise CutOff("ends within a record")
        length = struct.unpack_from("<Q", head, 1)[0]
        if length > LARGEST_RECORD:
            raise CutOff(f"a record that claims {length} bytes")
        content = stream.read(length)
        if len(content) < length:
            raise CutOff("ends within a record")
        yield head[0], content


def _unpacked(chunk: bytes) -> bytes:
    size = struct.unpack_from("<Q", chunk, 16)[0]
    if size > LARGEST_RECORD:
        raise CutOff(f"a chunk that claims {size} bytes")
    compression, place = _text(chunk, 28)
    packed = chunk[place + 8 :]
    if compression == "":
        return packed
    if compression == "lz4":
        return lz4.frame.LZ4FrameDecompressor().decompress(packed, max_length=size)
    if compression == "zstd":
        return zstd.ZstdDecompressor().decompress(packed, max_length=size)
    raise CutOff(f'a chunk compressed with "{compression}"')


def _text(content: bytes, place: int) -> tuple[str, int]:
    length = struct.unpack_from("<I", content, place)[0]
    stop = place + 4 + length
    return content[place + 4 : stop].decode("utf-8", "replace"), stop

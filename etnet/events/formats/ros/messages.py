"""ROS messages with events, parsed from their raw bytes: ROS 1 and CDR (ROS 2).

Generic deserialisation makes a Python object of every event and is two hundred times slower. Definitions:
rpg_dvs_ros/dvs_msgs, ros-event-camera/event_camera_msgs.
"""

from __future__ import annotations

import struct
from typing import NamedTuple

import numpy as np

from etnet.events.formats.columns import from_nanoseconds
from etnet.events.formats.decode import Decoded

EVENT_ARRAYS = ("dvs_msgs/EventArray", "prophesee_event_msgs/EventArray")
EVENT_PACKETS = ("event_camera_msgs/EventPacket", "event_array_msgs/EventArray")

_ROS1_EVENT = np.dtype([("x", "<u2"), ("y", "<u2"), ("s", "<u4"), ("ns", "<u4"), ("p", "u1")])
_CDR_EVENT = np.dtype(
    {
        "names": ["x", "y", "s", "ns", "p"],
        "formats": ["<u2", "<u2", "<u4", "<u4", "u1"],
        "offsets": [0, 2, 6, 10, 14],
        "itemsize": 16,
    }
)


class Cursor:
    """Walks through a message. CDR aligns every number to its own size, counted from behind the first four bytes."""

    def __init__(self, content: bytes, is_cdr: bool) -> None:
        self._content = content
        self.is_cdr = is_cdr
        if is_cdr and content[1:2] not in (b"\x01", b"\x03"):
            raise ValueError("a big-endian CDR message")
        self.place = 4 if is_cdr else 0

    def number(self, code: str) -> int:
        """The next number of struct's type `code`."""
        size = struct.calcsize("<" + code)
        self.align(size)
        value = struct.unpack_from("<" + code, self._content, self.place)[0]
        self.place += size
        return value

    def align(self, size: int) -> None:
        """Step to the next place where a number of `size` may stand."""
        if self.is_cdr:
            self.place += -(self.place - 4) % size

    def text(self) -> str:
        """The next string."""
        return self.octets().rstrip(b"\0").decode("utf-8", "replace")

    def octets(self) -> bytes:
        """The next array of bytes (or string)."""
        length = self.number("I")
        if self.place + length > len(self._content):
            raise ValueError("a message that ends within an array")
        part = self._content[self.place : self.place + length]
        self.place += length
        return part

    def header(self) -> int:
        """std_msgs/Header; gives its stamp in ns."""
        if not self.is_cdr:
            self.number("I")
        seconds, nanoseconds = self.number("I"), self.number("I")
        self.text()
        return seconds * 10**9 + nanoseconds

    @property
    def rest(self) -> bytes:
        """All that was not read."""
        return self._content[self.place :]


class Array(NamedTuple):
    """dvs_msgs/EventArray."""

    width: int
    height: int
    events: Decoded


class Packet(NamedTuple):
    """event_camera_msgs/EventPacket; `time_base` in ns."""

    width: int
    height: int
    time_base: int
    encoding: str
    content: bytes


def parse_array(content: bytes, is_cdr: bool) -> Array:
    """Events of one dvs_msgs/EventArray, stamps to µs."""
    cursor = Cursor(content, is_cdr)
    cursor.header()
    height, width, count = cursor.number("I"), cursor.number("I"), cursor.number("I")
    rest = cursor.rest
    if not is_cdr:
        if len(rest) < count * _ROS1_EVENT.itemsize:
            raise ValueError("a message that ends within its events")
        records = np.frombuffer(rest, _ROS1_EVENT, count)
    else:
        records = _cdr_events(rest, count)
    stamps = from_nanoseconds(records["s"].astype(np.int64) * 10**9 + records["ns"])
    return Array(width, height, Decoded(records["x"], records["y"], stamps, records["p"]))


def _cdr_events(rest: bytes, count: int) -> np.ndarray:
    """The first event stands on a multiple of four and takes 14 bytes, each further one stands two behind: 16."""
    if count == 0:
        return np.empty(0, _CDR_EVENT)
    if len(rest) < 13 + (count - 1) * 16:
        raise ValueError("a message that ends within its events")
    first = rest[:4] + b"\0\0" + rest[4:13] + b"\0"
    return np.frombuffer(first + rest[14:].ljust(16 * (count - 1), b"\0"), _CDR_EVENT, count)


def parse_packet(content: bytes, is_cdr: bool) -> Packet:
    """An event_camera_msgs/EventPacket, its events still encoded."""
    cursor = Cursor(content, is_cdr)
    cursor.header()
    height, width = cursor.number("I"), cursor.number("I")
    cursor.number("Q")
    time_base, encoding = cursor.number("Q"), cursor.text()
    if cursor.number("B"):
        raise ValueError("a big-endian event packet")
    return Packet(width, height, time_base, encoding, cursor.octets())

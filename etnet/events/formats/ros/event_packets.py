"""Encodings inside event_camera_msgs packets: libcaer (8 bytes an event) and libcaer_cmp (16-bit words with memory).

Layouts: ros-event-camera/event_camera_codecs. Packets of "evt3", put together, are a Prophesee EVT3 stream.
"""

from __future__ import annotations

import numpy as np

from etnet.events.formats.columns import from_nanoseconds
from etnet.events.formats.decode import Decoded
from etnet.events.formats.ros.messages import Packet
from etnet.events.formats.word_stream import held, set_bits

_CLOCK_BITS = 31
_HALF_TURN = 1 << 30
"""µs. A step back by more is a turn of the clock within a packet."""

_TIME_HIGH, _TIME_LOW, _X, _Y, _VECTOR_BASE, _VECTOR = range(6)


def decode_libcaer(packet: Packet) -> Decoded:
    """Words (u32 data, u32 t in µs) as libcaer has them: valid 1, polarity 1, y 15, x 15 bits.

    `time_base` stands for the clock's 31 bits at 0, not for the first event: packets share it for 35.8 minutes.
    """
    words = np.frombuffer(packet.content, "<u4", len(packet.content) // 8 * 2).reshape(-1, 2)
    words = words[(words[:, 0] & 1) == 1]
    data, low = words[:, 0], words[:, 1].astype(np.int64)
    turns = np.cumsum(np.diff(low, prepend=low[:1]) < -_HALF_TURN)
    stamps = from_nanoseconds((low + (turns << _CLOCK_BITS)) * 1000 + packet.time_base)
    return Decoded(data >> 17, (data >> 2) & 0x7FFF, stamps, (data >> 1) & 1)


def decode_libcaer_cmp(packet: Packet) -> Decoded:
    """12 bits under a 4-bit code: times, x, then y with polarity, or a base y and masks of eight rows each."""
    words = np.frombuffer(packet.content, "<u2", len(packet.content) // 2)
    code, value = words >> 12, (words & 0xFFF).astype(np.int64)
    micros = (held(value, code == _TIME_HIGH, 0) << 12) | held(value, code == _TIME_LOW, 0)
    x = held(value, code == _X, 0) & 0x7FF
    is_vector = code == _VECTOR
    base = held(value, code == _VECTOR_BASE, 0)
    # Each further mask after a base begins eight rows below the one before.
    counted = np.cumsum(is_vector)
    since_base = counted - held(counted, code == _VECTOR_BASE, 0) - 1
    masks = np.where(is_vector, value & 0xFF, np.where(code == _Y, 1, 0)).astype(np.uint32)
    rows, bits = set_bits(masks)
    single = code[rows] == _Y
    y = np.where(single, value[rows] & 0x7FF, (base[rows] & 0x7FF) + 8 * since_base[rows] + bits)
    polarity = np.where(single, value[rows], base[rows]) >> 11
    stamps = from_nanoseconds(micros[rows] * 1000 + packet.time_base)
    return Decoded(x[rows], y, stamps, polarity)

"""Bytes in any pieces give the events that were sent; bytes that are no events are an error."""

import itertools
import struct

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from etnet.events.events import Events, Sensor
from etnet.events.open import open_recording
from etnet.live.layouts import EVENT_STREAM_HEAD, WrongBytes, decoder_of, event_stream_sensor
from tests.live.sources import make_events, same
from tests.real_data import real_file
from tests.strategies import SMALL

FAR = Sensor(20, 12)


def record_bytes(events: Events, layout: str) -> bytes:
    """As faery lays them out."""
    if layout == "t64_x16_y16_on8":
        rows = np.zeros(len(events), [("t", "<u8"), ("x", "<u2"), ("y", "<u2"), ("on", "u1")])
        rows["y"], rows["on"] = events.y, events.p > 0
    else:
        rows = np.zeros(len(events), [("t", "<u4"), ("x", "<u2"), ("y_on", "<u2")])
        rows["y_on"] = (events.y << 1) | (events.p > 0)
    rows["t"], rows["x"] = events.t & (0xFFFFFFFF if layout.startswith("t32") else -1), events.x
    return rows.tobytes()


def event_stream_bytes(events: Events) -> bytes:
    """Event Stream 2.0, dvs, with its header; y counts from the bottom."""
    head = b"Event Stream" + bytes([2, 0, 0, 1]) + struct.pack("<HH", events.sensor.width, events.sensor.height)
    body, before = bytearray(), 0
    for x, y, t, p in zip(events.x, events.y, events.t, events.p, strict=True):
        step = int(t) - before
        body += b"\xff" * (step // 127)
        body += struct.pack("<BHH", (step % 127) << 1 | (p > 0), x, events.sensor.height - 1 - int(y))
        before = int(t)
    return head + bytes(body)


def _pieces(content: bytes, cuts: list[int]) -> list[bytes]:
    places = sorted({cut % (len(content) + 1) for cut in cuts} | {0, len(content)})
    return [content[a:b] for a, b in itertools.pairwise(places)]


@given(st.integers(0, 60), st.lists(st.integers(0, 10_000), max_size=12), st.sampled_from([50, 5_000, 60_000]))
def test_pieces_of_any_size_give_the_events_that_were_sent(num_events, cuts, duration):
    events = make_events(num_events, duration=duration)
    for layout in ("t64_x16_y16_on8", "t32_x16_y15_on1", "es"):
        content = event_stream_bytes(events)[EVENT_STREAM_HEAD:] if layout == "es" else record_bytes(events, layout)
        decoder = decoder_of(layout, SMALL)
        decoded = [decoder.decode(piece) for piece in _pieces(content, cuts)]
        assert same(Events.concatenate(decoded, SMALL), events)


def test_stamps_of_32_bits_go_on_when_they_begin_again():
    events = make_events(100)
    events = Events(events.x, events.y, events.t + (1 << 32) - 20_000, events.p, SMALL)
    decoder = decoder_of("t32_x16_y15_on1", SMALL)
    content = record_bytes(events, "t32_x16_y15_on1")
    decoded = Events.concatenate([decoder.decode(content[:240]), decoder.decode(content[240:])], SMALL)
    assert same(decoded, events)


@pytest.mark.real
def test_a_real_event_stream_is_read_as_the_file_reader_reads_it():
    path = real_file("derived/davis346_aprilgrid_0.5s.es")
    content = path.read_bytes()
    sensor = event_stream_sensor(content[:EVENT_STREAM_HEAD])
    decoder = decoder_of("es", sensor)
    pieces = [content[i : i + 4097] for i in range(EVENT_STREAM_HEAD, len(content), 4097)]
    with open_recording(path) as recording:
        decoded = Events.concatenate([decoder.decode(piece) for piece in pieces], sensor)
        assert same(decoded, recording.read(0, recording.num_events))


@pytest.mark.parametrize("layout", ["t64_x16_y16_on8", "t32_x16_y15_on1", "es"])
def test_random_bytes_are_refused_and_never_become_far_events(layout):
    rng = np.random.default_rng(3)
    decoder, num_refused = decoder_of(layout, SMALL), 0
    for _ in range(50):
        try:
            events = decoder.decode(rng.integers(0, 256, 500).astype(np.uint8).tobytes())
            assert (events.x < 20).all()
            assert (events.y < 12).all()
        except WrongBytes:
            decoder, num_refused = decoder_of(layout, SMALL), num_refused + 1
    assert num_refused > 40


@pytest.mark.parametrize(
    ("head", "said"),
    [
        (b"GET / HTTP/1.1\r\nHost: x", "it begins with b'GET / HTTP/1'"),
        (b"Event Stream", "it begins"),
        (b"Event Stream" + bytes([1, 0, 0, 1, 9, 0, 9, 0]), "Event Stream 1, type 1"),
        (b"Event Stream" + bytes([2, 0, 0, 2, 9, 0, 9, 0]), "Event Stream 2, type 2; wanted version 2"),
        (b"Event Stream" + bytes([2, 0, 0, 1, 0, 0, 9, 0]), "sides are 1"),
    ],
)
def test_a_header_that_is_none_is_one_sentence(head, said):
    with pytest.raises(WrongBytes, match=said):
        event_stream_sensor(head)

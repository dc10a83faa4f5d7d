"""Streams: what a sender sends arrives, and a sender that misbehaves costs its connection and nothing else."""

import contextlib
import os
import socket
import threading
import time

import numpy as np
import pytest

from etnet.errors import RecordingError
from etnet.events.events import Events, Sensor
from etnet.live import address, tcp
from etnet.live.address import Address
from etnet.live.layouts import LayoutName
from etnet.live.recording import LiveRecording
from etnet.live.stdin import InputStream
from etnet.live.tcp import Listener
from etnet.live.udp import UdpStream
from tests.live.sources import make_events, same, wait_for
from tests.live.test_layouts import event_stream_bytes, record_bytes
from tests.strategies import SMALL

HERE = "127.0.0.1"


@pytest.fixture(autouse=True)
def hurried(monkeypatch):
    monkeypatch.setattr(address, "PATIENCE", 0.02)


def _tcp(layout: LayoutName = "es", stated: Sensor | None = SMALL) -> Listener:
    return Listener(Address("tcp"), layout, stated)


def _sender(stream: Listener) -> socket.socket:
    return socket.create_connection((HERE, stream.port), timeout=5)


def _send(stream: Listener, content: bytes) -> None:
    with _sender(stream) as sender:
        sender.sendall(content)


def _notes(live: LiveRecording) -> str:
    return " | ".join(note.text for note in live.notes)


def test_event_stream_over_tcp_arrives_with_the_size_that_it_states():
    events = make_events(3000)
    stream = _tcp(stated=None)
    sending = threading.Thread(target=_send, args=(stream, event_stream_bytes(events)))
    sending.start()
    source = stream.stream()
    assert source.sensor == SMALL
    with LiveRecording(source) as live:
        assert same(live.wait(3000, 60).read(0, 3000), events)
        sending.join()
        wait_for(lambda: "the sender hung up; waiting for it" in _notes(live))


def test_a_sender_that_hangs_up_is_followed_by_the_next_one_on_one_clock():
    events = make_events(100)
    stream = _tcp("t64_x16_y16_on8")
    with LiveRecording(stream.stream()) as live:
        for number in range(3):
            _send(stream, record_bytes(events, stream.layout))
            wait_for(lambda number=number: live.extent().num_events == 100 * (number + 1))
        read = live.recording().read(0, 300)
        assert (np.diff(read.t) >= 0).all()
        assert np.array_equal(read.x[200:], events.x)
        assert "the clock went back by" in _notes(live)


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (b"GET / HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n", "wrong bytes"),
        (b"\xff" * 4096, "wrong bytes"),
        (b"Event Stream" + bytes([2, 0, 0, 1, 99, 0, 99, 0]), "its sensor is 99×99, the one before had 20×12"),
        (b"", "hung up|wrong bytes"),
        (b"Even", "wrong bytes"),
    ],
)
def test_wrong_bytes_cost_the_connection_and_nothing_else(content, said):
    events = make_events(50)
    stream = _tcp()
    with LiveRecording(stream.stream()) as live:
        _send(stream, event_stream_bytes(events))
        live.wait(50, 60)
        _send(stream, content)
        wait_for(lambda: len(live.notes) >= 2)
        assert any(word in live.notes[1].text for word in said.split("|"))
        assert "\n" not in live.notes[1].text
        _send(stream, event_stream_bytes(events))
        assert same(live.wait(100, 60).read(0, 50), events), "what was there stays, and the next sender is heard"


def test_an_event_beyond_the_sensor_is_wrong_bytes():
    events = make_events(50, Sensor(300, 200))
    stream = _tcp("t64_x16_y16_on8")
    with LiveRecording(stream.stream()) as live:
        _send(stream, record_bytes(events, stream.layout))
        wait_for(lambda: "beyond 20×12" in _notes(live))
        assert live.loss.packets == 1
        assert live.extent().num_events == 0


def test_a_sender_that_says_nothing_holds_nobody_up_for_ever(monkeypatch):
    monkeypatch.setattr(tcp, "HEAD_PATIENCE", 0.1)
    stream = _tcp()
    with LiveRecording(stream.stream()) as live, _sender(stream):
        wait_for(lambda: "wrong bytes" in _notes(live))
        monkeypatch.setattr(tcp, "HEAD_PATIENCE", 60.0)
        _send(stream, event_stream_bytes(make_events(9)))
        live.wait(9, 60)


def test_a_sender_that_breaks_off_within_an_event_leaves_no_half_event():
    events = make_events(10)
    stream = _tcp("t64_x16_y16_on8")
    with LiveRecording(stream.stream()) as live:
        _send(stream, record_bytes(events, stream.layout)[:-5])
        live.wait(9, 60)
        wait_for(lambda: "hung up" in _notes(live))
        _send(stream, record_bytes(events, stream.layout))
        assert live.wait(19, 60).num_events == 19


def test_nobody_sends_is_a_sentence():
    stream = _tcp(stated=None)
    with pytest.raises(RecordingError, match="nothing was sent; start the sender"):
        stream.stream(patience=0.05)
    stream.close()


def test_streams_listen_on_this_machine_alone_unless_stated():
    stream = _tcp()
    assert stream.host == HERE
    stream.close()
    udp = UdpStream(Address("udp"), SMALL)
    assert udp._socket.getsockname()[0] == HERE
    udp.close()


def test_a_port_that_is_taken_is_a_sentence():
    stream = _tcp()
    with pytest.raises(RecordingError, match="cannot listen there"):
        Listener(Address("tcp", HERE, stream.port))
    stream.close()


@pytest.mark.filterwarnings("ignore:unclosed <socket:ResourceWarning")  # faery's encoder leaves its own open
@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")
@pytest.mark.parametrize("layout", ["t64_x16_y16_on8", "t32_x16_y15_on1"])
def test_datagrams_that_faery_sends_arrive(layout):
    import faery
    from faery import udp_encoder

    events = make_events(5000)
    rows = np.empty(5000, faery.EVENTS_DTYPE)
    rows["t"], rows["x"], rows["y"], rows["on"] = events.t, events.x, events.y, events.p > 0
    stream = UdpStream(Address("udp"), SMALL, layout)
    with LiveRecording(stream) as live:
        for start in range(0, 5000, 500):
            udp_encoder.encode([rows[start : start + 500]], (HERE, stream.port), format=layout)
            time.sleep(0.002)
        assert same(live.wait(5000, 60).read(0, 5000), events)


def _datagrams(stream: UdpStream, *contents: bytes) -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
        for content in contents:
            sender.sendto(content, (HERE, stream.port))


def test_datagrams_that_come_late_or_are_wrong_are_left_out_and_counted():
    events = make_events(30)
    parts = [record_bytes(events[i : i + 10], "t64_x16_y16_on8") for i in (0, 10, 20)]
    stream = UdpStream(Address("udp"), SMALL)
    with LiveRecording(stream) as live:
        _datagrams(stream, parts[0], b"\xff" * 130, b"\xfe" * 130, parts[2], parts[1])
        wait_for(lambda: live.loss.packets == 3)
        read = live.recording().read(0, 20)
        assert same(read, Events.concatenate([events[:10], events[20:]], SMALL))
        assert _notes(live).count("wrong bytes") == 1, "one line for a stretch of them"


def test_a_datagram_that_was_cut_spoils_none_after_it():
    events = make_events(30)
    parts = [record_bytes(events[i : i + 10], "t64_x16_y16_on8") for i in (0, 10, 20)]
    stream = UdpStream(Address("udp"), SMALL)
    with LiveRecording(stream) as live:
        _datagrams(stream, parts[0][:-5], parts[1], parts[2])
        read = live.wait(29, 60).read(0, 29)
        assert same(read, Events.concatenate([events[:9], events[10:]], SMALL))
        assert live.loss.packets == 1


def test_time_that_only_passes_ends_as_wrong_bytes():
    stream = _tcp()
    with LiveRecording(stream.stream()) as live:
        _send(stream, event_stream_bytes(make_events(5)) + b"\xff" * 1000)
        wait_for(lambda: (live.extent().until or 0) > 127_000)
        assert live.extent().num_events == 5, "time passes without events"
        flood = b"\xff" * (1 << 20)
        with _sender(stream) as sender, contextlib.suppress(OSError):
            sender.sendall(event_stream_bytes(make_events(1))[:20])
            for _ in range(40):
                sender.sendall(flood)
        wait_for(lambda: "s without an event" in _notes(live))


def test_event_stream_does_not_go_over_datagrams():
    with pytest.raises(RecordingError, match="send Event Stream over TCP instead"):
        UdpStream(Address("udp"), SMALL, "es")


def test_a_layout_without_a_size_needs_it_stated():
    with pytest.raises(RecordingError, match="--sensor 346x260"):
        Listener(Address("tcp"), "t64_x16_y16_on8")


def _piped(content: bytes):
    reading, writing = os.pipe()
    os.write(writing, content)
    os.close(writing)
    return os.fdopen(reading, "rb")


def test_standard_input_is_read_to_its_end():
    events = make_events(500)
    with _piped(event_stream_bytes(events)) as file, LiveRecording(InputStream(Address("stdin"), file=file)) as live:
        wait_for(lambda: live.is_over)
        assert same(live.recording().read(0, 500), events)
        assert live.notes == ()


def test_standard_input_that_tells_nothing_can_be_stopped():
    reading, writing = os.pipe()
    asked = iter((False, False, True))
    with os.fdopen(reading, "rb") as file, pytest.raises(RecordingError, match="stdin: stopped before any events came"):
        InputStream(Address("stdin"), file=file, is_stopped=lambda: next(asked))
    os.close(writing)


def test_wrong_bytes_on_standard_input_end_it_with_a_sentence():
    events = make_events(500)
    content = record_bytes(events, "t64_x16_y16_on8") + b"\xff" * 130
    with _piped(content) as file:
        stream = InputStream(Address("stdin"), SMALL, "t64_x16_y16_on8", file)
        with LiveRecording(stream) as live:
            wait_for(lambda: live.is_over)
            assert "stdin: wrong bytes" in _notes(live)
    with _piped(b"no event stream at all") as file, pytest.raises(RecordingError, match="it begins with"):
        InputStream(Address("stdin"), file=file)

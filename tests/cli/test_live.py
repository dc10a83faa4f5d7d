"""`etnet reconstruct --live` and `etnet record`, with a replayed recording."""

import os
import signal
import subprocess
import sys
import threading
import time
from types import SimpleNamespace

import pytest

from etnet.cli.live import LiveOptions, Teller, parsed_keep
from etnet.cli.main import main
from etnet.errors import RecordingError
from etnet.events.events import Events, Sensor
from etnet.events.open import open_recording
from etnet.events.recording import recording_of_events
from etnet.events.write import write_recording
from etnet.live.buffer import Keep
from etnet.live.open import SourceOptions, open_source, parsed_sensor
from etnet.live.replay import Replay
from etnet.live.source import Packet
from etnet.live.tcp import TcpStream
from etnet.live.udp import UdpStream
from etnet.nets.presets import build_model
from etnet.nets.weights import save_weights
from tests.live.sources import GivenPackets
from tests.strategies import make_events

SENSOR = Sensor(40, 28)


@pytest.fixture
def recorded(tmp_path):
    path = tmp_path / "events.h5"
    write_recording(recording_of_events(make_events(8_000, SENSOR, duration=600_000)), path)
    return path


@pytest.fixture
def weights(tmp_path):
    path = tmp_path / "tiny.safetensors"
    save_weights(build_model("tiny"), path)
    return path


def test_live_frames_are_written_and_come_again_from_the_recorded_file(tmp_path, recorded, capsys, weights):
    out, again, record = tmp_path / "live", tmp_path / "again", tmp_path / "live.aedat4"
    options, live = ["--model", str(weights)], ["reconstruct", "--live", str(recorded)]
    assert main([*live, "--out", str(out), "--record", str(record), "--windows", "duration=30ms", *options]) == 0
    said = capsys.readouterr().err
    assert "windows duration=30ms" in said
    assert "windows merged" in said
    assert main(["reconstruct", str(record), "--windows", "as-cut", "--out", str(again), *options]) == 0
    frames = sorted((out / "frames").iterdir())
    assert frames
    for frame in frames:
        assert frame.read_bytes() == (again / "frames" / frame.name).read_bytes()
    assert (again / "stamps.csv").read_text() == (out / "stamps.csv").read_text()
    rows = (out / "stamps.csv").read_text().splitlines()
    assert rows[0] == "frame,t_stop_us,t_start_us,num_events,merged"
    assert len(rows) == len(frames) + 1


def test_record_writes_what_is_replayed(tmp_path, recorded, capsys):
    out = tmp_path / "copy.aedat4"
    assert main(["record", str(recorded), str(out), "--speed", "0"]) == 0
    assert "8,000 events of 40×28" in capsys.readouterr().err
    with open_recording(out) as recording:
        assert recording.num_events == 8_000
    assert main(["record", str(recorded), str(out)]) == 1
    assert "is there already" in capsys.readouterr().err


def test_a_recording_that_is_replayed_is_never_emptied_by_its_own_copy(recorded, capsys):
    before = recorded.read_bytes()
    assert main(["record", str(recorded), str(recorded), "--overwrite"]) == 1
    assert "events.h5: is the recording that is replayed" in capsys.readouterr().err
    live = ["reconstruct", "--live", str(recorded), "--record", str(recorded), "--overwrite"]
    assert main([*live, "--out", str(recorded.parent / "out")]) == 1
    assert "events.h5: is the recording that is replayed" in capsys.readouterr().err
    assert recorded.read_bytes() == before


@pytest.mark.parametrize(
    ("windows", "said"),
    [
        ("durtion=30ms", "are not understood"),
        ("between-frames", "live windows go by count, density or duration"),
        ("duration=20ms/5ms", "live windows do not overlap"),
    ],
)
def test_windows_that_cannot_be_cost_no_former_take(tmp_path, recorded, capsys, weights, windows, said):
    take = tmp_path / "talk.h5"
    options = ["--out", str(tmp_path / "out"), "--model", str(weights), "--windows", windows]
    live = ["reconstruct", "--live", str(recorded), "--record", str(take), *options]
    assert main(live) == 1
    assert said in capsys.readouterr().err
    assert not take.exists()
    take.write_bytes(b"a former take")
    assert main([*live, "--overwrite"]) == 1
    assert take.read_bytes() == b"a former take"


class _Faulty(GivenPackets):
    """Tells one fault, gives no event, and ends when the fault was heard."""

    def __init__(self, heard: threading.Event) -> None:
        super().__init__([], SENSOR)
        self._heard, self.was_heard = heard, False

    def packets(self, is_stopped):
        yield Packet(Events.empty(SENSOR), notes=("the cable is loose",))
        self.was_heard = self._heard.wait(60)


@pytest.mark.parametrize("windows", [[], ["--windows", "count=100"]])
def test_a_fault_is_told_while_no_window_is_full(tmp_path, monkeypatch, weights, windows):
    heard = threading.Event()
    source = _Faulty(heard)
    monkeypatch.setattr("etnet.cli.live.open_source", lambda *_: source)
    monkeypatch.setattr(
        "etnet.cli.live.console.print", lambda text, **_: heard.set() if "the cable is loose" in text else None
    )
    options = ["--out", str(tmp_path / "out"), "--model", str(weights), *windows]
    assert main(["reconstruct", "--live", "camera", *options]) == 1, "no frame came"
    assert source.was_heard, "before the source was over"


NO_EVENTS = 40_000
"""Bytes: more than a file has before its first events, and less than it has with them."""


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_ends_a_recording_properly(tmp_path, recorded, number):
    out = tmp_path / "endless.h5"
    command = [sys.executable, "-m", "etnet", "record", str(recorded), str(out), "--loop"]
    with subprocess.Popen(command, stderr=subprocess.PIPE, text=True) as process:
        until = time.monotonic() + 60
        while not (out.exists() and out.stat().st_size > NO_EVENTS) and time.monotonic() < until:
            time.sleep(0.02)
        os.kill(process.pid, number)
        assert process.stderr is not None
        said = process.stderr.read()
    assert process.returncode == 0, said
    with open_recording(out) as recording:
        assert f"{recording.num_events:,} events of 40×28" in said


def test_what_is_written_after_live_names_a_source(recorded):
    source = open_source(str(recorded), SourceOptions(is_looped=True, speed=2.0))
    assert isinstance(source, Replay)
    assert source.is_looped
    source.close()
    tcp = open_source("tcp:0", SourceOptions(sensor=SENSOR))
    assert isinstance(tcp, TcpStream)
    tcp.close()
    udp = open_source("udp:0", SourceOptions(sensor=SENSOR))
    assert isinstance(udp, UdpStream)
    udp.close()
    for text, said in (
        ("nonsense", "neither a file nor a live source; wanted camera, davis346"),
        ("udp:7777", "state it: --sensor 346x260"),
        ("tcp:x", "no port"),
        ("udp:99999", "--sensor|no port"),
    ):
        with pytest.raises(RecordingError, match=said):
            open_source(text)


def test_sizes_and_what_is_kept_are_parsed():
    assert parsed_sensor("346x260") == Sensor(346, 260)
    assert parsed_keep("60s,512MB") == Keep()
    assert parsed_keep("5s").seconds == 5
    assert parsed_keep("100MB").num_bytes == 100 << 20
    for text in ("", "60", "x", "1.2.3s"):
        with pytest.raises(RecordingError, match="--keep"):
            parsed_keep(text)
    with pytest.raises(RecordingError, match="346x260"):
        parsed_sensor("346")
    assert LiveOptions(sensor="346x260").source_options().sensor == Sensor(346, 260)


def test_without_a_terminal_the_state_is_told_once_a_minute(capsys, monkeypatch):
    now = [0.0]
    monkeypatch.setattr("etnet.cli.live.time.monotonic", lambda: now[0])
    live = SimpleNamespace(
        notes_from=lambda told: (told, ()),
        extent=lambda: SimpleNamespace(until=2_000_000, first_stamp=0, num_events=5),
        loss=SimpleNamespace(packets=0),
    )
    told = Teller(live)
    for second in range(0, 181, 5):
        now[0] = float(second)
        told.tell("state")
    assert capsys.readouterr().err.splitlines() == ["  2.0 s, 5 events, state"] * 3

"""Cameras through the driver: its packets become events, frames and triggers, its faults one sentence each."""

import sys

import numpy as np
import pytest

pytest.importorskip("neuromorphic_drivers")

from etnet.errors import RecordingError
from etnet.events.events import Sensor
from etnet.live import driver as module
from etnet.live.driver import CameraSource, driver_module, list_cameras
from etnet.live.recording import LiveRecording
from tests.live.sources import make_events, same, wait_for
from tests.live.stand_in_driver import TRIGGER, StandIn, davis_frame, davis_packet

DAVIS = Sensor(346, 260)


@pytest.fixture(autouse=True)
def hurried(monkeypatch):
    monkeypatch.setattr(module, "LOOK_AGAIN", 0.01)


def _live(*openings, **options) -> LiveRecording:
    return LiveRecording(CameraSource(module=StandIn(openings, **options)))


def _over(live: LiveRecording) -> LiveRecording:
    live.start()
    wait_for(lambda: live.is_over)
    return live


def test_packets_become_events_frames_and_triggers():
    events = make_events(1000, DAVIS)
    pixels = np.random.default_rng(0).integers(0, 1024, (260, 346)).astype(np.uint16) * 64
    triggers = np.array([(100, 1, 0), (200, 1, 1), (300, 0, 2)], TRIGGER)
    packets = [
        (davis_packet(events[:600], triggers), int(events.t[599])),
        "timeout",
        (davis_packet(events[600:], frames=[davis_frame(40_000, pixels)]), 60_000),
        (davis_packet(), 70_000),
    ]
    live = _over(_live(packets))
    recording = live.recording()
    assert recording.name == "iniVation DAVIS 346 00000391"
    assert recording.sensor == DAVIS
    assert same(recording.read(0, 1000), events)
    assert recording.ground_truth is not None
    assert list(recording.ground_truth.stamps) == [37_900], "the middle of the exposure"
    assert np.array_equal(np.rint(recording.ground_truth.read_frame(0) * 255), pixels >> 8)
    assert recording.triggers is not None
    assert list(recording.triggers.edges) == [-1, 1, 0]
    assert list(recording.triggers.channels) == [1, 1, 0]
    assert live.extent().until == 70_000, "time goes on without events"


def test_packets_that_the_computer_dropped_are_counted():
    events = make_events(10, DAVIS)
    live = _over(_live([(davis_packet(events, overflows=[3, 7]), 60_000), (davis_packet(), 61_000)]))
    assert live.loss.packets == 2


def test_a_bias_is_changed_between_two_packets_and_stands_in_the_recording():
    source = CameraSource(module=(driver := StandIn([[(davis_packet(), t) for t in range(5)]])))
    assert {setting.name for setting in source.settings()} >= {"diffbn", "onbn", "offbn", "refrbp"}
    source.change("onbn", 1600)
    source.change("onbn", 1700)
    live = _over(LiveRecording(source))
    assert driver.devices[0].configurations[-1].biases.onbn == 1700
    assert [note.text for note in live.notes] == ["onbn is 1700 now"]
    assert next(setting.value for setting in source.settings() if setting.name == "onbn") == 1700


def test_a_bias_that_there_is_not_or_that_is_out_of_bounds_is_a_sentence():
    source = CameraSource(module=StandIn([[]]))
    with pytest.raises(RecordingError, match="no bias is called 'nonsense'; there are localbufbn"):
        source.change("nonsense", 1)
    with pytest.raises(RecordingError, match="onbn is 5000; this camera takes 0 to 2047"):
        source.change("onbn", 5000)


@pytest.mark.parametrize(
    ("error", "said"),
    [
        ("the device is already used by another program", "another program uses the camera; close DV"),
        ("Resource busy", "another program uses the camera; close DV"),
        ("Access denied (insufficient permissions)", "run `sudo .*neuromorphic-drivers-install-udev-rules"),
        ("a thing nobody has seen", r"the driver gives up \(a thing nobody has seen\)"),
    ],
)
def test_a_camera_that_cannot_be_opened_is_one_sentence(error, said):
    with pytest.raises(RecordingError, match=said) as raised:
        _live(RuntimeError(error))
    assert "\n" not in str(raised.value)
    with pytest.raises(RecordingError, match=said):
        _live([], error=error)


def test_no_camera_and_several_cameras_are_one_sentence():
    with pytest.raises(RecordingError, match=r"no such camera is plugged in.*none at all"):
        _live([], plugged_in=[])
    two = [("INIVATION_DAVIS346", "1", None), ("PROPHESEE_EVK4", "2", None)]
    with pytest.raises(RecordingError, match=r"several cameras are plugged in .davis346 1; evk4 2.; name one"):
        _live([], plugged_in=two)
    assert CameraSource("davis346", module=StandIn([[]], plugged_in=two)).name.endswith(" 1")
    assert [camera.kind for camera in list_cameras(StandIn([], plugged_in=two))] == ["davis346", "evk4"]


@pytest.mark.parametrize("error", ["No such device (it may have been disconnected)", "Io", "NoDevice"])
def test_an_unplugged_camera_is_said_waited_for_and_goes_on_with_its_biases(error):
    events = make_events(100, DAVIS)
    driver = StandIn([[(davis_packet(events), 60_000), RuntimeError(error)], [(davis_packet(events), 60_000)]])
    plugged_in, driver.plugged_in = driver.plugged_in, driver.plugged_in
    source = CameraSource(module=driver)
    source.change("onbn", 1700)
    driver.plugged_in = []
    with LiveRecording(source) as live:
        wait_for(lambda: len(live.notes) >= 2)
        assert "the camera was unplugged; plug it in again" in live.notes[-1].text
        assert live.recording().num_events == 100, "what was there stays"
        assert driver.devices[0].is_closed
        driver.plugged_in = plugged_in
        wait_for(lambda: live.is_over)
        said = " | ".join(note.text for note in live.notes)
        assert "the camera is back" in said
        read = live.recording().read(0, 200)
        assert (np.diff(read.t) >= 0).all(), "a camera's clock begins again; ours does not"
    assert driver.devices[1].configurations[0].biases.onbn == 1700


def test_another_fault_ends_the_source_with_a_sentence_and_what_came_stays():
    events = make_events(100, DAVIS)
    live = _over(_live([(davis_packet(events), 60_000), RuntimeError("overflow of the whatever")]))
    assert "the driver gives up (overflow of the whatever)" in live.notes[0].text
    assert live.recording().num_events == 100


def test_without_the_driver_the_command_that_installs_it_is_said(monkeypatch):
    monkeypatch.setitem(sys.modules, "neuromorphic_drivers", None)
    with pytest.raises(RecordingError, match=r"pip install 'etnet\[live\]'"):
        driver_module()


def test_usb_that_cannot_be_looked_through_is_a_sentence():
    driver = StandIn([])

    def failing():
        raise RuntimeError("Other error")

    driver.list_devices = failing
    with pytest.raises(RecordingError, match="USB cannot be looked through"):
        list_cameras(driver)

"""Cameras through the driver: its packets become events, frames and triggers, its faults one sentence each."""

import sys
import threading

import numpy as np
import pytest

pytest.importorskip("neuromorphic_drivers")

from etnet.errors import RecordingError
from etnet.events.events import Sensor
from etnet.live import driver as module
from etnet.live.driver import CameraSource, driver_module, list_cameras
from etnet.live.recording import LiveRecording, Waiting
from etnet.live.source import Setting
from tests.live.sources import make_events, same, wait_for
from tests.live.stand_in_driver import TRIGGER, TYPES, StandIn, davis_frame, davis_packet, evt3_packet

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


def test_packets_that_the_ring_dropped_are_counted_once_though_the_events_tell_of_them_too():
    events = make_events(30, DAVIS)
    packets = [
        (davis_packet(events[:10]), 1, {"dropped_packets": 5}),
        (davis_packet(events[10:20], overflows=[3]), 2, {"dropped_packets": 5}),
        "timeout",
        (davis_packet(), 3, {"dropped_packets": 6}),
        (davis_packet(events[20:]), 4, {"dropped_packets": 6}),
    ]
    assert _over(_live(packets)).loss.packets == 6


def test_packets_of_triggers_samples_and_frames_that_were_dropped_are_counted_too():
    for kind in ("trigger_events", "imu_events", "frames"):
        live = _over(_live([(davis_packet(others={kind: [0]}), 1), (davis_packet(), 2)]))
        assert live.loss.packets == 1, kind


def test_a_camera_that_was_opened_again_counts_its_drops_from_none():
    steps = [(davis_packet(), 1, {"dropped_packets": 5}), RuntimeError("NoDevice")]
    driver = StandIn([steps, [(davis_packet(), 1, {"dropped_packets": 7})]])
    live = LiveRecording(CameraSource(module=driver))
    plugged_in, driver.plugged_in = driver.plugged_in, []
    with live:
        wait_for(lambda: live.notes != ())
        driver.plugged_in = plugged_in
        wait_for(lambda: live.is_over)
    assert live.loss.packets == 12


def test_how_long_packets_lie_in_the_driver_is_told_and_counts_as_being_behind():
    events, gone = make_events(10, DAVIS), threading.Event()
    late = {"system_time": -3.0, "backlog": 17}

    def steps():
        yield davis_packet(events), int(events.t[-1]), late
        gone.wait(30)
        yield "timeout"

    live = _live(steps()).start()
    wait_for(lambda: live.extent().num_events == 10)
    wait_for(lambda: live.behind(int(events.t[-1])) is not None)  # told last of all
    assert live.waiting == Waiting(4.0, 17)
    behind = live.behind(int(events.t[-1]))
    assert behind is not None
    assert 4 <= behind < 34
    gone.set()
    wait_for(lambda: live.is_over)
    assert live.waiting == Waiting(None, 0), "nothing waits any more"


def test_a_bias_is_changed_between_two_packets_and_stands_in_the_recording():
    source = CameraSource(module=(driver := StandIn([[(davis_packet(), t) for t in range(5)]])))
    assert {setting.name for setting in source.settings()} >= {"diffbn", "onbn", "offbn", "refrbp"}
    source.change("onbn", 1600)
    source.change("onbn", 1700)
    live = _over(LiveRecording(source))
    assert driver.devices[0].configurations[-1].biases.onbn == 1700
    assert [note.text for note in live.notes] == ["onbn is 1700 now"]
    assert next(setting.value for setting in source.settings() if setting.name == "onbn") == 1700


def _camera(name, *openings):
    driver = StandIn(openings or [[]], plugged_in=[(name, "1", None)])
    return driver, CameraSource(module=driver)


def _changed(name, packet, **wanted):
    """The configuration that a camera has after settings were changed, and what its recording says of them."""
    driver, source = _camera(name, [(packet, t) for t in range(5)])
    for setting, value in wanted.items():
        source.change(setting, value)
    live = _over(LiveRecording(source))
    return driver.devices[0].configurations[-1], [note.text for note in live.notes], source


def test_the_rate_limiter_of_an_evk4_is_switched_and_set():
    kind = "PROPHESEE_EVK4"
    _, source = _camera(kind)
    listed = {setting.name: setting for setting in source.settings()}
    assert listed["rate_limiter"] == Setting("rate_limiter", 0, 0, 1, is_switch=True)
    assert listed["rate_limiter.reference_period_us"] == Setting("rate_limiter.reference_period_us", 200, 1, 1023)
    assert listed["diff_on"].maximum == 200
    assert not any("mask" in name or "clock" in name for name in listed)
    configuration, said, source = _changed(
        kind, evt3_packet(), rate_limiter=1, **{"rate_limiter.maximum_events_per_period": 700}
    )
    limiter = configuration.rate_limiter
    assert (limiter.reference_period_us, limiter.maximum_events_per_period) == (200, 700)
    assert said == ["rate_limiter is on now", "rate_limiter.maximum_events_per_period is 700 now"]
    configuration, said, _ = _changed(kind, evt3_packet(), rate_limiter=0)
    assert configuration.rate_limiter is None
    assert said == ["rate_limiter is off now"]


def test_a_rate_limiter_keeps_its_numbers_while_it_is_off():
    configuration, _, source = _changed(
        "PROPHESEE_EVK3_HD", evt3_packet(), **{"rate_limiter.reference_period_us": 500, "rate_limiter": 0}
    )
    assert configuration.rate_limiter is None
    assert Setting("rate_limiter.reference_period_us", 500, 1, 1023) in source.settings()


def test_filters_and_exposure_of_a_davis346_are_settings():
    wanted = {
        "polarity_filter": 2, "skip_events_every": 3, "exposure_us": 9_000, "frame_interval_us": 50_000,
        "activity_filter.mask_isolated_enable": 0, "activity_filter.refractory_period_tau": 12,
    }  # fmt: skip
    configuration, said, _ = _changed("INIVATION_DAVIS346", davis_packet(), **wanted)
    assert configuration.polarity_filter is TYPES["INIVATION_DAVIS346"].PolarityFilter.MASK_ON
    assert (configuration.skip_events_every, configuration.exposure_us) == (3, 9_000)
    assert configuration.frame_interval_us == 50_000
    assert configuration.activity_filter.mask_isolated_enable is False
    assert configuration.activity_filter.refractory_period_tau == 12
    assert configuration.activity_filter.mask_isolated_tau == 8, "what was not changed stays"
    assert "polarity_filter is mask on now" in said
    assert "activity_filter.mask_isolated_enable is off now" in said


def test_readout_and_switched_biases_of_a_dvxplorer_are_settings():
    configuration, said, _ = _changed(
        "INIVATION_DVXPLORER", davis_packet(), readout_frames_per_second=8, nrst=1, log_a=0, amp=7
    )
    types = TYPES["INIVATION_DVXPLORER"]
    assert configuration.readout_frames_per_second is types.ReadoutFramesPerSecond.VARIABLE5000
    assert configuration.biases == types.Biases(amp=7, nrst=True, log_a=False)
    assert said == [
        "readout_frames_per_second is variable5000 now", "amp is 7 now", "nrst is on now", "log_a is off now",
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("name", "setting", "value"),
    [
        ("PROPHESEE_EVK4", "rate_limiter.reference_period_us", 1024),
        ("PROPHESEE_EVK4", "rate_limiter", 2),
        ("INIVATION_DAVIS346", "polarity_filter", 5),
        ("INIVATION_DAVIS346", "skip_events_every", -1),
        ("INIVATION_DVXPLORER", "readout_frames_per_second", 11),
    ],
)
def test_what_a_camera_does_not_take_is_a_sentence(name, setting, value):
    _, source = _camera(name)
    with pytest.raises(RecordingError, match=f"{setting} is {value}; this camera takes"):
        source.change(setting, value)


def test_a_setting_that_was_changed_as_the_camera_was_pulled_out_stands_in_the_recording_all_the_same():
    driver = StandIn([[RuntimeError("NoDevice")], [(davis_packet(), 1)]])
    source = CameraSource(module=driver)
    source.change("onbn", 1700)
    with LiveRecording(source) as live:
        wait_for(lambda: live.is_over)
    assert driver.devices[1].configurations[0].biases.onbn == 1700
    assert "onbn is 1700 now" in [note.text for note in live.notes]


def test_a_bias_that_there_is_not_or_that_is_out_of_bounds_is_a_sentence():
    source = CameraSource(module=StandIn([[]]))
    with pytest.raises(RecordingError, match=r"no setting is called 'nonsense'; there are .*localbufbn"):
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
    with pytest.raises(RecordingError, match=r"pip install neuromorphic-drivers"):
        driver_module()


def test_usb_that_cannot_be_looked_through_is_a_sentence():
    driver = StandIn([])

    def failing():
        raise RuntimeError("Other error")

    driver.list_devices = failing
    with pytest.raises(RecordingError, match="USB cannot be looked through"):
        list_cameras(driver)

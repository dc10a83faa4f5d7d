"""Biases follow the event rate, within the camera's bounds, and every change is kept."""

import pytest

pytest.importorskip("neuromorphic_drivers")

from etnet.errors import RecordingError
from etnet.events.events import Sensor
from etnet.live.driver import CameraSource
from etnet.live.rate import Band, RateFollower, following, steps_of
from etnet.live.recording import LiveRecording
from etnet.live.source import Setting
from tests.live.sources import make_events, wait_for
from tests.live.stand_in_driver import StandIn, davis_packet

BAND = Band(1e5, 3e5)
DAVIS = (Setting("onbn", 1500, 0, 2047), Setting("offbn", 600, 0, 2047), Setting("refrbp", 9, 0, 2047))


def test_within_the_band_nothing_changes_and_beyond_it_thresholds_rise_or_fall():
    assert following("davis346", DAVIS, 2e5, BAND) == ()
    assert following("davis346", DAVIS, 9e5, BAND) == (("onbn", 1530), ("offbn", 570))
    assert following("davis346", DAVIS, 0, BAND) == (("onbn", 1470), ("offbn", 630))
    evk4 = (Setting("diff_on", 0, -85, 140), Setting("diff_off", 0, -35, 190))
    assert following("evk4", evk4, 9e5, BAND) == (("diff_on", 4), ("diff_off", 4))


def test_a_bound_is_never_passed():
    at_bound = (Setting("onbn", 2040, 0, 2047), Setting("offbn", 0, 0, 2047))
    assert following("davis346", at_bound, 9e5, BAND) == (("onbn", 2047),)


def test_the_rate_is_taken_over_half_a_second():
    follower = RateFollower("davis346", BAND)
    assert follower.changes(0, 0, DAVIS) == ()
    assert follower.changes(100_000, 900_000, DAVIS) == ()
    assert follower.changes(500_000, 900_000, DAVIS) == (("onbn", 1530), ("offbn", 570))
    assert follower.changes(1_000_000, 1_000_000, DAVIS) == (), "0.2 Mev/s since then"


def test_other_cameras_and_bands_upside_down_are_refused():
    with pytest.raises(RecordingError, match="on evk4 and davis346 only"):
        steps_of("dvxplorer")
    with pytest.raises(RecordingError, match="the first is the lower one"):
        Band(2, 1)


def test_a_camera_that_sees_too_much_is_made_duller_and_that_is_noted():
    events = make_events(1000, Sensor(346, 260), duration=1000)
    packets = [(davis_packet(events if t == 2 else None), 400_000 * t) for t in range(1, 6)]
    source = CameraSource(module=(driver := StandIn([packets])))
    live = LiveRecording(source, follower=RateFollower("davis346", Band(0, 100))).start()
    wait_for(lambda: live.is_over)
    assert [c.biases.onbn for c in driver.devices[0].configurations] == [1594]
    assert sorted(note.text for note in live.notes) == ["offbn is 553 now", "onbn is 1594 now"]

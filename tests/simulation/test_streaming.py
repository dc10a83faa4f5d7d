"""The sensor that frames are shown to one by one: its imperfections over time, and arrays from Python."""

from dataclasses import replace

import numpy as np
import pytest

import etnet.simulation
from etnet.errors import RecordingError
from etnet.events.events import Events, Sensor
from etnet.simulation import CAMERAS, PixelSettings, Stepping, Tone, simulate
from etnet.simulation.settings import camera_named
from etnet.simulation.streaming import EventSimulator
from tests.simulation.films import drifting

SHAPE = (48, 64)
IDEAL = PixelSettings()


def fed(settings, shown, step_us=10_000.0, stepping=None, **options):
    with EventSimulator(settings.traits, stepping, **options) as simulator:
        found = [simulator.feed(light.astype(np.float32), i * step_us) for i, light in enumerate(shown)]
        found.append(simulator.finish())
    return Events.concatenate(found, Sensor(SHAPE[1], SHAPE[0]))


def test_a_lag_moves_every_event_and_none_is_lost_or_out_of_order():
    shown = [Tone("srgb").light(picture / 255) for picture in drifting(6, 2.0)]
    plain, late = fed(IDEAL, shown), fed(replace(IDEAL, lag_us=12_345.0), shown)
    assert np.array_equal(late.t, plain.t + 12_345)
    assert np.array_equal(late.x, plain.x)


def test_hot_pixels_stay_the_same_ones():
    settings = replace(IDEAL, hot_share=0.005, hot_hz=200.0)
    events = fed(settings, [np.full(SHAPE, 0.3)] * 100)
    pixel = events.y.astype(int) * SHAPE[1] + events.x
    assert len(events) > 500
    assert len(set(pixel.tolist())) == len(set(pixel[events.t < 300_000].tolist())) < 40


def test_noise_and_leak_have_their_rates():
    seconds, dark, white = 2.0, np.zeros(SHAPE), np.ones(SHAPE)
    for light, settings, rate in (
        (dark, replace(IDEAL, shot_noise_rate_hz=5.0), 5.0),
        (white, replace(IDEAL, shot_noise_rate_hz=5.0), 1.25),
        (dark, replace(IDEAL, leak_rate_hz=3.0), 3.0),
    ):
        events = fed(settings, [light] * 21, 100_000.0)
        assert len(events) / seconds / light.size == pytest.approx(rate, rel=0.1)


def test_a_dark_pixel_is_slower_than_a_bright_one():
    before, after = np.full(SHAPE, 0.05), np.full(SHAPE, 0.1)
    before[:, 32:], after[:, 32:] = 0.5, 1.0
    settings = replace(IDEAL, cutoff_hz=20.0, pos_thres=0.1, dark=1e-4)
    events = fed(settings, [before] * 2 + [after] * 20, 1_000.0, Stepping("off"))
    early = events.t < 6_000
    assert (events.x[early] >= 32).mean() > 0.8
    assert fed(replace(settings, cutoff_hz=0.0), [before] * 2 + [after] * 20, 1_000.0).t.max() <= 2_000


def test_a_camera_with_an_exposure_averages_what_moved_past_it():
    with EventSimulator(IDEAL.traits, Stepping(8), exposure_us=10_000.0) as simulator:
        simulator.feed(np.full(SHAPE, 0.1, np.float32), 0.0)
        simulator.feed(np.full(SHAPE, 0.8, np.float32), 10_000.0)
        assert 0.2 < simulator.camera.mean() < 0.6


def test_the_same_seed_gives_the_same_noise_and_another_seed_another():
    settings = replace(IDEAL, shot_noise_rate_hz=20.0)
    one, again, other = (fed(settings, [np.full(SHAPE, 0.3)] * 5, seed=seed) for seed in (1, 1, 2))
    assert np.array_equal(one.t, again.t)
    assert not np.array_equal(one.t, other.t)


def test_a_generator_of_frames_is_taken_one_by_one():
    taken = []

    def endless():
        for i in range(1_000_000):
            taken.append(i)
            yield drifting(1, 1.0)[0] if i % 2 else drifting(1)[0][:, ::-1].copy()

    found = simulate(endless(), (i * 1_000.0 for i in range(1_000_000)))
    assert sum(len(next(found)) for _ in range(3)) > 1_000
    assert len(taken) < 10


def test_arrays_of_any_depth_and_colour_give_the_same_events():
    eight = drifting(5, 2.0)
    stamps = np.arange(5) * 20_000.0
    plain = list(simulate(eight, stamps))
    for other in (
        [picture.astype(np.uint16) * 257 for picture in eight],
        [np.stack([picture] * 3, 2) for picture in eight],
    ):
        changed = list(simulate(other, stamps))
        assert sum(map(len, changed)) == pytest.approx(sum(map(len, plain)), abs=2)
    light = [Tone("srgb").light(picture / 255) for picture in eight]
    assert sum(map(len, simulate(light, stamps, tone=Tone("linear")))) == pytest.approx(sum(map(len, plain)), abs=2)


def test_sixteen_bits_make_no_steps_of_dark_ramps():
    ramp = np.linspace(0.004, 0.02, 60)[:, None, None] * np.ones((1, *SHAPE))
    deep = [np.rint(Tone("srgb").code(frame.astype(np.float32)) * 65_535).astype(np.uint16) for frame in ramp]
    flat = [np.rint(frame / 257).astype(np.uint8) for frame in deep]
    settings = PixelSettings(pos_thres=0.05, neg_thres=0.05, dark=1e-3)
    stamps = np.arange(60) * 10_000.0
    gaps = []
    for film in (deep, flat):
        counts = [len(events) for events in simulate(film, stamps, settings)]
        gaps.append(np.std(counts) / np.mean(counts))
    assert gaps[0] < 0.5 * gaps[1]


def test_cameras_are_found_by_name_and_name_their_source():
    assert camera_named("davis346").size == (346, 260)
    assert all(len(camera.source) > 20 for camera in CAMERAS.values())
    with pytest.raises(RecordingError, match="choose from DAVIS240C"):
        camera_named("nonsense")
    assert sum(map(len, simulate(drifting(3), [0, 10_000, 20_000], "DAVIS240C"))) > 0


@pytest.mark.parametrize("wrong", [{"pos_thres": 0.0}, {"dark": 0.0}, {"cutoff_hz": -1.0}, {"hot_share": 2.0}])
def test_settings_outside_reason_are_refused(wrong):
    with pytest.raises(RecordingError, match="it takes"):
        PixelSettings(**wrong)


def test_frames_that_are_no_pictures_are_refused():
    with pytest.raises(RecordingError, match="wanted"):
        list(simulate([np.zeros((4, 4, 2), np.uint8)] * 2, [0, 1]))


def test_public_names_load_lazily():
    for name in etnet.simulation.__all__:
        assert getattr(etnet.simulation, name) is not None
    with pytest.raises(AttributeError):
        _ = etnet.simulation.nonsense

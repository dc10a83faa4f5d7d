"""Frames between frames against scenes whose every moment is known, and what must hold of any."""

from itertools import pairwise

import cv2
import numpy as np
import pytest

from etnet.errors import RecordingError
from etnet.events.events import Events
from etnet.simulation.footage import Frame
from etnet.simulation.motion import flow_between, guide_of, motion_between
from etnet.simulation.streaming import EventSimulator
from etnet.simulation.tone import Tone
from etnet.simulation.walk import Stepping, Walk
from tests.simulation.known_motion import FRAME_US, IDEAL, KnownScene, photo, voxel_error

AUTO, OFF = Stepping("auto"), Stepping("off")


def lights(scene):
    return [Tone("srgb").light(frame / 255).astype(np.float32) for frame in scene.film]


def same(one: list[Events], other: list[Events]) -> bool:
    return all(
        np.array_equal(getattr(a, axis), getattr(b, axis)) for a, b in zip(one, other, strict=True) for axis in "xytp"
    )


@pytest.mark.parametrize(
    ("speed", "has_disc", "aim"),
    [
        (1.7, False, 0.38),
        (4.0, False, 0.28),
        (10.0, False, 0.22),
        (1.7, True, 0.36),
        (4.0, True, 0.30),
        (10.0, True, 0.25),
    ],
)
def test_events_of_a_film_are_nearly_those_of_the_scene(speed, has_disc, aim):
    scene = KnownScene(speed, has_disc, num_frames=9)
    true, found = scene.true_events, scene.simulated(AUTO)
    assert voxel_error(found, true) < aim < voxel_error(scene.simulated(OFF), true)
    assert sum(map(len, found)) == pytest.approx(sum(map(len, true)), rel=0.1)


def test_a_small_slow_scene_with_occlusion_stays_within_its_aim():
    scene = KnownScene(1.7, True, (160, 120))
    assert voxel_error(scene.simulated(AUTO), scene.true_events) < 0.36


def test_the_mean_of_two_flows_that_agree_errs_less_than_either():
    scene = KnownScene(4.0, num_frames=2)
    guides = tuple(guide_of(light) for light in lights(scene))
    levels = tuple(np.log(light + np.float32(0.01)) for light in lights(scene))
    there, back = flow_between(*guides), flow_between(*guides[::-1])
    between = motion_between(*levels, (there, back))
    seen = between.forward.trust > 0.9

    def error(flow):
        """How little of the second picture the first one shows where the flow leads."""
        height, width = levels[0].shape
        grid = np.stack(np.meshgrid(np.arange(width), np.arange(height)), 2).astype(np.float32)
        shown = cv2.remap(levels[1], grid + flow, None, cv2.INTER_CUBIC, borderMode=cv2.BORDER_REPLICATE)
        return float(np.abs(shown - levels[0])[seen].mean())

    assert error(between.forward.flow) < error(there)
    # Each is moved towards the other by half of what they miss each other by.
    assert np.abs(between.forward.flow - there).max() <= 0.5 * np.abs(there).max()


@pytest.mark.parametrize("size", [(96, 72), (141, 101)])
def test_the_number_of_threads_changes_nothing(size):
    scene, before = KnownScene(4.0, True, size, num_frames=4), cv2.getNumThreads()
    found = []
    try:
        for inside, ours in ((1, 1), (1, 4), (3, 1), (8, 2)):
            cv2.setNumThreads(inside)
            found.append(scene.simulated(AUTO, ours))
    finally:
        cv2.setNumThreads(before)
    assert sum(map(len, found[0])) > 1000
    assert all(same(a, b) for a, b in pairwise(found))


def test_one_by_one_or_in_a_run_the_events_are_the_same():
    scene = KnownScene(3.0, False, (96, 72), num_frames=5)
    with EventSimulator(IDEAL) as simulator:
        fed = [simulator.feed(light, i * FRAME_US) for i, light in enumerate(lights(scene))]
    assert same(fed[1:], scene.simulated(AUTO))


@pytest.mark.parametrize("size", [(240, 180), (161, 121), (96, 72)])
def test_the_frames_themselves_are_the_ends_of_the_way(size):
    first, second = (cv2.log(light + np.float32(0.01)) for light in lights(KnownScene(4.0, size=size, num_frames=2)))
    guides = tuple(guide_of(cv2.exp(level)) for level in (first, second))
    between = motion_between(first, second, (flow_between(*guides), flow_between(*guides[::-1])))
    assert np.abs(between.level(1e-6) - first).max() < 0.01
    assert np.abs(between.level(1 - 1e-6) - second).max() < 0.01


def test_steps_keep_motion_at_a_pixel_and_a_pixels_events_at_one_up_to_a_cap():
    shown = lights(KnownScene(6.0, num_frames=2))
    for threshold, most, low, high in ((10.0, 32, 6, 12), (0.2, 64, 8, 16), (0.01, 64, 10, 16), (0.01, 8, 8, 8)):
        walk = Walk(Stepping(most_steps=most), 0.01, threshold, threads=1)
        walk.to(Frame(0.0, shown[0]))
        passage = walk.to(Frame(FRAME_US, shown[1]))
        assert low <= passage.num_steps <= high
        moments = [t for t, _ in passage.steps]
        assert len(moments) == passage.num_steps
        assert np.allclose(np.diff([0.0, *moments]), FRAME_US / passage.num_steps)


def test_a_cut_ends_a_sequence_and_the_sensor_starts_again():
    one, two = lights(KnownScene(2.0, num_frames=4)), photo("chelsea")[:180, :240]
    shown = [*one, *(np.roll(two, i, 1) for i in range(4))]
    with EventSimulator(IDEAL) as simulator:
        found = [simulator.feed(light, i * FRAME_US) for i, light in enumerate(shown)]
        account = simulator.account
    assert len(found[4]) == 0 < min(len(found[3]), len(found[5]))
    assert list(account.cuts) == [4 * FRAME_US]
    assert any("1 cut, at 0.13 s" in text for text in account.sentences(0.2))


def test_a_fast_pan_and_a_flash_are_no_cuts():
    pan = lights(KnownScene(14.0, num_frames=4))
    flash = [pan[0], pan[0] * np.float32(2.5), pan[0]]
    for shown in (pan, flash):
        with EventSimulator(IDEAL) as simulator:
            for i, light in enumerate(shown):
                simulator.feed(light, i * FRAME_US)
            assert simulator.account.num_cuts == 0


def test_where_no_motion_is_found_the_way_is_straight_and_the_share_is_said():
    rng = np.random.default_rng(0)
    noise = [cv2.GaussianBlur(rng.random((72, 96), np.float32), (0, 0), 1.0) for _ in range(3)]
    with EventSimulator(IDEAL, Stepping(finds_cuts=False)) as simulator:
        for i, light in enumerate(noise):
            simulator.feed(light, i * FRAME_US)
        assert any("no motion was found in" in text for text in simulator.account.sentences(0.2))


def test_tiny_pictures_run_straight():
    shown = [np.full((8, 8), value, np.float32) for value in (0.1, 0.4, 0.2)]
    with EventSimulator(IDEAL) as simulator:
        assert sum(len(simulator.feed(light, i * FRAME_US)) for i, light in enumerate(shown)) > 64


def test_the_flow_leads_from_the_frame_before():
    picture = photo("coffee")
    with EventSimulator(IDEAL) as simulator:
        simulator.feed(picture[100:200, 100:240], 0.0)
        simulator.feed(picture[98:198, 97:237], FRAME_US)
        assert np.median(simulator.flow[0]) == pytest.approx(3, abs=0.1)
        assert np.median(simulator.flow[1]) == pytest.approx(2, abs=0.1)


@pytest.mark.parametrize("wrong", ["stamps ascend", "one size"])
def test_frames_out_of_order_or_of_another_size_are_refused(wrong):
    with EventSimulator(IDEAL) as simulator:
        simulator.feed(np.full((30, 40), 0.5, np.float32), 1_000.0)
        shape, t = ((30, 40), 1_000.0) if wrong == "stamps ascend" else ((30, 41), 2_000.0)
        with pytest.raises(RecordingError, match=wrong):
            simulator.feed(np.full(shape, 0.5, np.float32), t)


def test_a_number_of_steps_out_of_reason_is_refused():
    with pytest.raises(RecordingError, match="takes auto, off, or 1 to 1000"):
        Stepping(0)

"""Laws of whole clips."""

from dataclasses import replace

import cv2
import numpy as np
import pytest

from etnet.simulation.config import SceneConfig, SensorConfig, SequenceConfig
from etnet.simulation.scene import Renderer
from etnet.simulation.sequence import draw_scene, simulate_sequence
from etnet.voxel import voxel_array
from tests.simulation.pictures_made_up import made_up_pool

POOL = made_up_pool()
SMALL = SequenceConfig(size=(64, 72), num_windows=12)
NOISELESS = SensorConfig(
    mismatch=(0.0, 0.0),
    refractory_us=(0.0, 0.0),
    leak_hz=(0.0, 0.0),
    shot_hz=(0.0, 0.0),
    hot_share=(0.0, 0.0),
    low_pass_us=(0.0, 0.0),
    lag_us=(0.0, 0.0),
)


def clip(seed: int, config: SequenceConfig = SMALL):
    return simulate_sequence(POOL, config, np.random.default_rng(seed))


@pytest.mark.parametrize("seed", range(3))
def test_the_same_seed_gives_the_same_clip(seed):
    one, other = clip(seed), clip(seed)
    for name in ("x", "y", "t", "p"):
        assert np.array_equal(getattr(one.events, name), getattr(other.events, name))
    for name in ("voxels", "frames", "first_frame", "flow", "window_edges"):
        assert np.array_equal(getattr(one, name), getattr(other, name))
    assert one.drawn == other.drawn
    assert not np.array_equal(one.frames, clip(seed + 100).frames)


def test_a_clip_has_its_shapes_and_types():
    sequence = clip(1)
    assert sequence.voxels.shape == (12, 5, 64, 72)
    assert sequence.frames.shape == (12, 64, 72)
    assert sequence.flow.shape == (12, 2, 64, 72)
    assert {a.dtype for a in (sequence.voxels, sequence.frames, sequence.flow)} == {np.dtype(np.float32)}
    assert sequence.frames.min() >= 0
    assert sequence.frames.max() <= 1


@pytest.mark.parametrize("seed", range(4))
def test_each_window_holds_its_events_and_their_voxels(seed):
    sequence = clip(seed)
    events, edges, index = sequence.events, sequence.window_edges, sequence.event_index
    assert index[0] == 0
    assert index[-1] == len(events)
    assert (np.diff(events.t) >= 0).all()
    for i in range(12):
        part = events[index[i] : index[i + 1]]
        assert ((part.t >= edges[i]) & (part.t < edges[i + 1])).all()
        assert np.array_equal(sequence.voxels[i], voxel_array(part))


@pytest.mark.parametrize("seed", range(8))
def test_flow_warps_each_frame_to_the_next(seed):
    sequence = clip(seed, replace(SMALL, scene=SceneConfig(black_share=(0.0, 0.0))))
    frames = np.concatenate([sequence.first_frame[None], sequence.frames])
    y, x = np.mgrid[:64, :72].astype(np.float32)
    warped_error = still_error = 0.0
    for i in range(12):
        from_x, from_y = x - sequence.flow[i, 0], y - sequence.flow[i, 1]
        warped = cv2.remap(frames[i], from_x, from_y, cv2.INTER_LINEAR)
        is_inside = (from_x > 1) & (from_x < 70) & (from_y > 1) & (from_y < 62)
        # The median leaves out what was hidden before.
        warped_error += float(np.median(np.abs(warped - frames[i + 1])[is_inside]))
        still_error += float(np.median(np.abs(frames[i] - frames[i + 1])[is_inside]))
    assert warped_error <= 0.25 * still_error + 1e-3


@pytest.mark.parametrize("seed", range(6))
def test_a_pause_freezes_frames_and_flow_and_a_clean_sensor_is_silent(seed):
    config = replace(SMALL, scene=SceneConfig(pause_start=0.5, smooth_share=0.0), sensor=NOISELESS)
    sequence = clip(seed, config)
    frames = np.concatenate([sequence.first_frame[None], sequence.frames])
    assert any(sequence.drawn.is_paused)
    for i, is_paused in enumerate(sequence.drawn.is_paused):
        if is_paused:
            assert np.array_equal(frames[i], frames[i + 1])
            assert np.abs(sequence.flow[i]).max() < 1e-4
            assert sequence.event_index[i] == sequence.event_index[i + 1]


def integrated(sequence, index: np.ndarray) -> np.ndarray:
    """Thresholds summed over the events between two neighbours of `index`, at each pixel."""
    traits, total = sequence.drawn.traits, np.zeros((len(index) - 1, *sequence.first_frame.shape))
    for i in range(len(total)):
        part = sequence.events[index[i] : index[i + 1]]
        step = np.where(part.p > 0, traits.threshold_on, -traits.threshold_off)
        np.add.at(total[i], (part.y.astype(int), part.x.astype(int)), step)
    return total


def light(sequence) -> np.ndarray:
    """What the sensor saw at each edge, where the camera's frames are not clipped (NaN there)."""
    frames = np.concatenate([sequence.first_frame[None], sequence.frames])
    return np.where((frames > 0) & (frames < 1), frames + sequence.drawn.black, np.nan)


def test_lag_delays_the_events_and_leaves_the_frames_where_they_are():
    scene = SceneConfig(pause_start=0.0, density=0.6, density_sigma=0.0, smooth_share=0.0)
    prompt_sensor = replace(NOISELESS, threshold_core=(0.2, 0.2))
    config = replace(SMALL, scene=scene, sensor=prompt_sensor, clip_jitter=(1.0, 1.0), jittered_share=0.0)
    for seed in range(3):
        prompt, late = clip(seed, config), clip(seed, replace(config, sensor=replace(prompt_sensor, lag_us=(8e3, 8e3))))
        assert np.array_equal(prompt.frames, late.frames)
        change = np.diff(np.log(light(prompt) + prompt.drawn.traits.dark), axis=0)[1:-1]

        def misfit(sequence, shift: int, change=change) -> float:
            index = np.searchsorted(sequence.events.t, sequence.window_edges[1:-1] + shift)
            return float(np.nanmean((integrated(sequence, index) - change) ** 2))

        for shift in (-8_000, 0, 8_000):
            assert misfit(late, shift + 8_000) == pytest.approx(misfit(prompt, shift), rel=0.1)
        assert misfit(late, 0) > 1.1 * misfit(late, 8_000)


@pytest.mark.parametrize("seed", range(4))
def test_integrated_events_follow_the_log_of_the_light_within_a_threshold_each_way(seed):
    sequence = clip(seed, replace(SMALL, sensor=NOISELESS))
    traits = sequence.drawn.traits
    log = np.log(light(sequence) + traits.dark)
    left = np.abs(log[1:] - log[0] - np.cumsum(integrated(sequence, sequence.event_index), 0))
    # An event in the very microsecond of an edge may fall to either side of it.
    assert np.nanquantile(left, 0.9995) <= traits.threshold_on + traits.threshold_off + 1e-3


def test_nothing_moves_more_than_a_pixel_between_renderings():
    rng = np.random.default_rng(2)
    scene = draw_scene(POOL, SMALL, is_smooth=False, is_static=False, rng=rng)
    s = np.linspace(0, 20, 400)
    steps = scene.largest_steps(s)
    renderer = Renderer(scene, s)
    for i in range(0, 399, 57):
        flow = renderer.flow(i, i + 1)
        assert np.hypot(*flow).max() <= steps[i] * 1.05 + 1e-3


def test_the_tone_of_the_frames_does_not_change_the_events():
    linear, srgb = clip(4), clip(4, replace(SMALL, target_tone="srgb"))
    assert np.array_equal(linear.events.t, srgb.events.t)
    assert srgb.frames.mean() > linear.frames.mean()


def test_scenes_without_objects_and_with_many_are_possible():
    empty = clip(0, replace(SMALL, scene=SceneConfig(num_objects=(0, 0))))
    crowded = clip(0, replace(SMALL, scene=SceneConfig(num_objects=(30, 30))))
    assert empty.drawn.num_objects == 0
    assert crowded.drawn.num_objects == 30


def test_forty_clips_look_like_recordings_to_their_statistics():
    """Bands around the real slider_depth: .30 events per pixel and window, 21 % active pixels, ON share .415."""
    clips = [clip(seed, SequenceConfig(num_windows=10)) for seed in range(40)]
    density = np.array([np.diff(c.event_index).mean() / 112**2 for c in clips])
    assert 0.15 <= np.median(density) <= 0.5
    assert ((density > 0.1) & (density < 1.0)).mean() >= 0.55
    active = np.mean([(np.abs(c.voxels).sum(1) > 0).mean() for c in clips])
    assert 0.1 <= active <= 0.35
    share_on = [(c.events.p > 0).mean() for c in clips if len(c.events) > 1_000]
    assert 0.4 <= np.mean(share_on) <= 0.6
    assert np.std(share_on) > 0.02

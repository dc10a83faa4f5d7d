"""Where a pixel comes from, and how sure it is: every number is a run of the network that a test repeats."""

import numpy as np
import pytest
import torch

from etnet.errors import Cancelled
from etnet.events.edit import EventEdit
from etnet.events.events import Events
from etnet.events.recording import GroundTruth, recording_of_events
from etnet.inspection.importance import effects
from etnet.inspection.sources import STAGES, pixel_sources
from etnet.inspection.uncertainty import camera_error, correlation, dropout_spread
from etnet.nets.adapter import Adapter
from etnet.nets.intervention import Intervention
from etnet.playback.playback import Playback
from etnet.reconstruction import window_events
from etnet.voxel import normalise_nonzero, voxel_grid
from tests.inspection.small import SENSOR, small_playback
from tests.inspection.test_anatomy import _integrate

INDEX, PIXEL = 5, (20, 9)


@pytest.mark.parametrize("preset", ["tiny", "e2vid"])
def test_every_width_is_a_step_without_that_part(preset: str):
    playback = small_playback(preset)
    *_, found = pixel_sources(playback, INDEX, PIXEL)
    assert found.is_whole
    original = playback.at(INDEX).frame[0, 0]
    assert found.value == float(original[PIXEL[1], PIXEL[0]])

    def check(stage: str, name: str, frame: torch.Tensor) -> None:
        (part,) = [part for part in found.parts if (part.stage, part.name) == (stage, name)]
        assert part.at_pixel == float((frame - original)[PIXEL[1], PIXEL[0]])
        assert part.mean_absolute == float((frame - original).abs().mean())

    events = window_events(playback.recording, playback.windows[INDEX])
    votes = voxel_grid(events, 5).clone()
    votes[2] = 0
    check("bins", "bin 2", _step(playback, votes))
    check("events", "all events", _step(playback, torch.zeros_like(votes)))
    on = voxel_grid(Events(events.x, events.y, events.t, np.maximum(events.p, 0).astype(np.int8), SENSOR), 5)
    check("events", "OFF events", _step(playback, on))
    zeroed = playback.branch(INDEX, Intervention(zeroed_levels=frozenset({2}))).at(INDEX).frame[0, 0]
    check("memory", "level 2", zeroed)
    for effect in effects(playback, INDEX):
        if effect.ablation.name.startswith(("scale", "skip", "TPA")):
            check("skips" if "skip" in effect.ablation.name else "scales", effect.ablation.name, effect.frame)


def _step(playback: Playback, votes: torch.Tensor) -> torch.Tensor:
    ready = normalise_nonzero(votes) if playback.model.normalise_voxels else votes
    with torch.inference_mode():
        return playback.model(ready[None], playback.state(INDEX - 1)).frame[0, 0]


def test_the_figure_grows_part_by_part_and_has_the_stages_that_a_network_has():
    for preset, stages in (("tiny", STAGES), ("firenet", STAGES[:3])):
        figures = list(pixel_sources(small_playback(preset), 0, PIXEL))
        assert [len(figure.parts) for figure in figures] == list(range(1, figures[-1].num_parts + 1))
        assert tuple(stage for stage in STAGES if figures[-1].of(stage)) == stages
        # At the first window there is no memory to lose.
        assert all(part.at_pixel == 0 for part in figures[-1].of("memory"))
    small = small_playback()
    own = Playback(Adapter(_integrate, name="mine"), small.recording, small.windows)
    *_, found = pixel_sources(own, INDEX, PIXEL)
    assert tuple(stage for stage in STAGES if found.of(stage)) == ("events", "bins")
    with pytest.raises(Cancelled, match="this figure"):
        next(pixel_sources(small, INDEX, PIXEL, cancelled=lambda: True))


def test_the_spread_is_that_of_branches_with_events_left_out():
    playback = small_playback()
    spreads = list(dropout_spread(playback, INDEX, drop=0.3, num_seeds=4, num_back=2, first_seed=10))
    assert [len(spread.frames) for spread in spreads] == [1, 2, 3, 4]
    assert not spreads[0].deviation.any()
    whole = spreads[-1]
    assert whole.is_whole
    for seed, frame in enumerate(whole.frames, start=10):
        assert torch.equal(frame, playback.branch(3, edit=EventEdit(drop=0.3, seed=seed)).at(INDEX).frame[0, 0])
    np.testing.assert_allclose(whole.deviation, np.std(whole.frames.numpy(), axis=0, ddof=1), atol=1e-7)
    np.testing.assert_allclose(whole.mean, np.mean(whole.frames.numpy(), axis=0), atol=1e-6)
    assert torch.equal(whole.exact, playback.at(INDEX).frame[0, 0])
    assert whole.deviation.any()
    with pytest.raises(Cancelled):
        list(dropout_spread(playback, INDEX, cancelled=iter([False] * 3 + [True] * 99).__next__))
    branch = playback.branch(4, Intervention(removed_skips=frozenset({1})))
    (spread,) = dropout_spread(branch, INDEX, drop=0.3, num_seeds=1)
    both = playback.branch(4, Intervention(removed_skips=frozenset({1})), EventEdit(drop=0.3))
    assert spread.since == 4
    assert torch.equal(spread.frames[0], both.at(INDEX).frame[0, 0])
    for wrong in ({"drop": 0.0}, {"num_seeds": 0}, {"num_back": -1}):
        with pytest.raises(ValueError):
            next(dropout_spread(playback, INDEX, **wrong))


def test_correlations_are_numpys_and_of_ranks():
    rng = np.random.default_rng(0)
    a, b = (torch.from_numpy(rng.normal(size=(6, 7)).astype(np.float32)) for _ in range(2))
    assert correlation(a, b).pearson == pytest.approx(np.corrcoef(a.flatten(), b.flatten())[0, 1])
    ranks = [np.argsort(np.argsort(map_.flatten().numpy())) for map_ in (a, b)]
    assert correlation(a, b).spearman == pytest.approx(np.corrcoef(*ranks)[0, 1])
    assert correlation(a, a.exp()).spearman == pytest.approx(1)
    assert correlation(torch.tensor([[0.0, 0.0, 1.0]]), torch.tensor([[2.0, 2.0, 5.0]])).spearman == pytest.approx(1)
    flat = correlation(a, torch.zeros_like(a))
    assert (flat.pearson, flat.spearman) == (0.0, 0.0)


def test_the_error_is_against_the_cameras_frame_at_that_moment_or_there_is_none():
    small = small_playback()
    stamp = small.windows[INDEX].t_stop
    seen = np.linspace(0, 1, SENSOR.num_pixels, dtype=np.float32).reshape(SENSOR.height, SENSOR.width)
    truth = GroundTruth(np.array([0, stamp + 3], np.int64), lambda i: seen if i else 0 * seen)
    events = small.recording.read(0, small.recording.num_events)
    playback = Playback(small.model, recording_of_events(events, ground_truth=truth), small.windows)
    frame = 3 * playback.at(INDEX).frame[0, 0] - 1
    error = camera_error(playback, INDEX, frame)
    assert error is not None
    torch.testing.assert_close(error, (frame.clamp(0, 1) - torch.from_numpy(seen)).abs())
    assert camera_error(small, INDEX, frame) is None
    assert camera_error(playback, INDEX, frame, nearest=2) is None
    assert camera_error(playback, INDEX, frame[1:]) is None

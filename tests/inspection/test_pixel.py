"""What a pixel depends on: parts of the network, events, and the exact input."""

import numpy as np
import pytest
import torch

from etnet.errors import Cancelled
from etnet.events.edit import EventEdit
from etnet.inspection.attribution import attribute, occlude
from etnet.inspection.importance import ablations, effects
from etnet.inspection.input import network_input, pixel_events, token_map
from etnet.nets.etnet import ETNetConfig
from etnet.nets.intervention import Intervention
from etnet.nets.presets import build_model
from etnet.playback.playback import Playback
from etnet.reconstruction import window_events
from etnet.voxel import voxel_grid
from tests.inspection.small import SENSOR, small_playback

PIXEL = (20, 9)


def test_every_part_of_a_network_can_be_taken_away():
    names = [part.name for part in ablations(build_model("tiny"))]
    assert names == [
        "TPA", "attention made uniform", "decoders",
        "scale 3", "scale 2", "scale 1", "skip 3", "skip 2", "skip 1", "skip 0",
    ]  # fmt: skip
    assert [part.name for part in ablations(build_model("e2vid"))] == ["skip 3", "skip 2", "skip 1", "skip 0"]
    assert ablations(build_model("firenet")) == ()
    bare = ablations(build_model(ETNetConfig(scales=1, decoder_depth=0, skips=False, base_channels=4, dim=32, heads=4)))
    assert [part.name for part in bare] == ["TPA", "attention made uniform"]


def test_an_effect_is_the_frame_without_less_the_frame_with():
    playback = small_playback()
    original = playback.at(4).frame
    for effect in effects(playback, 4):
        without = playback.at(4, intervention=effect.ablation.intervention).frame
        assert torch.equal(effect.difference, (without - original)[0, 0])
        assert effect.mse > 0, effect.ablation
        assert effect.mean_absolute <= effect.mse**0.5 + 1e-7
        assert effect.at(*PIXEL) == pytest.approx(float((without - original)[0, 0, PIXEL[1], PIXEL[0]]))
    assert torch.equal(playback.at(4).frame, original)
    with pytest.raises(Cancelled):
        next(effects(small_playback(), 4, cancelled=lambda: True))


@pytest.mark.parametrize("preset", ["tiny", "e2vid", "firenet"])
def test_weights_of_events_add_up_to_gradient_times_voxel(preset: str):
    playback = small_playback(preset)
    found = attribute(playback, 5, PIXEL, num_back=2)
    assert found.value == pytest.approx(float(playback.at(5).frame[0, 0, PIXEL[1], PIXEL[0]]), abs=1e-6)
    assert [window.index for window in found.windows] == [3, 4, 5]
    for window in found.windows:
        voxel = _raw_voxel(playback, window.index)
        assert len(window.weights) == len(window.events)
        total = float((window.gradient.double() * voxel.double()).sum())
        assert float(window.weights.sum(dtype=float)) == pytest.approx(total, rel=1e-4, abs=1e-6)
    assert (found.by_window > 0).all()


def _raw_voxel(playback: Playback, index: int) -> torch.Tensor:
    return voxel_grid(window_events(playback.recording, playback.windows[index]), playback.model.bins)


def test_gradients_are_finite_differences():
    playback = small_playback()
    gradient = attribute(playback, 5, PIXEL, num_back=1).windows[0].gradient
    direction = gradient / gradient.norm()
    step, values = 0.05, []
    with torch.inference_mode():
        for sign in (1, -1):
            moved = playback.voxel(4) + sign * step * direction
            _, state = playback.model.encode(moved[None], playback.state(3))
            pyramid, _ = playback.model.encode(playback.voxel(5)[None], state)
            values.append(float(playback.model.decode(pyramid)[0][0, 0, PIXEL[1], PIXEL[0]]))
    assert (values[0] - values[1]) / (2 * step) == pytest.approx(float(gradient.norm()), rel=0.05, abs=2e-6)


def test_a_frozen_state_owes_its_windows_nothing():
    playback = small_playback().branch(4, Intervention(frozen_levels=frozenset({1, 2, 3})))
    found = attribute(playback, 5, PIXEL, num_back=1)
    assert not found.windows[0].weights.any()
    assert found.windows[1].weights.any()


def test_occlusion_is_the_frame_without_the_votes_and_agrees_with_the_gradient():
    playback = small_playback()
    hidden = occlude(playback, 5, PIXEL, num_back=1, patch=8)
    assert hidden.change.shape == (2, 3, 5)
    with torch.inference_mode():
        voxel = playback.voxel(5).clone()
        voxel[:, 8:16, 16:24] = 0
        frame = playback.model(voxel[None], playback.state(4)).frame
    expected = hidden.value - float(frame[0, 0, PIXEL[1], PIXEL[0]])
    assert float(hidden.change[1, 1, 2]) == pytest.approx(expected, abs=1e-7)

    owed = torch.zeros_like(hidden.change)
    for place, window in enumerate(attribute(playback, 5, PIXEL, num_back=1).windows):
        patches = (place, torch.from_numpy(window.events.y // 8).long(), torch.from_numpy(window.events.x // 8).long())
        owed[place].index_put_(patches[1:], torch.from_numpy(window.weights), accumulate=True)
    together = torch.corrcoef(torch.stack((owed.flatten(), hidden.change.flatten())))[0, 1]
    assert together > 0.8


def test_pixels_outside_and_windows_ahead_are_refused():
    with pytest.raises(ValueError, match=r"pixel \(38, 0\)"):
        attribute(small_playback(), 1, (38, 0))
    with pytest.raises(ValueError, match="num_back"):
        occlude(small_playback(), 1, PIXEL, num_back=-1)
    with pytest.raises(Cancelled):
        attribute(small_playback(), 1, PIXEL, cancelled=lambda: True)


def test_the_input_is_the_tensor_that_the_network_gets():
    playback = small_playback()
    seen = network_input(playback, 3)
    assert torch.equal(seen.voxel, playback.voxel(3))
    grid = seen.grid
    assert torch.equal(seen.padded[:, grid.top : grid.top + 21, grid.left : grid.left + 38], seen.voxel)
    assert float(seen.padded.abs().sum()) == pytest.approx(float(seen.voxel.abs().sum()), rel=1e-5)
    assert 0 < seen.limit <= float(seen.voxel.abs().max())
    assert torch.equal(seen.profile(*PIXEL), seen.voxel[:, PIXEL[1], PIXEL[0]])


def test_the_events_of_a_pixel_vote_for_its_profile():
    edited = small_playback().branch(0, edit=EventEdit(drop=0.2, invert=0.3, seed=2))
    x, y = next((x, y) for y in range(21) for x in range(38) if len(pixel_events(edited, 3, x, y).t) > 1)
    raster = pixel_events(edited, 3, x, y)
    bins = np.arange(5)[:, None]
    profile = (np.clip(1 - np.abs(bins - raster.place), 0, None) * raster.p).sum(1)
    np.testing.assert_allclose(profile, network_input(edited, 3).profile(x, y), atol=1e-5)
    assert raster.counts


def test_tokens_know_their_padding_and_whether_training_met_them():
    model = build_model("tiny")
    tokens = token_map(model, 180, 240)
    assert tokens.index.shape == (23, 30)
    assert tokens.seen is not None
    assert int(tokens.seen.sum()) == 196
    assert tokens.seen_source.startswith("assumed")
    assert float(tokens.padding.sum()) == pytest.approx(4 * 240 / 64)
    model.card = {"recipe": {"context": {"sensor_rows": [14, 90], "sensor_columns": [14, 160]}}}
    tokens = token_map(model, SENSOR.height, SENSOR.width)
    assert tokens.seen is not None
    assert tokens.seen.all()
    assert "160 × 90 tokens" in tokens.seen_source
    assert token_map(build_model("firenet"), 21, 38).seen is None

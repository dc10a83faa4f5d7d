"""The laws on a real recording with the default weights, where numbers are not as tame as in a fresh network."""

import numpy as np
import pytest
import torch

from etnet.events.open import open_recording
from etnet.inspection.atlas import head_atlas
from etnet.inspection.attribution import attribute
from etnet.inspection.follow import follow
from etnet.inspection.gates import gates_at
from etnet.inspection.mass import mass_on, padding_shares
from etnet.inspection.rollout import rollout
from etnet.nets.attention import AttentionProbe
from etnet.nets.intervention import Intervention
from etnet.nets.weights import load_model
from etnet.playback.playback import Playback
from etnet.voxel import voxel_grid
from etnet.windows import BetweenFrames, plan_windows
from tests.real_data import real_file

INDEX, PIXEL = 6, (120, 90)


@pytest.fixture(scope="module")
def playback() -> Playback:
    recording = open_recording(real_file("ecd_slider_depth/slider_depth.zip"))
    return Playback(load_model("etnet-half"), recording, plan_windows(recording, BetweenFrames()))


@pytest.mark.real
def test_gates_recombine_on_a_real_recording(playback: Playback):
    for level in (1, 2, 3):
        gates = gates_at(playback, INDEX, level)
        torch.testing.assert_close(gates.kept + gates.entered, gates.cell, atol=1e-5, rtol=1e-5)
        torch.testing.assert_close(gates.out * gates.cell.tanh(), gates.hidden, atol=1e-5, rtol=1e-5)


@pytest.mark.real
def test_the_events_near_a_pixel_make_it_and_their_weights_add_up(playback: Playback):
    found = attribute(playback, INDEX, PIXEL, num_back=1)
    for window in found.windows:
        total = float((window.gradient.double() * voxel_grid(window.events).double()).sum())
        assert float(window.weights.sum(dtype=float)) == pytest.approx(total, rel=1e-3, abs=1e-6)
    last = found.windows[-1]
    distance = np.hypot(last.events.x - float(PIXEL[0]), last.events.y - float(PIXEL[1]))
    weight, is_near = np.abs(last.weights), distance < 16
    # A network that looks far owes something to far events, too: what counts is that near ones weigh many times more.
    assert weight[is_near].sum() / weight.sum() > 5 * is_near.mean()


@pytest.mark.real
def test_rollout_of_a_real_frame_is_a_distribution_and_its_rows_are_too(playback: Playback):
    attention = playback.at(INDEX, AttentionProbe()).attention
    assert attention is not None
    assert len(attention.sites) == 21
    token = attention.grid.token_at(*PIXEL)
    rolled = rollout(attention, token)
    assert float(rolled.weights.sum()) == pytest.approx(1, abs=1e-5)
    assert float(rolled.weights.min()) >= 0
    padding = mass_on(attention.rows("scale1.encoder.2.self", [token]), padding_shares(attention.grid))
    assert ((padding >= 0) & (padding <= 1)).all()


@pytest.mark.real
def test_the_atlas_of_a_real_frame_is_the_decode_under_each_mask(playback: Playback):
    atlases = head_atlas(playback, INDEX)
    atlas = [next(atlases) for _ in range(3)][-1]
    assert atlas.progress == (2, 84)
    original = playback.at(INDEX).frame[0, 0]
    for (site, head), difference in zip(atlas.heads, atlas.differences, strict=False):
        masked = playback.at(INDEX, intervention=Intervention(masked_heads=frozenset({(site, head)}))).frame[0, 0]
        assert torch.equal(difference, masked - original)
    assert float(atlas.uniform.abs().mean()) > float(atlas.on_image.nan_to_num().max())


@pytest.mark.real
def test_a_real_patch_goes_where_the_camera_sees_it_go(playback: Playback):
    """The slider moves to the right: at (120, 90) the scene goes 32 pixels to the left in 8 windows."""
    *_, there = follow(playback.recording, playback.windows, INDEX, PIXEL, INDEX + 8)
    assert there.x - PIXEL[0] == pytest.approx(-32, abs=8)
    assert abs(there.y - PIXEL[1]) < 6

"""The untrained baseline does what its two numbers say and can be loaded, saved and played like any network."""

import pytest
import torch

from etnet.errors import ModelError
from etnet.nets.integrator import IntegratorConfig, LeakyIntegrator
from etnet.nets.intervention import Intervention
from etnet.nets.weights import load_model, load_weights, save_weights
from etnet.playback.playback import Playback
from etnet.windows import ByCount, plan_windows
from tests.app.fakes import recording_of


def test_it_forgets_a_share_and_adds_each_event():
    model = LeakyIntegrator(IntegratorConfig(keep=0.5, gain=0.2))
    voxel = torch.zeros(1, 5, 4, 6)
    voxel[0, 2, 1, 3] = 2.0
    step = model(voxel)
    assert step.state.tensors[0][0, 0, 1, 3] == pytest.approx(0.4)
    assert step.frame[0, 0, 1, 3] == pytest.approx(torch.sigmoid(torch.tensor(0.4)).item())
    assert step.frame[0, 0, 0, 0] == 0.5
    assert model(torch.zeros_like(voxel), step.state).state.tensors[0][0, 0, 1, 3] == pytest.approx(0.2)


def test_its_frames_are_found_in_any_order():
    recording = recording_of(12)
    windows = plan_windows(recording, ByCount(50))
    model = load_model("leaky-integrator")
    straight = Playback(model, recording, windows)
    frames = [straight.at(index).frame for index in range(12)]
    jumping = Playback(model, recording, windows, budget_bytes=8192)
    for index in (11, 3, 7, 0, 10):
        assert torch.equal(jumping.at(index).frame, frames[index])


def test_it_is_saved_and_loaded_like_a_network_and_refuses_interventions(tmp_path):
    save_weights(LeakyIntegrator(IntegratorConfig(keep=0.8)), tmp_path / "mine.safetensors", dtype=None)
    assert load_weights(tmp_path / "mine.safetensors").keep.item() == pytest.approx(0.8)
    with pytest.raises(ModelError, match="nothing inside it"):
        load_model("leaky-integrator")(torch.zeros(1, 5, 4, 6), intervention=Intervention(without_context=True))

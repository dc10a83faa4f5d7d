"""On a GPU: exact among itself, and no state ever leaves the device. Left out where there is none."""

import pytest
import torch

from etnet.events.recording import recording_of_events
from etnet.nets.attention import AttentionProbe
from etnet.nets.presets import build_model
from etnet.nets.runtime import apply_runtime, contract_of, default_runtime
from etnet.playback.playback import Playback
from etnet.windows import ByCount, plan_windows
from tests.strategies import make_events

pytestmark = pytest.mark.skipif(not torch.cuda.is_available(), reason="no CUDA device")


@pytest.mark.parametrize("precision", ["fp32", "bf16"])
def test_any_order_equals_the_sequential_run_and_states_stay_on_the_device(precision):
    recording = recording_of_events(make_events(1000))
    windows = plan_windows(recording, ByCount(100))
    model = build_model("tiny").to("cuda")
    apply_runtime(model, default_runtime(precision, "cuda"))
    truth = [step.frame for step in map(Playback(model, recording, windows).at, range(len(windows)))]
    playback = Playback(model, recording, windows)
    for index in (7, 2, 9, 2, 5):
        step = playback.at(index, AttentionProbe())
        assert torch.equal(step.frame, truth[index])
        assert all(tensor.device.type == "cuda" for tensor in (*step.state, step.frame))
    assert contract_of(model).device == "cuda:0"
    assert not default_runtime(precision, "cuda").packed

"""The viewer's engine on a GPU: the sequential run's frames, and clocks that tell the truth. Left out without one."""

from dataclasses import replace

import pytest
import torch

from etnet.nets.presets import build_model
from etnet.nets.runtime import apply_runtime, default_runtime
from etnet.playback.playback import Playback
from etnet.windows import plan_windows
from tests.app.fakes import POLICY, Inbox, request

pytestmark = pytest.mark.skipif(not torch.cuda.is_available(), reason="no CUDA device")


@pytest.mark.parametrize("precision", ["fp32", "bf16"])
def test_any_order_shows_the_sequential_runs_frames(shelf, make_engine, precision):
    def load(_entry, precision, device):
        model = build_model("tiny", torch.Generator().manual_seed(0)).to(device)
        apply_runtime(model, default_runtime(precision, device))
        return model

    shelf.load = load
    recording = shelf.open("r")
    sequential = Playback(load(None, precision, "cuda"), recording, plan_windows(recording, POLICY))
    truth = [sequential.at(index).frame.float().cpu() for index in range(10)]
    engine, inbox = make_engine(device="cuda"), Inbox()
    for index in (6, 2, 8, 2):
        engine.request("ada", replace(request(index), precision=precision), inbox)
        ready = inbox.ready(index, timeout=60)
        assert ready.is_exact
        assert torch.equal(torch.as_tensor(ready.frame).reshape(-1), truth[index].reshape(-1))

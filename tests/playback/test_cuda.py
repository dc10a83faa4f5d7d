"""On a GPU: exact among itself, and no state ever leaves the device. Left out where there is none."""

import pytest
import torch

from etnet.events.recording import recording_of_events
from etnet.inspection.pins import pin
from etnet.nets.attention import AttentionProbe
from etnet.nets.presets import build_model
from etnet.nets.runtime import apply_runtime, contract_of, default_runtime
from etnet.playback.disk_cache import DiskCache
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
    assert torch.cuda.get_device_name(0) in contract_of(model).isa
    assert not default_runtime(precision, "cuda").packed


def test_no_state_is_copied_to_the_disk_cache_and_frames_come_back_onto_the_device(tmp_path):
    recording = recording_of_events(make_events(4000))
    windows = plan_windows(recording, ByCount(100))
    model = build_model("tiny").to("cuda")
    cache = DiskCache(tmp_path)
    first = Playback(model, recording, windows, disk=cache)
    truth = [first.at(index).frame for index in range(len(windows))]
    cache.flush()
    (kept,) = cache.runs()
    assert kept.num_frames == len(windows)
    assert kept.num_states == 0
    again = Playback(model, recording, windows, disk=cache)
    frame = again.frame(7)
    assert frame is not None
    assert frame.device.type == "cuda"
    assert torch.equal(frame, truth[7])


def test_a_pin_of_a_network_on_a_gpu_is_held_against_a_map_on_the_cpu():
    recording = recording_of_events(make_events(1000))
    windows = plan_windows(recording, ByCount(100))
    on_gpu, on_cpu = build_model("tiny").to("cuda"), build_model("tiny")
    on_cpu.load_state_dict(on_gpu.state_dict())
    site = "scale1.encoder.0.self"
    pins = [pin(Playback(model, recording, windows), 5, (3, 3), site) for model in (on_gpu, on_cpu)]
    assert {held.map.device.type for held in pins} == {held.frame.device.type for held in pins} == {"cpu"}
    torch.testing.assert_close(pins[0].map, pins[1].map, rtol=1e-2, atol=1e-4)

"""Precision and kernels: decided once for a machine, by speed and by the frame, and kept."""

import json
import logging

import pytest
import torch

from etnet.nets import precision, tuning
from etnet.nets.etnet import ETNet
from etnet.nets.kept_choices import MAX_CHOICES, choices_file, keep_choice, kept_choice
from etnet.nets.precision import PrecisionDecision, choose_runtime, decide
from etnet.nets.presets import PRESETS, build_model
from etnet.nets.runtime import Runtime, apply_runtime, default_runtime
from etnet.nets.weights import load_model


@pytest.fixture(autouse=True)
def own_cache(tmp_path, monkeypatch):
    monkeypatch.setenv("ETNET_CACHE", str(tmp_path / "cache"))
    monkeypatch.setattr(precision, "_PROBE_SIZE", (16, 24))
    monkeypatch.setattr(precision, "bf16_is_worth_trying", lambda device="cpu": True)


def test_fp32_is_what_a_network_runs_in_unless_it_is_asked_otherwise():
    assert load_model("etnet-half").runtime == default_runtime("fp32")
    assert default_runtime().precision == "fp32"


def test_auto_is_measured_once_and_then_fixed_for_the_machine(monkeypatch, caplog):
    model = build_model("tiny")
    first = decide(model)
    monkeypatch.setattr(precision, "_measured", lambda *_: pytest.fail("it was measured again"))
    assert decide(model) == first
    assert decide(build_model("tiny")) == first
    with caplog.at_level(logging.INFO):
        assert choose_runtime(model, "auto").precision == first.precision
    assert first.sentence in caplog.text
    assert model.runtime == Runtime()


def test_auto_refuses_a_bf16_whose_frame_is_wrong(monkeypatch):
    def step(model, runtime, device):
        is_fast = runtime.precision == "bf16"
        return (0.1 if is_fast else 0.5), torch.full((1, 1, 4, 4), 0.2 if is_fast else 0.8)

    monkeypatch.setattr(precision, "_step", step)
    decision = decide(build_model("tiny"))
    assert decision.precision == "fp32"
    assert decision.difference == pytest.approx(0.6)
    assert "differ by 0.6" in decision.sentence


@pytest.mark.parametrize(("seconds", "wanted"), [((0.5, 0.1), "bf16"), ((0.1, 0.5), "fp32")])
def test_auto_takes_the_faster_of_two_equal_frames(monkeypatch, seconds, wanted):
    def step(model, runtime, device):
        return seconds[runtime.precision == "bf16"], torch.zeros(1, 1, 4, 4)

    monkeypatch.setattr(precision, "_step", step)
    assert decide(build_model("tiny")).precision == wanted


def test_a_frame_of_nans_is_refused(monkeypatch):
    frame = {"fp32": 0.5, "bf16": float("nan")}
    monkeypatch.setattr(precision, "_step", lambda m, r, d: (1.0, torch.full((1, 1, 2, 2), frame[r.precision])))
    assert decide(build_model("tiny")).precision == "fp32"


def test_choices_survive_nonsense_in_their_file_and_stay_few(tmp_path):
    choices_file().parent.mkdir(parents=True)
    choices_file().write_text("[1, 2")
    assert kept_choice("a") is None
    for number in range(MAX_CHOICES + 3):
        keep_choice(f"{number}", {"value": number})
    assert kept_choice("0") is None
    assert kept_choice(f"{MAX_CHOICES}") == {"value": MAX_CHOICES}
    assert len(json.loads(choices_file().read_text())) == MAX_CHOICES
    keep_choice(f"precision cpu {precision.weights_sha256(build_model('tiny'))}", {"other": 1})
    assert isinstance(decide(build_model("tiny")), PrecisionDecision)


def test_a_kernel_trial_runs_in_the_background_and_is_used_the_next_time(monkeypatch):
    monkeypatch.setattr(tuning, "PATIENCE", 0.2)
    model = build_model("tiny")
    apply_runtime(model, default_runtime())
    before = model.runtime
    trial = tuning.tune(model, 48, 64)
    if trial is None:
        pytest.skip("no oneDNN here: there is nothing to try")
    assert model.runtime == before
    trial.join(20)
    assert tuning.tune(model, 48, 64) is None
    assert model.runtime.precision == "fp32"
    keep_choice(tuning._name(model, 48, 64), {"precision": "fp32", "attention": "fused", "channels_last": False})
    tuning.tune(model, 48, 64)
    assert model.runtime == Runtime("fp32", "fused")


def test_a_network_that_is_made_in_another_way_than_ours_is_not_tried_and_ends_nothing(monkeypatch):
    class Own(ETNet):
        def __init__(self):
            super().__init__(PRESETS["tiny"])

    model = Own()
    apply_runtime(model, default_runtime())
    trial = tuning.tune(model, 48, 64)
    if trial is None:
        pytest.skip("no oneDNN here: there is nothing to try")
    trial.join(20)
    assert kept_choice(tuning._name(model, 48, 64)) is None


def test_a_trial_changes_no_network_that_runs_though_its_outcome_was_kept_meanwhile():
    model = build_model("tiny")
    apply_runtime(model, default_runtime())
    before = model.runtime
    keep_choice(tuning._name(model, 48, 64), {"precision": "fp32", "attention": "fused", "channels_last": False})
    assert tuning.begin_trial(model, 48, 64) is None
    assert model.runtime == before


def test_a_trial_with_no_time_left_chooses_the_usual_kernels():
    runtime = tuning.fastest_runtime(build_model("tiny"), (4, 32), "fp32", 720, 1280, patience=0.0)
    assert runtime == default_runtime("fp32")

"""Evaluating is replaying from a cold start; its numbers are those of the measures, row by row."""

from dataclasses import replace

import numpy as np
import pytest
import torch
from skimage.metrics import structural_similarity as skimage_ssim
from torch import Tensor

from etnet.errors import ModelError, RecordingError
from etnet.evaluation.evaluate import Judges, evaluate
from etnet.evaluation.lpips import load_lpips
from etnet.evaluation.metrics import robust_range
from etnet.evaluation.protocol import EVREAL, PAPER, plan_protocol
from etnet.evaluation.scores import ROWS, Scores, read_scores, write_scores
from etnet.nets.adapter import Adapter
from etnet.nets.presets import build_model
from etnet.reconstruction import window_voxel
from tests.evaluation.recordings import made_up, slider_depth


@pytest.fixture(scope="module")
def judges() -> Judges:
    return Judges(load_lpips())


def replays(frames: list[Tensor], **fields) -> Adapter:
    """A network of one's own that shows the n-th of given frames at its n-th step."""

    def step(voxel: Tensor, memory: tuple[Tensor, ...] | None) -> tuple[Tensor, tuple[Tensor, ...]]:
        count = 0 if memory is None else int(memory[0])
        return frames[count], (torch.tensor(count + 1),)

    return Adapter(step, "replays", **fields)


def truth_frames(recording, gain: float = 1.0, shift: float = 0.0) -> list[Tensor]:
    truth = recording.ground_truth
    return [gain * torch.from_numpy(truth.read_frame(i))[None, None] + shift for i in range(len(truth))]


def test_a_model_that_shows_the_truth_is_perfect(judges: Judges) -> None:
    recording = made_up(has_flow=True)
    scores = evaluate(replays(truth_frames(recording)), recording, PAPER, judges)
    assert scores.num_frames == 7
    assert scores.mean("mse") == 0
    assert scores.mean("ssim") == pytest.approx(1)
    assert scores.mean("lpips") == 0
    assert np.isnan(scores.rows["as it is"]["temporal"][0])
    # The pattern moves right by a pixel a frame: only the column that enters at the left edge cannot be foreseen.
    assert scores.mean("temporal") < 0.03
    assert "TC: with the file's own flow" in scores.remarks


@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_a_frame_that_is_not_finite_is_an_error_that_names_it_and_no_frame_left_out(judges: Judges, value) -> None:
    recording = made_up()
    frames = truth_frames(recording)
    frames[3] = frames[3].clone()
    frames[3][0, 0, 5, 5] = value
    with pytest.raises(ModelError, match=r"replays: its frame for camera frame [34] is not finite"):
        evaluate(replays(frames), recording, PAPER, judges)


def test_a_wrong_brightness_vanishes_in_the_affine_row_and_only_there(judges: Judges) -> None:
    recording = made_up()
    model = replays(truth_frames(recording, 0.5, 0.1))
    scores = evaluate(model, recording, PAPER, judges)
    assert scores.mean("mse") > 0.01
    assert scores.mean("mse", "best affine per frame") == pytest.approx(0, abs=1e-12)
    assert scores.mean("lpips", "best affine per frame") == pytest.approx(0, abs=1e-5)


def test_the_constant_grey_is_the_mean_of_the_scored_truth(judges: Judges) -> None:
    recording = made_up()
    scores = evaluate(build_model("tiny"), recording, PAPER, judges)
    truth = np.stack([frame[0, 0].numpy() for frame in truth_frames(recording)[:7]]).astype(np.float64)
    expected = float(((truth - truth.mean()) ** 2).mean())
    assert scores.mean("mse", "constant grey") == pytest.approx(expected, rel=1e-5)
    assert scores.mean("contrast", "constant grey") == 0


def test_only_evreal_clips_and_post_processes(judges: Judges) -> None:
    recording = made_up()
    frames = truth_frames(recording, 3.0, -1.0)
    model = replays(frames, post_processing="robust")
    paper = evaluate(model, recording, PAPER, judges)
    evreal = evaluate(model, recording, EVREAL, judges)
    truth = truth_frames(recording)
    raw = [float(((frame - target) ** 2).mean()) for frame, target in zip(frames, truth, strict=True)]
    robust = [float(((robust_range(frame) - target) ** 2).mean()) for frame, target in zip(frames, truth, strict=True)]
    assert paper.rows["as it is"]["mse"] == pytest.approx(raw[:7], rel=1e-5)
    assert evreal.rows["as it is"]["mse"] == pytest.approx(robust[:7], rel=1e-5)


def test_it_equals_a_plain_loop_over_the_model_measured_with_scikit_image(judges: Judges) -> None:
    recording, model, state = made_up(num_frames=5), build_model("tiny"), None
    scores = evaluate(model, recording, PAPER, judges)
    truth = recording.ground_truth
    assert truth is not None
    expected = []
    with torch.inference_mode():
        for item in plan_protocol(recording, PAPER).items:
            step = model(window_voxel(model, recording, item.window)[None], state)
            state = step.state
            assert item.frame is not None
            target, frame = truth.read_frame(item.frame).astype(np.float64), step.frame[0, 0].double().numpy()
            expected.append((float(((frame - target) ** 2).mean()), skimage_ssim(target, frame, data_range=2)))
    columns = scores.rows["as it is"]
    assert np.stack([columns["mse"], columns["ssim"]], axis=1) == pytest.approx(np.array(expected), abs=1e-9)


def test_normalised_voxels_reach_the_model_that_wants_them(judges: Judges) -> None:
    seen = []

    def step(voxel: Tensor, memory: tuple[Tensor, ...] | None) -> tuple[Tensor, tuple[Tensor, ...]]:
        seen.append(voxel)
        return torch.zeros(1, 1, *voxel.shape[-2:]), ()

    recording = made_up(num_frames=4)
    evaluate(Adapter(step, "watches", normalise_voxels=True), recording, PAPER, judges)
    voxel = seen[1]
    assert voxel[voxel != 0].std(correction=0).item() == pytest.approx(1, abs=1e-3)


def test_without_flow_the_estimate_is_named_or_nothing_is_measured(judges: Judges) -> None:
    recording, model = made_up(num_frames=4), build_model("tiny")
    estimated = evaluate(model, recording, PAPER, judges)
    assert any("DIS" in remark for remark in estimated.remarks)
    bare = evaluate(model, recording, PAPER, judges, estimates_flow=False)
    assert np.isnan(bare.rows["as it is"]["temporal"]).all()
    assert any("not measured" in remark for remark in bare.remarks)


def test_a_frame_without_flow_costs_its_temporal_consistency_alone(judges: Judges) -> None:
    recording = made_up(has_flow=True)
    truth, model = recording.ground_truth, build_model("tiny")
    assert truth is not None
    stored = truth.read_flow

    def read_flow(index: int) -> np.ndarray:
        if index in (3, 4):
            raise RecordingError(f"no flow is stored for frame {index}")
        assert stored is not None
        return stored(index)

    holed = replace(recording, ground_truth=replace(truth, read_flow=read_flow))
    whole, scores = (evaluate(model, each, PAPER, judges) for each in (recording, holed))
    for measure, values in whole.rows["as it is"].items():
        expected = values.copy()
        if measure == "temporal":
            expected[[frame in (3, 4) for frame in plan_protocol(recording, PAPER).frames]] = np.nan
        assert np.array_equal(scores.rows["as it is"][measure], expected, equal_nan=True)
    assert "TC: with the file's own flow" in scores.remarks
    assert "TC: not measured at 2 frames of made_up, which have no flow that can be read" in scores.remarks
    assert not any("no flow" in remark for remark in whole.remarks)


def test_progress_tells_the_fraction_done(judges: Judges) -> None:
    told = []
    evaluate(build_model("tiny"), made_up(num_frames=5), PAPER, judges, on_progress=told.append)
    assert told == [0.25, 0.5, 0.75, 1.0]


def test_scores_survive_the_disk_and_are_computed_anew_under_another_key(tmp_path, judges: Judges) -> None:
    scores = evaluate(build_model("tiny"), made_up("slow_hand"), PAPER, judges)
    write_scores(scores, tmp_path / "s.json", "key")
    read = read_scores(tmp_path / "s.json", "key")
    assert isinstance(read, Scores)
    assert read.to_json() == scores.to_json()
    assert (read.sequence, read.sequence and read.sequence.dataset) == (scores.sequence, "HQF")
    assert read_scores(tmp_path / "s.json", "other key") is None
    assert read_scores(tmp_path / "none.json", "key") is None


@pytest.mark.real
@pytest.mark.slow
def test_the_shipped_start_weights_score_on_slider_depth_what_their_readme_says(judges: Judges) -> None:
    """MSE .0190, SSIM .642, LPIPS .305, affine LPIPS .303; constant grey .0228 and .535 (there on frames 1 … 38)."""
    from tests.evaluation.start_weights import start_weights

    scores = evaluate(start_weights(), slider_depth(), PAPER, judges, estimates_flow=False)
    assert scores.mean("mse") == pytest.approx(0.0190, abs=3e-4)
    assert scores.mean("ssim") == pytest.approx(0.642, abs=2e-3)
    assert scores.mean("lpips") == pytest.approx(0.305, abs=2e-3)
    assert scores.mean("lpips", "best affine per frame") == pytest.approx(0.303, abs=2e-3)
    assert scores.mean("mse", "constant grey") == pytest.approx(0.0228, abs=3e-4)
    assert scores.mean("ssim", "constant grey") == pytest.approx(0.535, abs=1e-3)
    assert set(scores.rows) == set(ROWS)

import os
import shutil
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st

from etnet.training import data
from etnet.training.augment import Clip, augment
from etnet.training.config import AugmentConfig, DataConfig, Stage
from etnet.training.data import ClipSource, drawn_config, sequence_config, slot_at, stretches
from tests.training.micro import micro


@given(st.integers(1, 6), st.integers(1, 5), st.integers(0, 5))
def test_every_clip_is_shown_whole_and_in_order(num_lanes: int, chunks: int, lane: int):
    lane %= num_lanes
    slots = [slot_at(update, lane, num_lanes, chunks, truncate=10) for update in range(4 * chunks + 1)]
    for before, after in pairwise(slots):
        if after.begins:
            assert (after.number, after.first_window) == (before.number + 1, 0)
        else:
            assert (after.number, after.first_window) == (before.number, before.first_window + 10)
    lengths = [sum(slot.number == number for slot in slots) for number in range(1, 3)]
    assert lengths == [chunks, chunks]


def test_a_stream_taken_up_later_shows_the_same(tmp_path: Path):
    config = micro(tmp_path)
    whole = list(stretches(config, 0, [range(2)]))
    for start in (1, 3, 5):
        for late, known in zip(stretches(config, start, [range(2)]), whole[start:], strict=True):
            assert torch.equal(late.voxels, known.voxels)
            assert torch.equal(late.frames, known.frames)
            assert torch.equal(late.is_cold, known.is_cold)


def test_two_processes_share_the_clips_of_one(tmp_path: Path):
    config = micro(tmp_path, stages=(Stage(3, size=(40, 48), clips=4),))
    whole = stretches(config, 0, [range(4)])
    parts = [stretches(config, 0, [range(2)]), stretches(config, 0, [range(2, 4)])]
    for one, first, second in zip(whole, *parts, strict=True):
        assert torch.equal(one.voxels, torch.cat((first.voxels, second.voxels), dim=1))


def test_a_new_stage_has_its_size_and_begins_cold(tmp_path: Path):
    config = micro(tmp_path, stages=(Stage(2, size=(40, 48)), Stage(2, size=(48, 56), clips=1)))
    sizes = [tuple(stretch.voxels.shape) for stretch in stretches(config, 0, [range(2), range(1)])]
    assert sizes == [(2, 2, 5, 40, 48)] * 2 + [(2, 1, 5, 48, 56)] * 2


def test_many_clips_an_update_follow_from_its_number_alone(tmp_path: Path):
    config = micro(tmp_path, stages=(Stage(5, size=(40, 48), clips=16),))
    whole = list(stretches(config, 0, [range(16)]))
    assert {stretch.voxels.shape[1] for stretch in whole} == {16}
    assert len({whole[0].voxels[:, lane].numpy().tobytes() for lane in range(16)}) == 16
    for start in (2, 3):
        for late, known in zip(stretches(config, start, [range(16)]), whole[start:], strict=True):
            assert torch.equal(late.voxels, known.voxels)
            assert late.first_window == known.first_window


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:This DataLoader will create")  # more workers than this machine has cores
@pytest.mark.parametrize("shares", [True, False])
@pytest.mark.parametrize("workers", [1, 3])
def test_worker_processes_give_the_same_clips_however_many(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, workers: int, shares: bool
):
    monkeypatch.setattr(data, "_fits_shared_memory", lambda config: shares)
    config = micro(tmp_path, stages=(Stage(4, size=(40, 48)),))
    alone = list(stretches(config, 1, [range(2)]))
    helped = list(stretches(replace(config, data=replace(config.data, workers=workers)), 1, [range(2)]))
    for one, other in zip(alone, helped, strict=True):
        assert torch.equal(one.voxels, other.voxels)
        assert torch.equal(one.frames, other.frames)
        assert torch.equal(one.flow, other.flow)


def test_clips_take_shared_memory_only_where_all_of_them_fit(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    config = micro(tmp_path, stages=(Stage(1, size=(112, 112), clips=16),))
    config = replace(config, data=replace(config.data, windows=40, workers=16))
    needed = 2 * 4 * (16 * 7 + 16) * 40 * 112 * 112 * 8
    usage = shutil.disk_usage(tmp_path)
    fits = data._fits_shared_memory
    for free, holds in ((needed, True), (needed - 1, False)):
        monkeypatch.setattr(shutil, "disk_usage", lambda folder, free=free: usage._replace(free=free))
        assert fits(config, tmp_path) == holds
    assert not fits(config, tmp_path / "none")
    monkeypatch.setattr(shutil, "disk_usage", lambda folder: usage._replace(free=needed))
    monkeypatch.setattr(os, "sysconf", lambda name: 256)
    assert not fits(config, tmp_path)


def test_seeds_and_keys_give_different_clips(tmp_path: Path):
    config = micro(tmp_path)
    clips = [ClipSource(config)[0, 0, 0], ClipSource(config)[0, 0, 1], ClipSource(replace(config, seed=1))[0, 0, 0]]
    for i in range(3):
        assert not np.array_equal(clips[i].frames, clips[i - 1].frames)


def _clip(rng: np.random.Generator) -> Clip:
    shape = (3, 8, 10)
    return Clip(
        rng.standard_normal((3, 5, 8, 10), np.float32),
        rng.random(shape, np.float32),
        rng.standard_normal((3, 2, 8, 10), np.float32),
    )


@given(st.integers(0, 30))
def test_flips_take_voxels_frames_and_flow_along(seed: int):
    clip = _clip(np.random.default_rng(0))
    flipped = augment(clip, AugmentConfig(noise_std=(0, 0)), np.random.default_rng(seed))
    found = 0
    for sign_x in (1, -1):
        for sign_y in (1, -1):
            frames = clip.frames[:, ::sign_y, ::sign_x]
            flow = clip.flow[..., ::sign_y, ::sign_x] * np.array([sign_x, sign_y])[:, None, None]
            if np.array_equal(frames, flipped.frames):
                found += 1
                np.testing.assert_array_equal(flow.astype(np.float32), flipped.flow)
                np.testing.assert_array_equal(clip.voxels[..., ::sign_y, ::sign_x], flipped.voxels)
    assert found == 1


def test_noise_and_hot_pixels_have_the_size_that_was_asked_for():
    clip = Clip(
        np.zeros((4, 5, 64, 64), np.float32), np.zeros((4, 64, 64), np.float32), np.zeros((4, 2, 64, 64), np.float32)
    )
    noisy = augment(clip, AugmentConfig(noise_std=(0.1, 0.1)), np.random.default_rng(0))
    assert noisy.voxels.std() == pytest.approx(0.1, rel=0.02)
    hot = augment(clip, AugmentConfig(noise_std=(0, 0), hot_pixel_share=0.05), np.random.default_rng(3))
    lit = hot.voxels != 0
    assert 0 < lit[0, 0].mean() <= 0.05
    assert (hot.voxels == hot.voxels[0, 0]).all()
    assert not clip.voxels.any()


def test_density_and_tone_are_drawn_for_each_clip(tmp_path: Path):
    config = micro(tmp_path, data=DataConfig(windows=4, workers=0, density=(0.05, 5.0), gamma_share=0.3))
    drawn = [drawn_config(config, (40, 48), np.random.default_rng(seed)) for seed in range(300)]
    aims = np.array([wanted.scene.density for wanted, _ in drawn])
    assert aims.min() < 0.08
    assert aims.max() > 3
    assert np.log(aims).mean() == pytest.approx(np.log(0.5), abs=0.25)
    assert all((wanted.target_tone == "srgb") == is_gamma for wanted, is_gamma in drawn)
    assert 0.2 < np.mean([is_gamma for _, is_gamma in drawn]) < 0.4


def test_without_them_clips_are_drawn_as_before(tmp_path: Path):
    config = micro(tmp_path)
    wanted, is_gamma = drawn_config(config, (40, 48), np.random.default_rng(0))
    assert (wanted, is_gamma) == (sequence_config(config, (40, 48)), False)


def test_a_gamma_coded_clip_is_marked_in_its_stretch(tmp_path: Path):
    config = micro(tmp_path, data=DataConfig(windows=4, workers=0, gamma_share=1.0))
    assert next(stretches(config, 0, [range(2)])).is_gamma == (True, True)
    assert augment(ClipSource(config)[0, 0, 0], config.augment, np.random.default_rng(0)).is_gamma

"""The second generator: its clips have the density asked for, and its events are those of perfect pixels."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch

from etnet.evaluation.lpips import load_lpips
from etnet.nets.presets import build_model
from etnet.training.config import ValidationConfig
from etnet.training.data import procedural_pool
from etnet.training.other_scenes import (
    DARK,
    _crossings,
    _events_of,
    _renders,
    affine_by_film,
    other_film,
    other_films,
)
from tests.training.micro import micro

PICTURE = procedural_pool(np.random.default_rng(0)).photos[0]


@pytest.mark.parametrize("density", [0.1, 1.0, 5.0])
@pytest.mark.parametrize("is_gamma", [False, True])
def test_a_clip_has_the_density_that_was_asked_for(density: float, is_gamma: bool):
    voxels, frames = other_film(PICTURE, density, is_gamma, 4, np.random.default_rng(1))
    assert voxels.shape == (4, 5, 128, 128)
    assert frames.shape == (4, 1, 128, 128)
    assert 0 <= frames.min() < frames.max() <= 1
    assert voxels.abs().sum() / (4 * 128 * 128) == pytest.approx(density, rel=0.5)


def test_events_add_up_to_the_change_of_log_intensity():
    log = np.log(_renders(PICTURE, 33, 1.0, np.random.default_rng(2)) + DARK)
    counts = _crossings(log, 0.1)
    assert np.abs(log[0] + 0.1 * counts.sum(0) - log[-1]).max() < 0.1
    events = _events_of(counts)
    assert len(events) == np.abs(counts).sum()
    assert (np.diff(events.t) >= 0).all()
    signed = np.zeros(counts.shape[1:])
    np.add.at(signed, (events.y, events.x), events.p)
    assert np.array_equal(signed, counts.sum(0))


def test_films_are_the_same_every_time_and_named_by_tone_and_density(tmp_path: Path):
    config = micro(tmp_path, validation=ValidationConfig(windows=2, other_densities=(0.3, 2.0)))
    first, second = other_films(config), other_films(replace(config, seed=5))
    assert [film.name for film in first] == ["linear 0.3", "gamma 0.3", "linear 2", "gamma 2"]
    assert all(torch.equal(a.voxels, b.voxels) for a, b in zip(first, second, strict=True))
    assert not torch.equal(first[0].frames, first[1].frames)


def test_affine_scores_forgive_gain_and_offset(tmp_path: Path):
    config = micro(tmp_path, validation=ValidationConfig(windows=2, other_densities=(1.0,)))
    films, model, lpips = other_films(config), build_model(config.network), load_lpips()
    plain = affine_by_film(model, films, 2, lpips)
    softer = [replace(film, frames=0.5 * film.frames + 0.2) for film in films]
    assert plain.keys() == {"linear 1", "gamma 1"}
    assert all(0 < value < 2 for value in affine_by_film(model, softer, 2, lpips).values())
    assert model.training is False

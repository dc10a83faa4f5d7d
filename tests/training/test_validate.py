from dataclasses import replace
from pathlib import Path

import pytest
import torch

from etnet.evaluation.lpips import load_lpips
from etnet.nets.intervention import Intervention
from etnet.nets.presets import build_model
from etnet.training.config import ValidationConfig
from etnet.training.initialise import start_locally
from etnet.training.validate import films_of, recorded_film, validate
from tests.real_data import DATA
from tests.training.micro import micro

CRADLE = DATA / "aedat4" / "davis346_newtons_cradle_0.5s.aedat4"


def test_scores_are_those_of_a_plain_loop(tmp_path: Path):
    validation = ValidationConfig(every=1, clips=2, windows=4, size=(40, 48), score_every=2)
    config = micro(tmp_path, validation=validation)
    films, lpips = films_of(config), load_lpips()
    model = build_model(replace(config.network, dropout=0.0))
    start_locally(model, torch.Generator().manual_seed(0))
    scores = validate(model, films, 2, lpips)
    changes = {"as_is": Intervention(), "uniform_attention": Intervention(uniform_attention=True)}
    for name, intervention in changes.items():
        distances = []
        with torch.no_grad():
            for film in films:
                state = None
                for index, voxel in enumerate(film.voxels):
                    step = model(voxel[None], state, intervention=intervention)
                    state = step.state
                    if index % 2 == 0:
                        distances.append(float(lpips(step.frame.clamp(0, 1), film.frames[index : index + 1])))
        assert scores.lpips[name] == pytest.approx(sum(distances) / len(distances), abs=1e-5)
    assert scores.lpips["as_is"] != scores.lpips["uniform_attention"]
    assert set(scores.films) == {"clip0", "clip1"}
    assert scores.lpips["as_is"] == pytest.approx(sum(scores.films.values()) / 2)


def test_the_clips_are_the_same_every_time_and_not_those_of_training(tmp_path: Path):
    config = micro(tmp_path, validation=ValidationConfig(every=1, clips=1, windows=2, size=(40, 48)))
    first, second = films_of(config)[0], films_of(replace(config, seed=9))[0]
    assert torch.equal(first.voxels, second.voxels)
    assert torch.equal(first.frames, second.frames)


@pytest.mark.real
@pytest.mark.skipif(not CRADLE.exists(), reason=f"{CRADLE.name} is not here")
def test_a_recording_is_cut_at_its_frames(tmp_path: Path):
    film = recorded_film(CRADLE, micro(tmp_path))
    assert film.voxels.shape == (12, 5, 260, 346)
    assert film.frames.shape == (12, 1, 260, 346)
    assert 0 <= float(film.frames.min()) < float(film.frames.max()) <= 1
    assert (film.voxels != 0).flatten(1).any(1).all()

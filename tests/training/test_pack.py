import os
import re
import shutil
import subprocess
import sys
import tomllib
import zipfile
from dataclasses import replace
from importlib.metadata import packages_distributions
from pathlib import Path

import cv2
import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st

from etnet.cli.main import main
from etnet.cli.train_options import command_line, parse
from etnet.nets.weights import load_weights
from etnet.simulation.config import SceneConfig
from etnet.simulation.pictures import PicturePool, is_held_out
from etnet.training import needs, pack_pictures
from etnet.training.checkpoint import LAST, Checkpoint, check_same_run, load_checkpoint
from etnet.training.config import DataConfig, Stage, TrainConfig, TrainingError, ValidationConfig
from etnet.training.loop import train
from etnet.training.pack import away, source_archive, write_pack
from etnet.training.recipes import RECIPES
from tests.training.micro import micro

ROOT = Path(__file__).resolve().parents[2]
BOUND = 1_000_000


def folders_of(root: Path, count: int = 14, size: tuple[int, int] = (60, 80)) -> DataConfig:
    """Photos (most JPEG, some PNG) and cut-outs that were never seen before."""
    rng = np.random.default_rng(0)
    photos, cutouts = root / "photos of mine", root / "objects"
    photos.mkdir(parents=True)
    cutouts.mkdir()
    held_out = next(index for index in range(count, 1000) if is_held_out(f"own__{index}.jpg"))
    for index in (*range(count), held_out):
        coarse = rng.integers(0, 256, (6, 8, 3)).astype(np.uint8)
        picture = cv2.resize(coarse, size[::-1], interpolation=cv2.INTER_CUBIC)
        cv2.imwrite(str(photos / f"own__{index}.{'png' if index in (0, 4, 8) else 'jpg'}"), picture)
    for index in range(3):
        cut = rng.integers(0, 256, (40, 30, 4)).astype(np.uint8)
        cv2.imwrite(str(cutouts / f"thing{index}.png"), cut)
    return DataConfig(photos=photos, cutouts=cutouts, windows=4, workers=0, scene=SceneConfig(num_objects=(1, 2)))


def packed(config: TrainConfig, folder: Path, max_bytes: int = BOUND) -> Path:
    write_pack(config, folder, max_bytes, command_line)
    return folder


def in_the_pack(config: TrainConfig, folder: Path) -> tuple[Path, Path]:
    """Its folders of photos and cut-outs."""
    data = away(config).data
    assert data.photos is not None
    assert data.cutouts is not None
    return folder / data.photos, folder / data.cutouts


def bytes_in(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in folder.iterdir()}


@pytest.mark.parametrize("name", RECIPES)
def test_a_command_line_tells_a_whole_config(name: str, tmp_path: Path):
    config = RECIPES[name]
    changed = replace(
        config,
        out=tmp_path / "a folder",
        seed=7,
        minutes=1.5,
        channels_last=True,
        stages=tuple(replace(stage, updates=stage.updates + 1, size=(96, 104)) for stage in config.stages),
        data=replace(config.data, density=(0.1, 2.0), photos=tmp_path, gamma_share=1e-7),
        augment=replace(config.augment, flips=False),
        context=replace(config.context, without_context=True),
        network=replace(config.network, skips=False, dim=config.network.dim),
        validation=replace(config.validation, other_densities=(0.5,), every=3),
    )
    for wanted in (config, changed, replace(config, data=replace(config.data, density=None))):
        assert parse(command_line(wanted), "etnet train").train == wanted


def test_of_two_words_for_one_option_the_last_wins():
    words = [*command_line(replace(RECIPES["tiny"], minutes=3.0)), "--minutes", "5"]
    assert parse(words, "etnet train").train.minutes == 5


def test_pictures_that_fit_are_the_same_files(tmp_path: Path):
    config = replace(micro(tmp_path / "run"), data=folders_of(tmp_path))
    folder = packed(config, tmp_path / "pack")
    assert config.data.photos is not None
    assert config.data.cutouts is not None
    photos, cutouts = in_the_pack(config, folder)
    assert (photos.name, cutouts.name) == (config.data.photos.name, config.data.cutouts.name)
    assert bytes_in(photos) == bytes_in(config.data.photos)
    assert bytes_in(cutouts) == bytes_in(config.data.cutouts)


@pytest.mark.parametrize("kind", ["link", "here", "above"])
def test_a_run_knows_its_pictures_here_and_in_its_pack(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, kind: str):
    photos = tmp_path / "photos"
    (photos / "inner").mkdir(parents=True)
    (tmp_path / "link").symlink_to(photos)
    elsewhere = tmp_path / "elsewhere"
    elsewhere.mkdir()
    monkeypatch.chdir(photos)
    given = {"link": tmp_path / "link", "here": Path(), "above": Path("inner", "..")}[kind]
    config = micro(tmp_path / "run", data=DataConfig(photos=given, cutouts=given, windows=4, workers=0))
    there = away(config)
    assert there.data.photos == Path("photos", "link" if kind == "link" else "photos")
    monkeypatch.chdir(elsewhere)
    for one, other in ((config, there), (there, config)):
        checkpoint = Checkpoint(0, other.as_plain(), {}, {}, {}, {}, (), best=1.0)
        check_same_run(one, checkpoint, Path(LAST))


@pytest.mark.parametrize("share", [0.9, 0.5, 0.3])
def test_pictures_never_take_more_bytes_than_they_may(tmp_path: Path, share: float):
    data = folders_of(tmp_path, size=(400, 500))
    assert data.photos is not None
    assert data.cutouts is not None
    total = sum(path.stat().st_size for path in [*data.photos.iterdir(), *data.cutouts.iterdir()])
    config = replace(micro(tmp_path / "run"), data=data)
    folder = packed(config, tmp_path / "pack", max_bytes=int(share * total))
    photos, cutouts = in_the_pack(config, folder)
    assert 0 < sum(path.stat().st_size for path in [*photos.iterdir(), *cutouts.iterdir()]) <= share * total
    for ours, theirs in ((photos, data.photos), (cutouts, data.cutouts)):
        assert set(bytes_in(ours)) == set(bytes_in(theirs))
    for split in ("train", "held-out"):
        before = PicturePool.from_folder(data.photos, data.cutouts, split)
        after = PicturePool.from_folder(photos, cutouts, split)
        assert after.names == before.names
        assert len(after.cutouts) == len(before.cutouts)
        for one, other in zip(before.photos, after.photos, strict=True):
            assert max(other.shape) <= pack_pictures.Limits.of(config).photo
            smaller = cv2.resize(one, other.shape[::-1], interpolation=cv2.INTER_AREA)
            assert np.abs(smaller.astype(float) - other).mean() < 4
        for one, other in zip(before.cutouts, after.cutouts, strict=True):
            assert other.alpha.std() == pytest.approx(one.alpha.std(), rel=0.6)
    assert any(is_held_out(path.name) for path in photos.iterdir())


def test_pictures_that_cannot_fit_are_refused_and_nothing_is_left(tmp_path: Path):
    config = replace(micro(tmp_path / "run"), data=folders_of(tmp_path))
    with pytest.raises(TrainingError, match=r"18 pictures do not fit in 0\.0005 MB"):
        packed(config, tmp_path / "pack", max_bytes=500)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["objects", "photos of mine"]


@given(st.integers(32, 400), st.integers(32, 400), st.floats(0.25, 4))
def test_a_photo_at_its_limit_is_enlarged_no_more_than_any(height: int, width: int, aspect: float):
    config = TrainConfig(Path("run"), stages=(Stage(1, size=(height, width)),), validation=ValidationConfig(every=0))
    side = pack_pictures.Limits.of(config).photo
    photo = (side, side / aspect) if aspect > 1 else (side * aspect, side)
    # The largest scale at which `textures.draw_photo` shows a photo of at least a view's size is 1.1.
    assert 1.05 * max(height / photo[0], width / photo[1]) <= 1.1


def test_sources_that_are_never_drawn_stay_at_home(tmp_path: Path):
    data = folders_of(tmp_path)
    assert data.photos is not None
    cv2.imwrite(str(data.photos / "skimage__coins.jpg"), np.zeros((20, 20), np.uint8))
    config = replace(micro(tmp_path / "run"), data=data)
    assert "skimage__coins.jpg" not in bytes_in(in_the_pack(config, packed(config, tmp_path / "pack"))[0])


def test_the_same_source_is_the_same_bytes_and_has_no_more_than_it_needs():
    content = source_archive()
    assert content == source_archive()
    assert len(content) < 8_000_000


def test_what_it_needs_of_others_is_what_the_package_asks_for():
    asked = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    assert set(needs.NEEDS.values()) <= set(asked["dependencies"])
    assert asked["requires-python"] == ">=" + ".".join(map(str, needs.OLDEST_PYTHON))


IMPORTED = """
import sys
from pathlib import Path
from etnet.cli import train, train_options
from etnet.training import needs
from etnet.training.config import Stage, ValidationConfig
from etnet.training.loop import train
from tests.training.micro import micro
validation = ValidationConfig(1, clips=1, windows=2, size=(40, 48), other_densities=(1.0,))
train(micro(Path(sys.argv[1]), stages=(Stage(1, size=(40, 48)),), validation=validation))
print(" ".join({name.partition(".")[0] for name in sys.modules}))
"""


def test_nothing_else_that_the_package_asks_for_is_imported(tmp_path: Path):
    done = subprocess.run(
        [sys.executable, "-c", IMPORTED, str(tmp_path)], cwd=ROOT, capture_output=True, text=True, check=True
    )
    owners = packages_distributions()
    used = {owner.lower() for name in done.stdout.split() for owner in owners.get(name, ())}
    asked = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["dependencies"]
    names = {re.split("[>=;]", one)[0] for one in asked}
    listed = {re.split("[>=;]", one)[0] for one in needs.NEEDS.values()}
    assert used & names == listed


def test_what_is_missing_is_one_line(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]):
    monkeypatch.setitem(needs.NEEDS, "no_such_module", "no-such-package>=1")
    assert needs.main() == 1
    said = capsys.readouterr().err
    assert said.count("\n") == 1
    assert "missing here: no-such-package>=1 (No module named 'no_such_module')" in said


def test_a_folder_that_is_there_is_left_alone(tmp_path: Path):
    (tmp_path / "pack").mkdir()
    with pytest.raises(TrainingError, match="is there already"):
        packed(micro(tmp_path / "run"), tmp_path / "pack")


def run_there(folder: Path, tmp_path: Path, *options: str) -> subprocess.CompletedProcess[str]:
    """`run.sh` in a process of its own, from elsewhere, with a home that is empty and stays so."""
    home, elsewhere = tmp_path / "home", tmp_path / "elsewhere"
    for made in (home, elsewhere):
        made.mkdir(exist_ok=True)
    environment = {"HOME": str(home), "PATH": os.environ["PATH"], "PYTHON": sys.executable, "OMP_NUM_THREADS": "1"}
    done = subprocess.run(
        ["sh", str(folder / "run.sh"), *options], cwd=elsewhere, env=environment, capture_output=True, text=True
    )
    assert list(home.iterdir()) == list(elsewhere.iterdir()) == []
    return done


@pytest.mark.slow
def test_a_run_goes_away_and_comes_home_to_the_same_bits(tmp_path: Path):
    data = folders_of(tmp_path / "pictures")
    words = ["--config", "tiny", "--stages.0.updates", "4", "--stages.0.size", "40", "48", "--data.workers", "0"]
    words += ["--validation.every", "0", "--data.photos", str(data.photos), "--data.cutouts", str(data.cutouts)]
    assert main(["train", *words, "--out", str(tmp_path / "whole")]) == 0
    assert main(["train", *words, "--out", str(tmp_path / "run"), "--pack", str(tmp_path / "pack")]) == 0
    assert not (tmp_path / "run").exists()

    there = tmp_path / "another machine" / "pack"
    shutil.copytree(tmp_path / "pack", there)
    shutil.rmtree(tmp_path / "pack")
    assert str(tmp_path) not in (there / "run.sh").read_text()
    for update in (1, 2):
        done = run_there(there, tmp_path, "--minutes", ".00001", "--device", "cpu")
        assert done.returncode == 0, done.stderr
        assert load_checkpoint(there / "run" / LAST).update == update
    assert (there / "source" / "etnet" / "training" / "__pycache__").is_dir(), "another etnet was imported"
    weights = load_weights(there / "run" / "weights.safetensors")
    assert weights.card["updates"] == 2

    shutil.copytree(there / "run", tmp_path / "run")
    assert main(["train", *words, "--out", str(tmp_path / "run")]) == 0
    one, other = (load_checkpoint(tmp_path / name / LAST) for name in ("whole", "run"))
    assert other.update == 4
    for name, value in one.weights.items():
        assert torch.equal(value, other.weights[name])
    for name, value in one.averaged.items():
        assert torch.equal(value, other.averaged[name])


def test_a_pack_takes_up_the_run_that_is_there(tmp_path: Path):
    config = micro(tmp_path / "run", stages=(Stage(2, size=(40, 48)),))
    train(config)
    with pytest.raises(TrainingError, match="made with another seed"):
        packed(replace(config, seed=1), tmp_path / "other")
    other = replace(config, network=replace(config.network, scales=2))
    with pytest.raises(TrainingError, match=r"another network\.scales, which --changed cannot change"):
        write_pack(other, tmp_path / "other", BOUND, command_line, changed=True)
    assert not (tmp_path / "other").exists()
    folder = packed(replace(config, minutes=3), tmp_path / "pack")
    assert load_checkpoint(folder / "run" / LAST).update == 2
    assert (folder / "run" / "log.jsonl").exists()
    assert not (folder / "start.safetensors").exists()
    with zipfile.ZipFile(folder / "etnet.zip") as archive:
        names = archive.namelist()
    assert "etnet/static/models/lpips_alex.md" in names
    assert {name.partition("/")[0] for name in names} <= {"etnet", "LICENSE"}


def test_a_run_that_begins_takes_its_start_along(tmp_path: Path):
    start = ROOT / "static" / "models" / "etnet-half.safetensors"
    folder = packed(replace(RECIPES["half"], out=tmp_path / "run", start=start), tmp_path / "pack")
    assert (folder / "start.safetensors").read_bytes() == start.read_bytes()
    assert "--start start.safetensors" in (folder / "run.sh").read_text()
    assert "--device auto" in (folder / "run.sh").read_text()


def test_folders_of_pictures_may_move_and_workers_may_be_more(tmp_path: Path):
    data = folders_of(tmp_path / "here")
    config = replace(micro(tmp_path / "run"), data=data, stages=(Stage(1, size=(40, 48)),))
    train(config)
    shutil.move(tmp_path / "here", tmp_path / "there")
    assert data.photos is not None
    assert data.cutouts is not None
    moved = replace(
        data,
        photos=tmp_path / "there" / data.photos.name,
        cutouts=tmp_path / "there" / data.cutouts.name,
        prefetch=2,
    )
    assert train(replace(config, data=moved)).update == 1
    shutil.copytree(moved.photos or tmp_path, tmp_path / "other photos")
    with pytest.raises(TrainingError, match=r"another data\.photos"):
        train(replace(config, data=replace(moved, photos=tmp_path / "other photos")))
    with pytest.raises(TrainingError, match=r"another data\.scene\.density"):
        train(replace(config, data=replace(moved, scene=replace(moved.scene, density=0.9))))

"""On a full disk every writer says so in one line, exits with 1, and leaves nothing half-written under its name."""

import os
import resource
from contextlib import contextmanager

import cv2
import pytest
import torch

from etnet.cli.main import guarded, main
from etnet.events import samples
from etnet.events.write import write_recording
from etnet.nets.pienet import PIENET_PRESETS
from etnet.nets.weights import save_weights
from etnet.training.config import Stage
from etnet.training.loop import train
from tests.app.stand_ins import recording
from tests.evaluation.recordings import made_up, write_event_utils
from tests.export.recordings_made_up import made_up_model
from tests.nets.test_pienet import released
from tests.simulation.pictures_made_up import made_up_pool
from tests.simulation.test_video import drifting, write
from tests.test_samples import package, toy_of  # noqa: F401
from tests.training.micro import micro


@contextmanager
def files_of_at_most(num_bytes):
    """No file of this process grows beyond that: to a writer it is a disk that is full."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (num_bytes, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)


@pytest.fixture
def sample(tmp_path):
    write_recording(recording(), tmp_path / "a.h5")
    return tmp_path / "a.h5"


def refused(command, out, capsys, num_bytes):
    out.parent.mkdir()
    with files_of_at_most(num_bytes):
        assert main([*map(str, command)]) == 1
    said = [line for line in capsys.readouterr().err.splitlines() if line.startswith("etnet: ")]
    assert len(said) == 1
    assert "Traceback" not in said[0]
    return [name for _, _, names in os.walk(out.parent) for name in names]


@pytest.mark.parametrize(
    ("kind", "name", "num_bytes", "more"),
    [
        ("video", "v.mp4", 1_000, ["--panels", "events", "reconstruction", "--stamps"]),
        ("gif", "g.gif", 1_000, ["--stamps"]),
        ("frames", "frames", 500, []),
        ("arrays", "a.npz", 5_000, []),
        ("arrays", "a.h5", 5_000, []),
        ("csv", "t.csv", 200, []),
        ("page", "p.html", 5_000, ["--queries", "3", "2"]),
        ("session", "s.json", 200, []),
    ],
)
def test_exports(tmp_path, sample, capsys, kind, name, num_bytes, more):
    save_weights(made_up_model(), tmp_path / "tiny.safetensors", {"title": "tiny"})
    out = tmp_path / "out" / name
    options = ["-o", out, "--model", tmp_path / "tiny.safetensors", "--range", "0:4", *more]
    left = refused(["export", kind, sample, *options], out, capsys, num_bytes)
    assert left == []


@pytest.mark.parametrize(
    ("name", "layout"),
    [
        ("c.h5", "event_utils"),
        ("c.h5", "dsec"),
        ("c.h5", "mvsec"),
        ("c.aedat4", "aedat4"),
        ("c.raw", "evt3"),
        ("c.es", "es"),
        ("c.txt", "text"),
        ("c", "rpg"),
        ("c.csv", "csv"),
        ("c.npz", "npz"),
    ],
)
def test_conversions(tmp_path, sample, capsys, name, layout):
    out, again = tmp_path / "out" / name, tmp_path / "out" / "again" / name
    assert refused(["convert-events", sample, out, "--layout", layout], out, capsys, 4_000) == []
    assert refused(["cut", sample, again, "--layout", layout], again, capsys, 4_000) == []


@pytest.mark.parametrize("name", ["r.h5", "r.aedat4"])
def test_a_live_recording_keeps_what_was_flushed_and_says_that_it_ended(tmp_path, sample, capsys, name):
    out = tmp_path / "out" / name
    left = refused(["record", sample, out, "--speed", "0"], out, capsys, 20_000)
    assert sorted(left) == sorted([name, f"{name}.live.jsonl"])


def pictures_are_whole(folder):
    return all(cv2.imread(str(path)) is not None for path in folder.rglob("*.png"))


@pytest.fixture
def weights(tmp_path):
    save_weights(made_up_model(), tmp_path / "tiny.safetensors", {"title": "tiny"})
    return tmp_path / "tiny.safetensors"


@pytest.mark.parametrize(("layout", "num_bytes"), [("frames", 60), ("frames", 1_500), ("kalibr", 60)])
def test_reconstructions(tmp_path, sample, weights, capsys, layout, num_bytes):
    out = tmp_path / "out" / "r"
    command = ["reconstruct", sample, "--out", out, "--model", weights, "--layout", layout]
    left = [name for name in refused(command, out, capsys, num_bytes) if name != ".etnet-frames"]
    assert (out / ".etnet-frames").stat().st_size == 0  # says whose the frames are, and stays
    assert all(name.endswith(".png") for name in left)
    assert bool(left) == (num_bytes == 1_500), "a picture is smaller than a video of it"
    assert pictures_are_whole(out)


def test_simulations_of_photos(tmp_path, capsys):
    photos = tmp_path / "photos"
    photos.mkdir()
    for i, photo in enumerate(made_up_pool().photos):
        cv2.imwrite(str(photos / f"{i}.png"), photo)
    out = tmp_path / "out" / "s"
    options = ["--photos", photos, "--num", "1", "--seconds", "0.2", "--size", "48", "32", "--split", "all"]
    assert refused(["simulate", out, *options], out, capsys, 3_000) == []


@pytest.mark.parametrize("name", ["s.h5", "s.aedat4", "s.txt", "s.raw"])
def test_simulations_of_a_video(tmp_path, capsys, name):
    film = write(tmp_path / "a.mp4", drifting(6))
    out = tmp_path / "out" / name
    assert refused(["simulate", out, "--video", film], out, capsys, 3_000) == []


def test_evaluations(tmp_path, weights, capsys):
    write_event_utils(made_up(num_frames=4), tmp_path / "one.h5")
    out = tmp_path / "out" / "e"
    command = ["evaluate", weights, tmp_path / "one.h5", "--out", out, "--judge", "alex", "--flow", "file"]
    left = refused(command, out, capsys, 100)
    assert [name for name in left if not name.endswith(".claim")] == []  # a claim is an empty file that stays


def test_converted_checkpoints(tmp_path, capsys):
    torch.save(released(PIENET_PRESETS["pie-net-lite"]), tmp_path / "model.pth")
    out = tmp_path / "out" / "c.safetensors"
    assert refused(["convert", tmp_path / "model.pth", out], out, capsys, 20_000) == []


def test_the_picture_of_an_inspection(tmp_path, sample, capsys):
    out = tmp_path / "out" / "p.png"
    assert refused(["inspect", sample, "--picture", out], out, capsys, 500) == []


def test_samples(tmp_path, package, monkeypatch, capsys):  # noqa: F811
    monkeypatch.setattr(samples, "SAMPLES", {"toy": toy_of(package)})
    out = tmp_path / "out" / "here"
    assert refused(["sample", "toy", "--from", package, "--out", out], out, capsys, 1_000) == []


def test_training(tmp_path, capsys):
    config = micro(tmp_path / "out" / "t", stages=(Stage(2, size=(40, 48)),), checkpoint_every=1)
    (tmp_path / "out").mkdir()
    with files_of_at_most(30_000):
        assert guarded(lambda: train(config) and 0, "etnet") == 1
    said = capsys.readouterr().err.strip().splitlines()
    assert said[-1].startswith("etnet: ")
    assert "Traceback" not in "".join(said)
    left = [path.name for path in (tmp_path / "out").rglob("*") if path.is_file()]
    assert set(left) <= {"log.jsonl", "config.json"}

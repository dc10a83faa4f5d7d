"""On a full disk every writer says so in one line, exits with 1, and leaves nothing half-written under its name."""

import os
import resource
from contextlib import contextmanager

import pytest

from etnet.cli.main import main
from etnet.events.write import write_recording
from etnet.nets.weights import save_weights
from tests.app.stand_ins import recording
from tests.export.recordings_made_up import made_up_model


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

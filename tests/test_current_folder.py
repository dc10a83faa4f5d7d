"""Nothing that lies beside a file or in the current folder is run by the processes that read the file or fetch it."""

import sys

import numpy as np
import pytest
import scipy.io

from app.catalogue.opening_apart import open_apart
from app.catalogue.video_apart import FootageApart
from etnet.events.assumptions import NOTHING_ASSUMED, Assumptions
from etnet.events.open import open_recording
from etnet.events.samples import fetch
from etnet.events.write import write_recording
from etnet.simulation.video import VideoConfig
from tests.app.stand_ins import recording
from tests.simulation.test_video import drifting, write
from tests.test_samples import package, toy_of  # noqa: F401

NAMES = (
    "scipy", "numpy", "h5py", "cv2", "av", "pip", "json", "struct", "resource", "runpy", "select", "pathlib", "ctypes",
    "sitecustomize", "usercustomize", "etnet", "app",
)  # fmt: skip


@pytest.fixture
def hostile(tmp_path, monkeypatch):
    """The current folder, full of modules under the names of others; a file called "ran" tells that one was run."""
    folder = tmp_path / "here"
    folder.mkdir()
    for name in NAMES:
        (folder / f"{name}.py").write_text(
            f"open({str(tmp_path / 'ran')!r}, 'a').write({name!r})\nraise SystemExit(7)\n"
        )
    monkeypatch.chdir(folder)
    monkeypatch.setattr(sys, "path", [*sys.path, ""])  # as of whoever started Python there
    yield folder
    assert not (tmp_path / "ran").exists(), (tmp_path / "ran").read_text()


def test_the_process_that_reads_a_matlab_file_runs_nothing_of_it(hostile):
    columns = {"x": np.arange(9), "y": np.arange(9), "ts": np.arange(9) * 10, "p": np.arange(9) % 2}
    scipy.io.savemat(hostile / "a.mat", columns)
    with open_recording(hostile / "a.mat", assume=Assumptions(width=20, height=12)) as opened:
        assert opened.num_events == 9


def test_the_process_that_opens_a_visitors_file_runs_nothing_of_it(hostile):
    write_recording(recording(), hostile / "a.csv")
    apart = open_apart(hostile / "a.csv", NOTHING_ASSUMED, 64 << 20, lambda share: None, lambda: True)
    assert apart.path.exists()


def test_the_process_that_decodes_a_visitors_video_runs_nothing_of_it(hostile):
    footage = FootageApart(write(hostile / "a.mp4", drifting(4, speed=2.0)), VideoConfig(), lambda: False)
    try:
        assert len(list(footage)) == 4
    finally:
        footage.close()


def test_the_process_that_fetches_a_sample_runs_nothing_of_it(hostile, package):  # noqa: F811
    assert (fetch(toy_of(package)) / "events.txt").is_file()

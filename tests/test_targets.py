"""What is written replaces a regular file or nothing: no folder, no pipe, no device."""

import os
import stat

import numpy as np
import pytest

from etnet.errors import EtnetError
from etnet.events.recording import recording_of_events
from etnet.events.write import write_recording
from etnet.export.images import write_png
from etnet.export.video import gif_writer
from etnet.simulation.video import VideoConfig, simulate_video
from tests.strategies import make_events


def write_gif(path):
    with gif_writer(path, 4, 4, 10.0) as append:
        append(np.zeros((4, 4), np.uint8))


WRITERS = {
    "a.png": lambda path: write_png(path, np.zeros((4, 4), np.uint8)),
    "a.csv": lambda path: write_recording(recording_of_events(make_events(10)), path, overwrite=True),
    "a.gif": write_gif,
    "a.h5": lambda path: simulate_video(path.with_name("none.mp4"), path, VideoConfig()),
}


@pytest.mark.parametrize("name", WRITERS)
@pytest.mark.parametrize("kind", ["pipe", "link to a pipe", "folder"])
def test_what_is_no_regular_file_is_not_replaced(name, kind, tmp_path):
    path = tmp_path / name
    if kind == "folder":
        path.mkdir()
    elif kind == "pipe":
        os.mkfifo(path)
    else:
        os.mkfifo(tmp_path / "pipe")
        path.symlink_to(tmp_path / "pipe")
    before = path.lstat()
    with pytest.raises(EtnetError, match="no regular file"):
        WRITERS[name](path)
    assert (path.lstat().st_ino, stat.S_IFMT(path.lstat().st_mode)) == (before.st_ino, stat.S_IFMT(before.st_mode))
    assert len(list(tmp_path.iterdir())) == (2 if kind == "link to a pipe" else 1)

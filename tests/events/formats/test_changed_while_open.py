"""A file that is cut, deleted, grown, replaced or zeroed while it is open: an error that says so, or its own events."""

import os
import subprocess
import sys

import numpy as np
import pytest

from etnet.errors import EtnetError
from etnet.events.open import open_recording

COUNT = 400_000


def dat(path):
    words = np.empty((COUNT, 2), "<u4")
    words[:, 0] = np.arange(COUNT) * 2
    words[:, 1] = (np.arange(COUNT) % 200) | (np.arange(COUNT) % 100) << 14 | (np.arange(COUNT) % 2) << 28
    path.write_bytes(
        b"% Data file containing CD events.\n% Version 2\n% Width 320\n% Height 240\n\x0c\x08" + words.tobytes()
    )


def npy(path):
    events = np.stack([np.arange(COUNT) * 2, np.arange(COUNT) % 200, np.arange(COUNT) % 100, np.arange(COUNT) % 2], 1)
    np.save(path, events.astype(np.float64))


def cut(path):
    with path.open("r+b") as file:
        file.truncate(1000)


def zero(path):
    with path.open("r+b") as file:
        file.seek(200)
        file.write(bytes(path.stat().st_size - 200))


def grow(path):
    with path.open("ab") as file:
        file.write(bytes(8000))


def replace(path):
    other = path.with_name("other")
    other.write_bytes(path.read_bytes()[:5000])
    os.replace(other, path)


@pytest.mark.parametrize("change", [cut, zero, grow, replace, os.unlink])
@pytest.mark.parametrize(("write", "name"), [(dat, "a.dat"), (npy, "a.npy")])
def test_a_file_that_changes_gives_its_events_or_an_error_and_never_others(tmp_path, write, name, change):
    write(tmp_path / name)
    with open_recording(tmp_path / name) as recording:
        before = recording.read(COUNT - 1000, COUNT)
        change(tmp_path / name)
        try:
            after = recording.read(COUNT - 1000, COUNT)
        except EtnetError as error:
            said = str(error)
        else:
            said = "open it again"
            assert np.array_equal(before.t, after.t)
            assert np.array_equal(before.x, after.x)
        assert "open it again" in said


CUT = """
import os, sys
from pathlib import Path
from etnet.errors import EtnetError
from etnet.events.open import open_recording
path = Path(sys.argv[1])
with open_recording(path) as recording:
    os.truncate(path, 500)
    try:
        recording.read(0, recording.num_events)
    except EtnetError as error:
        print(error)
"""


@pytest.mark.parametrize(("write", "name"), [(dat, "a.dat"), (npy, "a.npy")])
def test_a_file_that_is_cut_short_ends_no_process(tmp_path, write, name):
    write(tmp_path / name)
    ended = subprocess.run([sys.executable, "-c", CUT, str(tmp_path / name)], capture_output=True, text=True)
    assert ended.returncode == 0, (ended.returncode, ended.stderr[-500:])

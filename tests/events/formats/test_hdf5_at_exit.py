"""A script may end while a thread still holds an HDF5 file of ours: that is no crash, and what was committed stays."""

import subprocess
import sys

import pytest

from etnet.events.open import open_recording

HELD = """
import sys, threading, time
from pathlib import Path
from etnet.events.formats.hdf5.writing import written_file
from etnet.live.hdf5_writer import Hdf5Writer
from tests.live.sources import make_events
from tests.strategies import SMALL

def written():
    file = written_file(Path(sys.argv[2]))
    rows = file.create_dataset("rows", (0,), "i4", maxshape=(None,), chunks=(1000,))
    rows.resize((500,))
    rows[:] = 3
    return rows if sys.argv[1] == "rows" else file

def recorded():
    writer = Hdf5Writer(Path(sys.argv[2]), SMALL, "held")
    writer.add_events(make_events(500))
    writer.flush()
    writer.add_events(make_events(500))
    writer._store()
    return writer

def hold(made):
    time.sleep(60)

make = recorded if sys.argv[1] == "recorded" else written
threading.Thread(target=hold, args=(make(),), daemon=True).start()
"""


@pytest.mark.parametrize("kind", ["written", "rows", "recorded"])
def test_a_file_that_a_thread_holds_at_the_end_is_no_crash(tmp_path, kind):
    path = tmp_path / "held.h5"
    ended = subprocess.run([sys.executable, "-c", HELD, kind, str(path)], capture_output=True, text=True)
    assert (ended.returncode, ended.stderr) == (0, "")
    if kind == "recorded":
        with open_recording(path) as recording:
            assert recording.num_events >= 500

"""Opening can be given up in every format: between two parts of the file or at its end, and nothing is left of it."""

import gzip
import tempfile

import pytest

from etnet.errors import Cancelled
from etnet.events.open import open_recording
from etnet.events.recording import recording_of_events
from etnet.events.write import write_recording
from tests.events.containers import COUNTS
from tests.real_data import real_file
from tests.strategies import make_events

WRITTEN = ["a.txt", "a.csv", "a.txt.gz", "a.raw", "a.es", "a.aedat4", "a.npz", "a.h5"]
REAL = [name for name, (_, num_events, _) in COUNTS.items() if num_events]


def stop(_):
    raise Cancelled("nobody waits for it")


@pytest.fixture(autouse=True)
def scratch(tmp_path, monkeypatch):
    """Where readers unpack to, which is empty at the end; no index of an earlier opening is at hand."""
    monkeypatch.setenv("ETNET_CACHE", str(tmp_path / "cache"))
    folder = tmp_path / "scratch"
    folder.mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(folder))
    yield folder
    assert not [path for path in folder.rglob("*") if path.is_file()]


@pytest.mark.parametrize("name", WRITTEN)
def test_an_opening_that_nobody_waits_for_any_more_ends(name, tmp_path):
    plain = tmp_path / name.removesuffix(".gz")
    write_recording(recording_of_events(make_events(20_000)), plain)
    if name.endswith(".gz"):
        (tmp_path / name).write_bytes(gzip.compress(plain.read_bytes()))
    with pytest.raises(Cancelled):
        open_recording(tmp_path / name, progress=stop)


@pytest.mark.real
@pytest.mark.parametrize("name", REAL)
def test_an_opening_of_a_real_file_that_nobody_waits_for_any_more_ends(name):
    with pytest.raises(Cancelled):
        open_recording(real_file(name), progress=stop)

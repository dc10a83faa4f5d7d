"""A stated unit of the stamps is followed, or it is told that it is not."""

from __future__ import annotations

import gzip

import h5py
import numpy as np
import pytest

from etnet.events.open import Assumptions, open_recording
from tests.events.formats.test_other_layouts import event_utils_file, forty_bits
from tests.events.formats.test_prophesee import evt2
from tests.events.formats.test_recognition import ROWS, dat
from tests.strategies import make_events

EVENTS = make_events(200)


def mvsec(path):
    with h5py.File(path, "w") as file:
        file["davis/left/events"] = np.stack([EVENTS.x, EVENTS.y, EVENTS.t / 1e6, EVENTS.p], 1)
    return path.read_bytes()


def told(path) -> list[str]:
    with open_recording(path, assume=Assumptions(width=346, height=260, time_unit="ns")) as recording:
        return [remark.text for remark in recording.remarks if "unit" in remark.text]


@pytest.mark.parametrize("name", ["a.dat", "a.raw", "a.bin", "a.hdf5", "a.raw.gz"])
def test_a_format_with_a_unit_of_its_own_says_that_the_stated_one_is_not_used(name, tmp_path):
    path = tmp_path / name
    header = "% Data file containing CD events.\n% Version 2\n"
    contents = {
        "a.dat": lambda: dat(header),
        "a.raw": lambda: evt2(ROWS),
        "a.bin": lambda: forty_bits(EVENTS),
        "a.hdf5": lambda: mvsec(tmp_path / "m.h5"),
        "a.raw.gz": lambda: gzip.compress(evt2(ROWS)),
    }
    path.write_bytes(contents[name]())
    (text,) = told(path)
    assert "ns" in text
    assert "is not used" in text
    with open_recording(path, assume=Assumptions(width=346, height=260)) as recording:
        assert not any("is not used" in remark.text for remark in recording.remarks)


@pytest.mark.parametrize("name", ["a.txt", "a.csv", "a.npy", "a.h5", "evreal"])
def test_where_nothing_names_the_unit_the_stated_one_is_followed_and_that_is_told(name, tmp_path):
    path, columns = tmp_path / name, [EVENTS.t, EVENTS.x, EVENTS.y, EVENTS.p > 0]
    if name == "evreal":
        path.mkdir()
        np.save(path / "events_ts.npy", EVENTS.t)
        np.save(path / "events_xy.npy", np.stack([EVENTS.x, EVENTS.y], 1))
        np.save(path / "events_p.npy", EVENTS.p > 0)
    elif name == "a.h5":
        event_utils_file(path, flow=False)
    elif name == "a.npy":
        np.save(path, np.stack(columns, 1))
    else:
        np.savetxt(path, np.stack(columns, 1), "%d", header="" if name == "a.txt" else "t x y p")
    assert told(path) == ["time unit ns, as stated"]

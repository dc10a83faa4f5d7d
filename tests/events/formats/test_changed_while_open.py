"""A file that is cut, deleted, grown, replaced or zeroed while it is open: an error that says so, or its own events."""

import os
import subprocess
import sys

import h5py
import numpy as np
import pytest

from etnet.errors import EtnetError
from etnet.events.events import Events, Sensor
from etnet.events.formats.prophesee import raw
from etnet.events.open import open_recording
from etnet.events.recording import GroundTruth, recording_of_events
from etnet.events.write import write_recording

COUNT = 400_000
FEW = 60_000


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


SENSOR = Sensor(320, 240)
NUM_FRAMES = 4


def frame(index):
    return np.full((SENSOR.height, SENSOR.width), (1 + index) / 8, np.float32)


def made_up():
    """Events of which each slice is another one, and some pictures."""
    order = np.arange(FEW)
    x, y = (order * 7 % 320).astype(np.uint16), (order * 3 % 240).astype(np.uint16)
    events = Events(x, y, order * 20, np.where(order % 3, 1, -1).astype(np.int8), SENSOR)
    stamps = np.linspace(0, 20 * (FEW - 1), NUM_FRAMES).astype(np.int64)
    return recording_of_events(events, ground_truth=GroundTruth(stamps, frame))


def metavision(path):
    events = made_up().read(0, FEW)
    rows = np.zeros(FEW, [("x", "u2"), ("y", "u2"), ("p", "i2"), ("t", "i8")])
    rows["x"], rows["y"], rows["t"], rows["p"] = events.x, events.y, events.t, events.p > 0
    with h5py.File(path, "w") as file:
        file.attrs["geometry"] = "320x240"
        file["CD/events"] = rows


def matlab(path):
    events = made_up().read(0, FEW)
    with h5py.File(path, "w", userblock_size=512) as file:
        for name, column in {"x": events.x + 1, "y": events.y + 1, "ts": events.t, "p": events.p}.items():
            file[name] = column.reshape(1, -1)
    with path.open("r+b") as file:
        file.write(b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(124) + b"\x00\x02IM")


def plain_hdf5(path):
    events = made_up().read(0, FEW)
    with h5py.File(path, "w") as file:
        file.attrs["sensor_resolution"] = (240, 320)
        for name, column in {"xs": events.x, "ys": events.y, "ts": events.t / 1e6, "ps": events.p > 0}.items():
            file[f"events/{name}"] = column


def layout(name):
    return lambda path: write_recording(made_up(), path, name)


WRITERS = {
    "plain.h5": plain_hdf5, "metavision.h5": metavision, "a.mat": matlab, "event_utils.h5": layout("event_utils"),
    "dsec.h5": layout("dsec"), "mvsec.hdf5": layout("mvsec"), "a.raw": layout("evt3"), "a.es": layout("es"),
    "a.aedat4": layout("aedat4"), "a.npz": layout("npz"), "a.txt": layout("text"), "a.csv": layout("csv"),
    "rpg": layout("rpg"),
}  # fmt: skip
SLICES = ((FEW - 1000, FEW), (5000, 6000), (0, FEW))


def columns_of(recording, part):
    events = recording.read(*part)
    return [column.copy() for column in (events.x, events.y, events.t, events.p)]


@pytest.fixture
def by_index(monkeypatch, tmp_path):
    """RAW files of any size are read by slice, and no index of an earlier one is at hand."""
    monkeypatch.setattr(raw, "INDEXED_BYTES", 0)
    monkeypatch.setenv("ETNET_CACHE", str(tmp_path / "cache"))


@pytest.mark.usefixtures("by_index")
@pytest.mark.parametrize("change", [cut, zero, grow, replace, os.unlink])
@pytest.mark.parametrize("name", list(WRITERS))
def test_a_file_of_any_format_gives_its_events_and_frames_or_an_error_and_never_others(tmp_path, name, change):
    path = tmp_path / name
    WRITERS[name](path)
    with open_recording(path) as recording:
        expected = {part: columns_of(recording, part) for part in SLICES}
    faults = []
    with open_recording(path) as recording:
        truth = recording.ground_truth
        change(path / "events.txt" if path.is_dir() else path)
        for part in SLICES:
            try:
                found = columns_of(recording, part)
            except EtnetError as error:
                faults.append(str(error))
            else:
                assert all(map(np.array_equal, found, expected[part]))
        for index in range(0 if truth is None else len(truth)):
            try:
                picture = truth.read_frame(index)
            except EtnetError as error:
                faults.append(str(error))
            else:
                assert np.abs(picture - frame(index)).max() < 0.01
    for said in faults:
        assert "open it again" in said
        assert "\n" not in said


@pytest.mark.parametrize("change", [cut, zero, grow, replace, os.unlink])
def test_a_picture_in_a_folder_is_the_one_that_was_there_or_an_error(tmp_path, change):
    write_recording(made_up(), tmp_path / "rpg", "rpg")
    with open_recording(tmp_path / "rpg") as recording:
        pictures = sorted((tmp_path / "rpg" / "images").iterdir())
        assert len(pictures) == NUM_FRAMES
        if change is replace:
            os.replace(pictures[2], pictures[1])
        else:
            change(pictures[1])
        with pytest.raises(EtnetError) as told:
            recording.ground_truth.read_frame(1)
        assert "\n" not in str(told.value)
        assert change is os.unlink or "open it again" in str(told.value)
        assert np.abs(recording.ground_truth.read_frame(0) - frame(0)).max() < 0.01

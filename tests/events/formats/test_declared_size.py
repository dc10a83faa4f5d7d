"""A size that is nonsense is refused with what to do; where a person states the size, the recording opens with that."""

from __future__ import annotations

import json

import h5py
import numpy as np
import pytest

from etnet.errors import RecordingError
from etnet.events.open import Assumptions, open_recording
from tests.events.containers import all_events
from tests.strategies import make_events

EVENTS = make_events(300)
ON = (EVENTS.p > 0).astype(np.uint8)
ROWS = "".join(f"{t} {x} {y} {p}\n" for t, x, y, p in zip(EVENTS.t, EVENTS.x, EVENTS.y, ON, strict=True))


def save_npz(path):
    np.savez(path, x=EVENTS.x, y=EVENTS.y, t=EVENTS.t, p=ON, width=np.int64(0), height=np.int64(0))


def save_evreal(path):
    path.mkdir()
    np.save(path / "events_ts.npy", EVENTS.t / 1e6)
    np.save(path / "events_xy.npy", np.stack([EVENTS.x, EVENTS.y], 1))
    np.save(path / "events_p.npy", ON)
    (path / "metadata.json").write_text(json.dumps({"sensor_resolution": [0, 0]}))


def save_text_folder(path):
    path.mkdir()
    (path / "events.txt").write_text("t_us x y p\n" + ROWS)
    (path / "metadata.json").write_text(json.dumps({"sensor_resolution": [0, 0]}))


def save_comment(path):
    path.write_text("# geometry: 0,0\nt_us x y p\n" + ROWS)


def save_sides(path):
    path.write_text("# width: 0\n# height: 12\nt_us x y p\n" + ROWS)


def save_first_line(path):
    path.write_text("0 0\n" + ROWS)


def save_columns(path):
    with h5py.File(path, "w") as file:
        for axis, column in zip("xytp", (EVENTS.x, EVENTS.y, EVENTS.t, ON), strict=True):
            file[f"events/{axis}"] = column
        file["events"].attrs["width"], file["events"].attrs["height"] = 0, 0


def save_event_utils(path):
    with h5py.File(path, "w") as file:
        for axis, column in zip("xytp", (EVENTS.x, EVENTS.y, EVENTS.t / 1e6, ON), strict=True):
            file[f"events/{axis}s"] = column
        file.attrs["sensor_resolution"] = np.array([0, 0])


def save_mvsec(path):
    with h5py.File(path, "w") as file:
        file["davis/left/events"] = np.stack([EVENTS.x, EVENTS.y, EVENTS.t / 1e6, EVENTS.p], 1)
        file.attrs["sensor_resolution"] = np.array([0, 0])


def save_metavision(path):
    records = np.empty(len(EVENTS), [("x", "<u2"), ("y", "<u2"), ("p", "<i2"), ("t", "<i8")])
    records["x"], records["y"], records["p"], records["t"] = EVENTS.x, EVENTS.y, ON, EVENTS.t
    with h5py.File(path, "w") as file:
        file["CD/events"] = records
        file.attrs["geometry"] = "0x0"


def save_raw(path):
    words = np.empty(2 * len(EVENTS), "<u4")
    t, x, y, p = (column.astype(np.uint32) for column in (EVENTS.t, EVENTS.x, EVENTS.y, ON))
    words[::2], words[1::2] = 8 << 28 | t >> 6, p << 28 | (t & 63) << 22 | x << 11 | y
    path.write_bytes(b"% evt 2.0\n% geometry 0x0\n% end\n" + words.tobytes())


def save_dat(path):
    t, x, y, p = (column.astype(np.uint32) for column in (EVENTS.t, EVENTS.x, EVENTS.y, ON))
    header = b"% Data file containing CD events.\n% Version 2\n% Width 0\n% Height 0\n\x0c\x08"
    path.write_bytes(header + np.stack([t, p << 28 | y << 14 | x], 1).astype("<u4").tobytes())


SAVE = {
    "a.npz": save_npz,
    "evreal": save_evreal,
    "text": save_text_folder,
    "comment.csv": save_comment,
    "sides.csv": save_sides,
    "first.txt": save_first_line,
    "columns.h5": save_columns,
    "utils.h5": save_event_utils,
    "mvsec.hdf5": save_mvsec,
    "metavision.h5": save_metavision,
    "a.raw": save_raw,
    "a.dat": save_dat,
}


@pytest.mark.parametrize("name", SAVE)
def test_nonsense_for_a_size_is_refused_with_its_remedy_and_the_remedy_helps(name, tmp_path):
    SAVE[name](tmp_path / name)
    with pytest.raises(RecordingError, match="--assume width=…,height=…") as refusal:
        open_recording(tmp_path / name)
    assert "\n" not in str(refusal.value)
    with open_recording(tmp_path / name, assume=Assumptions(width=20, height=12)) as recording:
        found = all_events(recording)
        assert str(recording.sensor) == "20×12"
        np.testing.assert_array_equal(found.x, EVENTS.x)
        np.testing.assert_array_equal(found.t - found.t[0], EVENTS.t - EVENTS.t[0])

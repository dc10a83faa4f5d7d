"""Motion and triggers that a file holds beside its events and that are not read are counted and told."""

from __future__ import annotations

import struct

import h5py
import numpy as np

from etnet.events.open import open_recording
from tests.strategies import make_events

EVENTS = make_events(50)


def told(path) -> str:
    with open_recording(path) as recording:
        assert recording.num_events == 50
        return "\n".join(map(str, recording.remarks))


def test_of_mvsec_the_motion(tmp_path):
    with h5py.File(tmp_path / "a.hdf5", "w") as file:
        file["davis/left/events"] = np.stack([EVENTS.x, EVENTS.y, EVENTS.t / 1e6, EVENTS.p], 1)
    assert "motion" not in told(tmp_path / "a.hdf5")
    with h5py.File(tmp_path / "a.hdf5", "a") as file:
        file["davis/left/imu"] = np.zeros((7, 6))
    assert "7 samples of motion" in told(tmp_path / "a.hdf5")


def test_of_metavision_hdf5_the_triggers(tmp_path):
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file.attrs["geometry"] = "20x12"
        columns = np.empty(50, [("x", "u2"), ("y", "u2"), ("p", "i2"), ("t", "i8")])
        for axis in "xyt":
            columns[axis] = getattr(EVENTS, axis)
        columns["p"] = EVENTS.p > 0
        file["CD/events"] = columns
        file["EXT_TRIGGER/events"] = np.zeros(3, [("p", "i2"), ("t", "i8"), ("id", "i2")])
    assert "3 triggers" in told(tmp_path / "a.h5")


def test_of_aedat_3_motion_and_triggers_each(tmp_path):
    def packet(kind: int, size: int, content: bytes) -> bytes:
        number = len(content) // size
        return struct.pack("<hhiiiiii", kind, 1, size, 4, 0, number, number, number) + content

    pixels = (EVENTS.x.astype("<u4") << 17) | (EVENTS.y.astype("<u4") << 2) | (EVENTS.p > 0) << 1 | 1
    events = np.stack([pixels, EVENTS.t], 1).astype("<u4").tobytes()
    head = b"#!AER-DAT3.1\r\n#Format: RAW\r\n#Source 1: DAVIS240C\r\n#!END-HEADER\r\n"
    others = packet(0, 8, bytes(16)) + packet(3, 36, bytes(5 * 36)) + packet(9, 8, bytes(8))
    (tmp_path / "a.aedat").write_bytes(head + packet(1, 8, events) + others)
    said = told(tmp_path / "a.aedat")
    assert "5 samples of motion" in said
    assert "2 special events (clock resets, frame marks)" in said
    assert "1 other sample" in said

"""A small file takes little memory, whatever it declares or holds beside the events."""

from __future__ import annotations

import struct
import time
import tracemalloc
import zipfile
import zlib

import h5py
import numpy as np
import pytest
import scipy.io

from etnet.errors import RecordingError
from etnet.events.cache import MEMORY_CAP
from etnet.events.formats.arrays import matlab
from etnet.events.open import Assumptions, open_recording
from tests.events.containers import all_events, assert_same_events
from tests.strategies import make_events

SENSOR = Assumptions(width=20, height=12)
EVENTS = make_events(200)
FEW = 48 << 20
"""Bytes; what is declared in these tests is many times that."""
LOADED = FEW + MEMORY_CAP
"""The same, of formats that are decoded at once: that takes one block of fixed size, whatever a file holds."""


def columns(events=EVENTS) -> dict[str, np.ndarray]:
    return {"x": events.x, "y": events.y, "ts": events.t, "p": events.p}


@pytest.fixture(name="peak")
def counted_memory():
    tracemalloc.start()
    yield lambda: tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()


def save_v73(path, tree: dict[str, np.ndarray], empty: dict[str, int] | None = None):
    """`empty`: columns of so many numbers that are declared and never written."""
    with h5py.File(path, "w", userblock_size=512) as file:
        for name, column in tree.items():
            file[name] = column.reshape(1, -1)
        for name, count in (empty or {}).items():
            file.create_dataset(name, (1, count), "f8", chunks=(1, 1 << 16), compression="gzip")
    with path.open("r+b") as file:
        file.write(b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(124) + b"\x00\x02IM")
    return path


def test_what_stands_beside_the_columns_of_a_matlab_file_is_not_loaded(tmp_path, peak):
    tree = {f"TD/{name}": column for name, column in columns().items()}
    path = save_v73(tmp_path / "a.mat", tree, {"other": 20_000_000, "TD/xs": 20_000_000, "TD/more": 20_000_000})
    with open_recording(path, assume=SENSOR) as recording:
        assert_same_events(all_events(recording), EVENTS)
    assert peak() < FEW


def test_a_matlab_file_is_read_by_slice(tmp_path, peak):
    path = save_v73(tmp_path / "a.mat", columns(make_events(3_000_000)))
    tracemalloc.reset_peak()
    with open_recording(path, assume=SENSOR) as recording:
        assert recording.num_events == 3_000_000
        assert len(recording.read(1_000_000, 1_000_100)) == 100
    assert peak() < path.stat().st_size / 2


def test_columns_that_a_matlab_file_only_declares_are_a_bomb(tmp_path):
    path = save_v73(tmp_path / "a.mat", {}, dict.fromkeys(["x", "y", "ts", "p"], 10**12))
    with pytest.raises(RecordingError, match="bomb"):
        open_recording(path)


def test_a_v5_file_that_unpacks_to_too_much_is_refused(tmp_path, monkeypatch):
    path = tmp_path / "a.mat"
    scipy.io.savemat(path, {name: np.zeros(8_000_000) for name in columns()}, do_compression=True)
    monkeypatch.setattr(matlab, "FREE_SIZE", 1 << 20)
    monkeypatch.setattr(matlab, "MAX_RATIO", 1)
    with pytest.raises(RecordingError, match="memory"):
        open_recording(path)


def test_variables_beside_the_columns_of_a_v5_file_are_not_read(tmp_path, monkeypatch):
    path = tmp_path / "a.mat"
    tree = {"other": np.zeros(8_000_000), "TD": {name: column.astype(float) for name, column in columns().items()}}
    scipy.io.savemat(path, tree)
    monkeypatch.setattr(matlab, "FREE_SIZE", 24 << 20)
    monkeypatch.setattr(matlab, "MAX_RATIO", 0)
    with open_recording(path, assume=SENSOR) as recording:
        assert_same_events(all_events(recording), EVENTS)


def test_of_an_npz_only_the_columns_are_unpacked(tmp_path, peak):
    many = np.zeros(10_000_000)
    many[::5000] = np.arange(2000)  # else it is a bomb
    path = tmp_path / "a.npz"
    np.savez_compressed(path, **columns(), xs=many, events_x=many, on=many)
    del many
    tracemalloc.reset_peak()
    with open_recording(path, assume=SENSOR) as recording:
        assert_same_events(all_events(recording), EVENTS)
    assert peak() < FEW


def test_frames_larger_than_any_camera_has_are_left_out_and_the_events_kept(tmp_path):
    path = tmp_path / "a.h5"
    with h5py.File(path, "w") as file:
        for axis, column in zip(("xs", "ys", "ts", "ps"), columns().values(), strict=True):
            file[f"events/{axis}"] = column
        image = file.create_dataset("images/image000000000", (9000, 9000), "u1", chunks=(500, 500), compression="gzip")
        image.attrs["timestamp"] = 0.0
    with open_recording(path, assume=SENSOR) as recording:
        assert_same_events(all_events(recording), EVENTS)
        assert recording.ground_truth is None
        told = [remark.text for remark in recording.remarks if "frames" in remark.text]
    assert len(told) == 1
    assert "9000 × 9000 pixels" in told[0]
    assert "--max-pixels" in told[0]


@pytest.mark.parametrize("name", ["t_offset", "davis/left/image_raw_ts"])
def test_small_datasets_that_declare_gigabytes_cost_nothing(name, tmp_path, peak):
    path = tmp_path / "a.h5"
    with h5py.File(path, "w") as file:
        file.create_dataset(name, (10**9,), "i8", chunks=(1 << 16,), compression="gzip")
        if name == "t_offset":
            for axis, column in zip("xytp", columns().values(), strict=True):
                file[f"events/{axis}"] = column
        else:
            file["davis/left/events"] = np.stack([EVENTS.x, EVENTS.y, EVENTS.t / 1e6, EVENTS.p], 1)
            file.create_dataset("davis/left/image_raw", (10**9, 12, 20), "u1", chunks=(1, 12, 20), compression="gzip")
    tracemalloc.reset_peak()
    if name == "t_offset":
        with pytest.raises(RecordingError, match="t_offset"):
            open_recording(path)
    else:
        with open_recording(path, assume=SENSOR) as recording:
            assert recording.ground_truth is None
            assert any("1,000,000,000 frames" in remark.text for remark in recording.remarks)
    assert peak() < FEW


@pytest.mark.parametrize("content", [b"65535 65535\n0.1 1 2 0\n", b"%geometry:65535,65535\n1,2,0,100\n"])
def test_a_text_that_declares_a_vast_sensor_is_refused(content, tmp_path, peak):
    (tmp_path / "a.txt").write_bytes(content)
    with pytest.raises(RecordingError, match="--max-pixels"):
        open_recording(tmp_path / "a.txt")
    with open_recording(tmp_path / "a.txt", assume=Assumptions(max_pixels=1 << 32)) as recording:
        assert recording.num_events == 1
    assert peak() < 512 << 20


VAST = {
    "es": b"Event Stream\x02\x00\x00\x01" + struct.pack("<HH", 65_535, 65_535) + b"\x03" + struct.pack("<HH", 1, 2),
    "16384": (16_384, 16_384),
    "65536": (65_536, 65_536),
    "geometry": "65536x65536",
}


@pytest.mark.parametrize("kind", list(VAST))
def test_a_file_that_declares_a_vast_sensor_is_refused_before_it_costs_anything(kind, tmp_path, peak):
    path, said = tmp_path / ("a.es" if kind == "es" else "a.h5"), VAST[kind]
    if isinstance(said, bytes):
        path.write_bytes(said)
    else:
        with h5py.File(path, "w") as file:
            if isinstance(said, str):
                file.attrs["geometry"] = said
                rows = np.zeros(200, [("x", "u2"), ("y", "u2"), ("p", "i2"), ("t", "i8")])
                for name, column in {"x": EVENTS.x, "y": EVENTS.y, "t": EVENTS.t, "p": EVENTS.p > 0}.items():
                    rows[name] = column
                file["CD/events"] = rows
            else:
                file.attrs["sensor_resolution"] = said
                for name, column in zip(("xs", "ys", "ts", "ps"), columns().values(), strict=True):
                    file[f"events/{name}"] = column
    tracemalloc.reset_peak()
    began = time.process_time()
    with pytest.raises(RecordingError, match="--max-pixels"):
        open_recording(path)
    assert time.process_time() - began < 5
    assert peak() < (LOADED if kind == "es" else FEW)
    with open_recording(path, assume=Assumptions(max_pixels=1 << 32)) as recording:
        assert recording.num_events == (1 if kind == "es" else 200)
    with open_recording(path, assume=Assumptions(width=24, height=65_535 if kind == "es" else 20)) as recording:
        assert recording.sensor.width == 24


def test_a_chunk_that_unpacks_to_gigabytes_is_refused_by_what_it_declares(tmp_path, peak):
    path = tmp_path / "a.h5"
    with h5py.File(path, "w") as file:
        for name, column in zip(("xs", "ys", "ps"), (EVENTS.x, EVENTS.y, EVENTS.p > 0), strict=True):
            file[f"events/{name}"] = column
        packed = file.create_dataset("events/ts", (200,), "f8", maxshape=(None,), chunks=(3 << 27,), compression="gzip")
        packed.id.write_direct_chunk((0,), zlib.compress(bytes(1 << 20)))
    tracemalloc.reset_peak()
    began = time.process_time()
    with pytest.raises(RecordingError, match=r"a chunk of events/ts unpacks to 3,221,225,472 bytes"):
        open_recording(path)
    assert time.process_time() - began < 5
    assert peak() < FEW


def png_header(width: int, height: int, bits: int) -> bytes:
    """The beginning of a grey picture; its pixels are never asked for."""
    return b"\x89PNG\r\n\x1a\n" + struct.pack(">I4sIIBBBBB", 13, b"IHDR", width, height, bits, 0, 0, 0, 0) + bytes(64)


@pytest.mark.parametrize(("side", "bits"), [(11_000, 16), (32_000, 8)])
def test_a_vast_picture_in_a_zip_is_left_out_by_its_header_and_the_events_kept(side, bits, tmp_path, peak):
    rows = "".join(
        f"{t / 1e6:.6f} {x} {y} {int(p > 0)}\n"
        for x, y, t, p in zip(EVENTS.x, EVENTS.y, EVENTS.t, EVENTS.p, strict=True)
    )
    with zipfile.ZipFile(tmp_path / "a.zip", "w") as archive:
        archive.writestr("events.txt", rows)
        archive.writestr("images.txt", "0.0 images/frame_0.png\n")
        archive.writestr("images/frame_0.png", png_header(side, side, bits))
    tracemalloc.reset_peak()
    began = time.process_time()
    with open_recording(tmp_path / "a.zip", assume=SENSOR) as recording:
        assert_same_events(all_events(recording), EVENTS)
        assert recording.ground_truth is None
        assert any(f"{side} × {side} pixels" in remark.text for remark in recording.remarks)
    assert time.process_time() - began < 5
    assert peak() < LOADED

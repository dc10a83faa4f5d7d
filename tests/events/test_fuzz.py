"""Whatever is done to a file of any format, it opens or is refused in one line; nothing else comes out."""

from __future__ import annotations

import gzip
import io
import shutil
import zipfile

import cv2
import h5py
import hdf5plugin
import numpy as np
import pytest
import scipy.io

from etnet.errors import RecordingError
from etnet.events.formats.prophesee import raw as prophesee
from etnet.events.recording import recording_of_events
from etnet.events.write import write_recording
from tests.events.formats.test_camera_samples import global_shutter, picture, saved, with_events
from tests.events.formats.test_ros_containers import killed_bag, packets_of_evt21
from tests.events.formats.test_ros_pictures import EVENTS as ROS_EVENTS
from tests.events.formats.test_ros_pictures import grey, packed_grey, record
from tests.events.formats.test_triggers import EDGES, triggered
from tests.events.fuzz import fuzz, is_ours
from tests.real_data import real_file
from tests.strategies import make_events

ROUNDS = 12
SLOW_ROUNDS = 400

WRITTEN = ("event_utils.h5", "dsec.hdf5", "aedat4.aedat4", "evt3.raw", "csv.csv", "npz.npz")
MADE = (
    *("mvsec.hdf5", "v5.mat", "text.txt", "text.txt.gz", "table.npy", "davis.aedat"),
    *(
        "columns.h5",
        "bitshuffle.h5",
        "bzip2.h5",
        "records.h5",
        "frames.h5",
        "records.npz",
        "xypt.npz",
        "pandas.csv",
        "metavision.csv",
    ),
    *("pictures.db3", "killed.active", "triggers.raw", "packets.mcap"),
    *("pieces.zip", "wraps.npz", "unnamed.npz", "sides.npz", "network.h5", "wraps_ns.csv"),
)
REAL = (
    "aedat4/davis346_street_0.17s.aedat4",
    "aedat4/test_data_gray16.aedat4",
    "prophesee/dat_ncars_sample.dat",
    "bin/nmnist_digit4.bin",
    "aedat2/dvs128_checkerboard_flash.aedat",
    "derived/slider_depth_0.3s_dvs_msgs.bag",
    "derived/slider_depth_0.3s_v31.aedat",
    "derived/davis346_aprilgrid_0.5s.es",
    "derived/davis346_aprilgrid_0.3s_evt21.raw",
    "derived/davis346_aprilgrid_0.5s_evt2.raw",
    "derived/dvxplorer_lite_face1_metavision_ecf.h5",
    "derived/slider_depth_0.4s_evreal.zip",
    "rosbag/event_camera_msgs_evt3_person_2.1s.bag",
    "rosbag/event_camera_msgs_libcaer_cmp_aprilgrid_1.0s.mcap",
)


def seed_file(name: str, folder):
    """A sound file of the format, made up."""
    events = make_events(3000)
    path = folder / name
    rows = "".join(
        f"{t / 1e6:.9f} {x} {y} {p:d}\n" for t, x, y, p in zip(events.t, events.x, events.y, events.p > 0, strict=True)
    )
    if name in WRITTEN:
        write_recording(recording_of_events(events), path, name.split(".")[0])
    elif name == "mvsec.hdf5":
        with h5py.File(path, "w") as file:
            table = np.stack([events.x, events.y, events.t / 1e6, events.p], 1)
            file.create_dataset("davis/left/events", data=table, chunks=(500, 4), compression="gzip")
            file["davis/left/image_raw"], file["davis/left/image_raw_ts"] = np.zeros((2, 12, 20), "u1"), [0.0, 0.01]
    elif name == "v5.mat":
        scipy.io.savemat(path, {"TD": {axis: getattr(events, axis).astype(float) for axis in "xytp"}})
    elif name == "text.txt":
        path.write_text("20 12\n" + rows)
    elif name == "text.txt.gz":
        path.write_bytes(gzip.compress(rows.encode()))
    elif name == "pieces.zip":
        save_pieces(path, events)
    elif name in MADE[-5:]:
        save_odd(path, events)
    elif name.endswith((".h5", ".npz", ".csv")):
        save_found(path, events)
    elif name == "davis.aedat":
        saved(path, with_events(global_shutter([picture(np.random.default_rng(0))]))[0])
    elif name == "pictures.db3":
        kinds = [("/dvs/image_raw", "raw", grey(9)), ("/dvs/image_raw/compressed", "packed", packed_grey(9))]
        record(path, [("/dvs/events", "events", ROS_EVENTS), *kinds])
    elif name == "killed.active":
        killed_bag(path)
    elif name == "triggers.raw":
        write_recording(triggered(EDGES, events), path)
    elif name == "packets.mcap":
        packets_of_evt21(path)
    else:
        np.save(path, np.stack([events.t, events.x, events.y, events.p], 1))
    return path


def save_pieces(path, events):
    """Three pieces in a zip, with a picture and its stamp."""
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        for number in range(3):
            part, piece = slice(number * 1000, (number + 1) * 1000), io.BytesIO()
            np.savez(piece, **{axis: getattr(events, axis)[part] for axis in "xytp"})
            archive.writestr(f"seq/events/{number:06d}.npz", piece.getvalue())
        archive.writestr("seq/images/0.png", cv2.imencode(".png", np.zeros((12, 20), np.uint8))[1].tobytes())
        archive.writestr("seq/images/timestamps.txt", "100")


def save_odd(path, events):
    """Stamps that wrap, columns whose names say little, pictures with their colours first."""
    x, y, t, p = (getattr(events, axis) for axis in "xytp")
    if path.name == "wraps.npz":
        np.savez(path, x=x, y=y, t=((t + (1 << 32) - 9_000) % (1 << 32)).astype("u4"), p=p)
    elif path.name == "unnamed.npz":
        np.savez(path, x, y, t, p)
    elif path.name == "sides.npz":
        np.savez(path, left_x=x, left_y=y, left_t=t, left_p=p, right_x=x, right_y=y, right_t=t, right_p=p)
    elif path.name == "wraps_ns.csv":
        rows = zip(((t * 1000 + (1 << 32) - 9_000_000) % (1 << 32)).tolist(), x, y, p > 0, strict=True)
        path.write_text(
            "\tt_ns\tx\ty\ton\n" + "".join(f"{i}\t{a}\t{b}\t{c}\t{d}\n" for i, (a, b, c, d) in enumerate(rows))
        )
    else:
        with h5py.File(path, "w") as file:
            for axis, column in zip("xytp", (x, y, t, p), strict=True):
                file[f"events/{axis}"] = column
            file["frames"], file["frames_ts"] = np.full((3, 3, 12, 20), -0.9, "f4"), [0, 20_000, 40_000]


def save_found(path, events):
    """Events that have to be found, in HDF5, npz and text."""
    columns = {axis: getattr(events, axis) for axis in "xytp"}
    records = np.rec.fromarrays(list(columns.values()), names=list(columns))
    if path.suffix == ".npz":
        np.savez_compressed(path, records if "records" in path.name else np.stack([columns[k] for k in "xypt"], 1))
    elif path.suffix == ".csv":
        is_pandas = path.name == "pandas.csv"
        rows = zip(*(columns[axis].tolist() for axis in "xypt"), strict=True)
        lines = (f"{i},{x},{y},{p > 0},{t}" if is_pandas else f"{x},{y},{p},{t}" for i, (x, y, p, t) in enumerate(rows))
        path.write_text((",x,y,p,t_us\n" if is_pandas else "%geometry:20,12\n") + "\n".join(lines))
    else:
        with h5py.File(path, "w") as file:
            if path.name == "records.h5":
                file["a/events"] = records
            else:
                packed = {"bitshuffle": hdf5plugin.Bitshuffle(), "bzip2": hdf5plugin.BZip2()}
                how = packed.get(path.stem, {"compression": "gzip"})
                for axis, column in columns.items():
                    file.create_dataset(f"dvs/left/{axis}", data=column, chunks=(500,), **how)
                file["dvs/left/calib/resolution"] = [20, 12]
            if path.name == "frames.h5":
                file["frame"], file["frame_ts"] = np.full((3, 12, 20), 900, "u2"), [0, 20_000, 40_000]


@pytest.mark.parametrize("name", WRITTEN + MADE)
def test_damage_to_made_files_is_refused_or_read(name, tmp_path):
    seed = seed_file(name, tmp_path)
    (tmp_path / "damaged").mkdir()
    rounds = rounds_of(name, ROUNDS)
    assert sum(fuzz(seed, tmp_path / "damaged", rounds, np.random.default_rng(0)).values()) == rounds


def rounds_of(name: str, rounds: int) -> int:
    """Fewer for v5 MATLAB files, each of which costs a process."""
    return max(4, rounds // 20) if name == "v5.mat" else rounds


@pytest.mark.real
@pytest.mark.parametrize("name", REAL)
def test_damage_to_real_files_is_refused_or_read(name, tmp_path):
    assert sum(fuzz(real_file(name), tmp_path, ROUNDS // 2, np.random.default_rng(0)).values()) == ROUNDS // 2


@pytest.mark.real
@pytest.mark.parametrize("name", [name for name in REAL if name.endswith("evt2.raw")] + ["evt3.raw"])
def test_damage_to_indexed_files_is_refused_or_read(name, tmp_path, monkeypatch):
    monkeypatch.setenv("ETNET_CACHE", str(tmp_path / "cache"))
    monkeypatch.setattr(prophesee, "INDEXED_BYTES", 0)
    seed = real_file(name) if name in REAL else seed_file(name, tmp_path)
    (tmp_path / "damaged").mkdir()
    assert sum(fuzz(seed, tmp_path / "damaged", ROUNDS, np.random.default_rng(0)).values()) == ROUNDS


def test_a_slip_of_ours_is_told_from_a_library_that_asserts():
    with pytest.raises(RecordingError) as ours:
        write_recording(recording_of_events(make_events(3)), "a.xyz")
    with pytest.raises(ValueError) as theirs:
        np.array([1, 2]).reshape(3)
    with pytest.raises(ValueError) as of_scipy:
        scipy.io.loadmat(io.BytesIO(b"no MATLAB file" * 100))
    assert is_ours(ours.value)
    assert not is_ours(of_scipy.value)
    assert not is_ours(theirs.value)


@pytest.mark.slow
@pytest.mark.real
@pytest.mark.parametrize("name", WRITTEN + MADE + REAL)
def test_much_damage_is_refused_or_read(name, tmp_path):
    seed = real_file(name) if name in REAL else seed_file(name, tmp_path)
    (tmp_path / "damaged").mkdir()
    entropy = np.random.SeedSequence().entropy
    print(f"the damage comes from default_rng({entropy})")
    rounds = rounds_of(name, SLOW_ROUNDS)
    counts = fuzz(seed, tmp_path / "damaged", rounds, np.random.default_rng(entropy))
    shutil.rmtree(tmp_path / "damaged", ignore_errors=True)
    assert sum(counts.values()) == rounds

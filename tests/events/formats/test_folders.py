"""Folders and archives: numbered pieces are one recording, one recording among companions opens, several are named."""

from __future__ import annotations

import zipfile

import cv2
import h5py
import numpy as np
import pytest

from etnet.errors import RecordingError
from etnet.events.formats import bounds
from etnet.events.open import Assumptions, open_recording
from tests.events.containers import all_events, assert_same_events
from tests.strategies import make_events

EVENTS = make_events(3000)
SIZE = Assumptions(width=20, height=12)


def said(recording) -> str:
    return "\n".join(map(str, recording.remarks))


def save_pieces(folder, count=3, names=("x", "y", "t", "p"), scale=1, form="{:06d}.npz", pixel=1):
    folder.mkdir(parents=True, exist_ok=True)
    for i, part in enumerate(np.array_split(np.arange(len(EVENTS)), count)):
        x, y, t, p = names
        columns = {x: EVENTS.x[part] * pixel, y: EVENTS.y[part] * pixel, t: EVENTS.t[part] * scale}
        columns[p] = (EVENTS.p[part] > 0).astype("u1")
        if form.endswith("npz"):
            np.savez(folder / form.format(i), **columns)
        else:
            np.save(folder / form.format(i), np.stack([columns[k].astype("i8") for k in (t, x, y, p)], 1))
    return folder


@pytest.mark.parametrize("form", ["{:06d}.npz", "events_{}.npz", "{}.npy", "{:04d}.npz"])
@pytest.mark.parametrize("count", [2, 12])
def test_numbered_pieces_are_one_recording_in_the_order_of_their_numbers(form, count, tmp_path):
    folder = save_pieces(tmp_path / "events", count, form=form)
    with open_recording(folder, assume=SIZE) as recording:
        assert_same_events(all_events(recording), EVENTS)
        assert f"{count} numbered files in the folder are one recording" in said(recording)


def save_piece(path, part, first=0):
    """One piece as its suffix says, in a layout that people have."""
    x, y, t, p = EVENTS.x[part], EVENTS.y[part], EVENTS.t[part], (EVENTS.p[part] > 0).astype("u1")
    path.parent.mkdir(exist_ok=True)
    if path.suffix == ".csv":
        path.write_text("x,y,t,p\n" + "".join(f"{a},{b},{c},{d}\n" for a, b, c, d in zip(x, y, t, p, strict=True)))
    elif path.suffix == ".txt":
        rows = zip(t / 1e6, x, y, p, strict=True)
        path.write_text("".join(f"{t:.6f} {x} {y} {p}\n" for t, x, y, p in rows))
    else:
        with h5py.File(path, "w") as file:
            file["events/x"], file["events/y"], file["events/p"] = x, y, p
            if path.suffix == ".hdf5":  # as DSEC: each from 0 on
                file["events/t"], file["t_offset"] = (t - t[0]).astype("u4"), np.int64(t[0])
                file["ms_to_idx"] = np.zeros(1, "u8")
            else:
                file["events/t"] = t
            file.attrs["sensor_resolution"] = [12, 20]
            for i in range(2):
                image = file.create_dataset(f"images/image{i:09d}", data=np.full((12, 20), first + i, "u1"))
                image.attrs["timestamp"] = int(t[0]) + i


PARTS = np.array_split(np.arange(len(EVENTS)), 12)


@pytest.mark.parametrize("suffix", [".h5", ".hdf5", ".csv", ".txt"])
@pytest.mark.parametrize("is_packed", [False, True])
def test_numbered_pieces_of_any_container_are_one_recording(suffix, is_packed, tmp_path):
    for number, part in enumerate(PARTS):
        save_piece(tmp_path / "seq" / f"events_{number}{suffix}", part, 10 * number)
    path = tmp_path / "seq"
    if is_packed:
        path = tmp_path / "seq.zip"
        with zipfile.ZipFile(path, "w") as archive:
            for piece in (tmp_path / "seq").iterdir():
                archive.write(piece, f"seq/{piece.name}")
    with open_recording(path, assume=SIZE) as recording:
        assert_same_events(all_events(recording), EVENTS)
        np.testing.assert_array_equal(all_events(recording).t, EVENTS.t)
        assert "12 numbered files" in said(recording)
        if suffix in (".csv", ".txt"):
            return
        if is_packed:
            assert "24 pictures in the pieces are not shown" in said(recording)
            return
        truth = recording.ground_truth
        assert truth.stamps.tolist() == [int(EVENTS.t[part[0]]) + i for part in PARTS for i in range(2)]
        assert [round(float(truth.read_frame(i)[0, 0]) * 255) for i in (0, 1, 22, 23)] == [0, 1, 110, 111]


@pytest.mark.parametrize("suffix", [".h5", ".csv"])
def test_numbered_files_of_one_time_are_several_recordings(suffix, tmp_path):
    for number in range(3):
        save_piece(tmp_path / f"run_{number}{suffix}", np.arange(len(EVENTS)))
    with pytest.raises(RecordingError, match=r"holds run_0.*run_1.*name one of them"):
        open_recording(tmp_path)


def test_numbered_cameras_are_no_pieces(tmp_path):
    for number, part in enumerate(np.array_split(np.arange(len(EVENTS)), 2)):
        save_piece(tmp_path / f"cam{number}.h5", part)
    with pytest.raises(RecordingError, match=r"holds cam0\.h5, cam1\.h5; name one of them"):
        open_recording(tmp_path)


@pytest.mark.parametrize("suffix", [".h5", ".csv"])
def test_a_piece_of_another_kind_is_named(suffix, tmp_path):
    for number, part in enumerate(PARTS[:3]):
        save_piece(tmp_path / f"events_{number}{suffix}", part)
    odd = tmp_path / f"events_3{suffix}"
    odd.write_text("a,b\n1,2\n") if suffix == ".csv" else h5py.File(odd, "w").close()
    with pytest.raises(RecordingError, match=r"events_3\.(h5|csv) has other columns"):
        open_recording(tmp_path)


def test_pieces_whose_numbers_need_more_bytes_later_lose_none(tmp_path):
    for number, (pixel, kind) in enumerate(((200, "u1"), (300, "u2"))):
        columns = {"x": np.full(9, pixel, kind), "y": np.full(9, 7, kind), "p": np.ones(9, "u1")}
        np.savez(tmp_path / f"{number}.npz", **columns, t=100 * number + np.arange(9))
    with open_recording(tmp_path) as recording:
        assert all_events(recording).x.tolist() == [200] * 9 + [300] * 9


def test_pieces_in_nanoseconds_are_judged_as_a_whole(tmp_path):
    rng = np.random.default_rng(0)
    (tmp_path / "events").mkdir()
    t = np.sort(rng.integers(0, 2_999_000_000, 3000))
    for i, part in enumerate(np.array_split(np.arange(3000), 3)):
        pixels = {"x": rng.integers(0, 240, len(part)), "y": rng.integers(0, 180, len(part))}
        np.savez(tmp_path / "events" / f"{i}.npz", **pixels, t=t[part], p=rng.integers(0, 2, len(part)))
    with open_recording(tmp_path) as recording:
        assert recording.span.duration == pytest.approx((t[-1] - t[0]) / 1000, abs=1)


def test_pieces_with_other_columns_are_refused(tmp_path):
    folder = save_pieces(tmp_path / "events")
    np.savez(folder / "000003.npz", a=np.zeros(3))
    with pytest.raises(RecordingError, match=r"000003\.npz has other columns"):
        open_recording(folder)


def test_a_piece_that_is_too_large_to_be_read_whole_tells_the_remedy(tmp_path, monkeypatch):
    save_pieces(tmp_path / "events", form="events_{}.npz")
    monkeypatch.setattr("etnet.events.formats.archive.MAX_SMALL_FILE", 1000)
    monkeypatch.setattr(bounds, "_allowed", 0)
    with pytest.raises(RecordingError, match=r"events_0\.npz: .*\.npy has \d+ bytes; .*--unpack-limit MB"):
        open_recording(tmp_path / "events", assume=SIZE)
    bounds.allow_unpacking(1 << 20)
    with open_recording(tmp_path / "events", assume=SIZE) as recording:
        assert_same_events(all_events(recording), EVENTS)


def test_numbered_recordings_that_begin_anew_are_not_joined(tmp_path):
    for i in range(3):
        np.savez(tmp_path / f"sample_{i}.npz", **{axis: getattr(EVENTS, axis) for axis in "xytp"})
    with pytest.raises(RecordingError, match=r"sample_1\.npz begins before.*name one of them"):
        open_recording(tmp_path)


def save_pictures(folder, shape, stamps=None):
    folder.mkdir(parents=True)
    for i in range(4):
        assert cv2.imwrite(str(folder / f"{i:06d}.png"), np.full(shape, 50 * i, np.uint8))
    (folder / "timestamp.txt").write_text("".join(f"{t}\n" for t in stamps))


def test_a_bs_ergb_folder_has_32nds_of_pixels_and_its_pictures(tmp_path):
    save_pieces(tmp_path / "events", names=("x", "y", "timestamp", "polarity"), pixel=np.uint16(320))
    save_pictures(tmp_path / "images", (120, 200), [0, 10_000, 20_000, 30_000])
    with open_recording(tmp_path) as recording:
        found = all_events(recording)
        np.testing.assert_array_equal(found.x, EVENTS.x * 10)
        assert "32nds of a pixel" in said(recording)
        assert recording.ground_truth.stamps.tolist() == [0, 10_000, 20_000, 30_000]
    with pytest.raises(RecordingError, match="--pixels 32nds"):
        open_recording(tmp_path / "events", assume=Assumptions(width=200, height=120))
    with open_recording(tmp_path / "events", assume=Assumptions(width=200, height=120, pixels="32nds")) as recording:
        np.testing.assert_array_equal(all_events(recording).y, EVENTS.y * 10)


def test_an_hs_ergb_folder_has_its_pictures_in_a_folder_of_any_name(tmp_path):
    save_pieces(tmp_path / "events_aligned", names=("x", "y", "timestamp", "polarity"))
    save_pictures(tmp_path / "images_corrected", (12, 20), [0, 10_000, 20_000, 30_000])
    with open_recording(tmp_path) as recording:
        assert_same_events(all_events(recording), EVENTS)
        assert len(recording.ground_truth) == 4
        assert "4 pictures in images_corrected" in said(recording)


ROWS = list(zip(EVENTS.t.tolist(), EVENTS.x.tolist(), EVENTS.y.tolist(), (EVENTS.p > 0).tolist(), strict=True))


def save_one(folder, kind: str) -> str:
    folder.mkdir(parents=True, exist_ok=True)
    if kind == "dat":
        words = np.array([(t, x | y << 14 | int(p) << 28) for t, x, y, p in ROWS], "<u4")
        head = b"% Data file containing CD events.\n% Version 2\n% Width 20\n% Height 12\n\x0c\x08"
        (folder / "rec_td.dat").write_bytes(head + words.tobytes())
        return "rec_td.dat"
    if kind == "h5":
        with h5py.File(folder / "events.h5", "w") as file:
            for axis in "xytp":
                file[f"events/{axis}"] = getattr(EVENTS, axis)
        return "events.h5"
    if kind == "npz":
        np.savez(folder / "recording.npz", **{axis: getattr(EVENTS, axis) for axis in "xytp"})
        return "recording.npz"
    (folder / "my_events.csv").write_text("t,x,y,p\n" + "".join(f"{t},{x},{y},{p:d}\n" for t, x, y, p in ROWS))
    return "my_events.csv"


def save_companions(folder):
    np.save(folder / "rec_bbox.npy", np.zeros(3, [("t", "u8"), ("x", "f4"), ("w", "f4"), ("h", "f4")]))
    np.savez(folder / "poses.npz", position=np.zeros((5, 3)))
    (folder / "calib.txt").write_text("1 2 3 4 5 6 7 8 9\n")
    (folder / "README.txt").write_text("Recorded at noon.\n")
    (folder / "poses.csv").write_text("t,px,py,pz\n1,2,3,4\n")
    with h5py.File(folder / "rectify_map.h5", "w") as file:
        file["rectify_map"] = np.zeros((12, 20, 2), "f4")


@pytest.mark.parametrize("kind", ["dat", "h5", "npz", "csv"])
@pytest.mark.parametrize("below", ["", "left"])
def test_one_recording_among_companions_opens(kind, below, tmp_path):
    name = save_one(tmp_path / "a" / below, kind)
    save_companions(tmp_path / "a")
    with open_recording(tmp_path / "a", assume=SIZE) as recording:
        assert_same_events(all_events(recording), EVENTS)
        assert name in said(recording) or kind == "csv"


def test_several_recordings_of_a_folder_are_named(tmp_path):
    names = [save_one(tmp_path / "a", kind) for kind in ("dat", "h5", "npz")]
    with pytest.raises(RecordingError, match="name one of them") as refusal:
        open_recording(tmp_path / "a")
    assert all(name in str(refusal.value) for name in names)


def test_of_two_cameras_in_a_folder_the_left_one_opens_and_the_other_is_named(tmp_path):
    for side in ("left", "right"):
        save_one(tmp_path / "a" / "events" / side, "h5")
    with open_recording(tmp_path / "a", assume=SIZE) as recording:
        assert "the recording is events/left/events.h5" in said(recording)
        assert "not shown: events/right/events.h5" in said(recording)


def test_the_pictures_of_a_folder_belong_to_its_recording(tmp_path):
    save_one(tmp_path / "a", "h5")
    save_pictures(tmp_path / "a" / "images", (12, 20), [0, 10_000, 20_000, 30_000])
    with open_recording(tmp_path / "a") as recording:
        assert len(recording.ground_truth) == 4


def test_folders_and_zips_of_nothing_say_what_is_there(tmp_path):
    (tmp_path / "empty").mkdir()
    (tmp_path / "other").mkdir()
    (tmp_path / "other" / "notes.md").write_text("hello")
    with zipfile.ZipFile(tmp_path / "empty.zip", "w"):
        pass
    with zipfile.ZipFile(tmp_path / "other.zip", "w") as archive:
        archive.writestr("notes.md", "hello")
    for name, match in (
        ("empty", "an empty folder"),
        ("other", "a folder with notes.md"),
        ("empty.zip", "nothing in it"),
        ("other.zip", "a zip with notes.md"),
    ):
        with pytest.raises(RecordingError, match=match):
            open_recording(tmp_path / name)


@pytest.mark.parametrize("inner", ["npz", "h5"])
def test_a_zip_of_one_recording_opens_whatever_it_is(inner, tmp_path):
    name = save_one(tmp_path / "a", inner)
    with zipfile.ZipFile(tmp_path / "a.zip", "w") as archive:
        archive.write(tmp_path / "a" / name, f"deep\\{name}")
        archive.writestr("deep\\notes.md", "hello")
    with open_recording(tmp_path / "a.zip", assume=SIZE) as recording:
        assert_same_events(all_events(recording), EVENTS)


def test_a_member_without_a_name_is_none(tmp_path):
    save_pieces(tmp_path / "seq", count=1, form="events.npz")
    with zipfile.ZipFile(tmp_path / "damaged.zip", "w") as archive:
        archive.write(tmp_path / "seq" / "events.npz", "events.npz")
        archive.writestr("N", b"nothing")
    content = (tmp_path / "damaged.zip").read_bytes()
    place = content.rindex(b"PK\x01\x02")  # of the second member's entry
    assert content[place + 46 : place + 47] == b"N"
    unnamed = content[: place + 28] + b"\x00\x00\x01\x00" + content[place + 32 :]  # the letter is an extra field
    (tmp_path / "damaged.zip").write_bytes(unnamed)
    with open_recording(tmp_path / "damaged.zip", assume=SIZE) as recording:
        assert_same_events(all_events(recording), EVENTS)


def test_a_zip_written_with_backslashes_keeps_its_pictures(tmp_path):
    with zipfile.ZipFile(tmp_path / "a.zip", "w") as archive:
        archive.writestr("rec\\events.txt", "".join(f"{t / 1e6:.6f} {x} {y} {p:d}\n" for t, x, y, p in ROWS))
        archive.writestr("rec\\images.txt", "".join(f"0.0{i} images/{i}.png\n" for i in range(3)))
        for i in range(3):
            content = cv2.imencode(".png", np.zeros((12, 20), np.uint8))[1].tobytes()
            archive.writestr(f"rec\\images\\{i}.png", content)
    with open_recording(tmp_path / "a.zip") as recording:
        assert len(recording.ground_truth) == 3


FOREIGN = {
    b"7z\xbc\xaf\x27\x1c\x00\x04": "7z archive",
    b"Rar!\x1a\x07\x01\x00": "rar archive",
    b"\x28\xb5\x2f\xfd" + bytes(20): "zstd archive",
    bytes(257) + b"ustar\x0000": "tar archive",
    b"version https://git-lfs.github.com/spec/v1\n": "Git LFS",
    b"<!DOCTYPE html><html>": "web page",
    b"\x89PNG\r\n\x1a\n" + bytes(20): "a picture",
    b"\x00\x00\x00\x18ftypmp42" + bytes(20): "a video",
    bytes(5000): "nothing but zeros",
}


@pytest.mark.parametrize("content", FOREIGN)
def test_what_is_no_recording_is_called_by_its_name(content, tmp_path):
    (tmp_path / "a.xyz").write_bytes(content)
    with pytest.raises(RecordingError, match=FOREIGN[content]):
        open_recording(tmp_path / "a.xyz")


def test_five_byte_files_are_taken_only_where_their_time_ascends(tmp_path):
    rng = np.random.default_rng(0)
    (tmp_path / "a.bin").write_bytes(rng.bytes(5000))
    with pytest.raises(RecordingError, match="time runs back at"):
        open_recording(tmp_path / "a.bin")

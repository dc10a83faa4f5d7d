"""Pictures beside the events: their range, clock and size are judged, and a fault of them never costs the events."""

from __future__ import annotations

import cv2
import h5py
import numpy as np
import pytest

from etnet.events.open import Assumptions, open_recording
from etnet.events.write import write_recording
from tests.events.containers import all_events, assert_same_events
from tests.strategies import make_events

EVENTS = make_events(300, duration=150_000)
STAMPS = np.array([0, 50_000, 100_000, 140_000])
RAMP = np.linspace(0, 1, 20 * 12).reshape(12, 20)


def said(recording) -> str:
    return "\n".join(map(str, recording.remarks))


def save_h5(path, pictures, stamps=STAMPS / 1e6, attributes=None):
    with h5py.File(path, "w") as file:
        file["events/xs"], file["events/ys"] = EVENTS.x, EVENTS.y
        file["events/ts"], file["events/ps"] = EVENTS.t / 1e6, EVENTS.p > 0
        file.attrs["sensor_resolution"] = (12, 20)
        for i, picture in enumerate(pictures):
            image = file.create_dataset(f"images/image{i:09d}", data=picture)
            if stamps is not None and stamps[i] is not None:
                image.attrs["timestamp"] = stamps[i]
            image.attrs.update(attributes or {})
    return path


def save_folder(folder, lines, pictures=4, suffix=".png", sub="images", image=None):
    (folder / sub).mkdir(parents=True)
    rows = zip(EVENTS.t / 1e6, EVENTS.x, EVENTS.y, EVENTS.p > 0, strict=True)
    (folder / "events.txt").write_text("20 12\n" + "".join(f"{t:.6f} {x} {y} {p:d}\n" for t, x, y, p in rows))
    picture = (RAMP * 255).astype(np.uint8) if image is None else image
    for i in range(pictures):
        assert cv2.imwrite(str(folder / sub / f"frame_{i:08d}{suffix}"), picture)
    if lines is not None:
        (folder / "images.txt").write_text(lines)
    return folder


RANGES = {
    "u1": ("u1", 255, 255, False),
    "10 bits in u2": ("u2", 1023, 1023, True),
    "12 bits in u2": ("u2", 4095, 4095, True),
    "14 bits in u2": ("u2", 16_383, 16_383, True),
    "u2": ("u2", 65_535, 65_535, False),
    "i4 of bytes": ("i4", 255, 255, True),
    "i8 of 12 bits": ("i8", 4000, 4095, True),
    "f4": ("f4", 1, 1, False),
    "f4 of bytes": ("f4", 255, 255, True),
    "f8 of 10 bits": ("f8", 1000, 1023, True),
}


@pytest.mark.parametrize("kind", RANGES)
def test_the_range_of_frames_is_judged_and_said(kind, tmp_path):
    dtype, high, white, is_said = RANGES[kind]
    stored = (RAMP * high).astype(dtype)
    with open_recording(save_h5(tmp_path / "a.h5", [stored] * 4)) as recording:
        truth = recording.ground_truth
        frame = truth.read_frame(2)
        np.testing.assert_allclose(frame, stored / white, atol=1e-6)
        assert 0 <= frame.min() <= frame.max() <= 1
        assert ("was taken for white" in said(recording)) is is_said
        assert truth.white == white


def test_the_range_is_that_of_the_brightest_of_a_few_frames(tmp_path):
    dark, bright = np.full((12, 20), 90, "u2"), np.full((12, 20), 4000, "u2")
    with open_recording(save_h5(tmp_path / "a.h5", [dark, dark, dark, bright])) as recording:
        assert recording.ground_truth.white == 4095


def test_finer_frames_are_written_with_16_bits_and_read_as_they_were(tmp_path):
    stored = (RAMP * 4095).astype("u2")
    with open_recording(save_h5(tmp_path / "a.h5", [stored] * 4)) as recording:
        write_recording(recording, tmp_path / "b.h5")
        before = recording.ground_truth.read_frame(1)
    with open_recording(tmp_path / "b.h5") as recording:
        np.testing.assert_allclose(recording.ground_truth.read_frame(1), before, atol=1 / 65_535)
        assert len(np.unique(recording.ground_truth.read_frame(1))) == len(np.unique(before))


@pytest.mark.parametrize("dark", [0.02, 1.0])
def test_dark_frames_stay_dark_through_writing(dark, tmp_path):
    stored = (RAMP * 65_535 * dark).astype("u2")
    stored[0, 0] = 65_535
    with open_recording(save_h5(tmp_path / "a.h5", [stored] * 4)) as recording:
        write_recording(recording, tmp_path / "b.h5")
    with open_recording(tmp_path / "b.h5") as recording:
        np.testing.assert_allclose(recording.ground_truth.read_frame(3), stored / 65_535, atol=1 / 65_535)


@pytest.mark.parametrize("fault", ["complex", "no stamp", "one stamp is missing", "no picture", "empty"])
def test_a_fault_of_the_frames_never_costs_the_events(fault, tmp_path):
    pictures: list = [(RAMP * 255).astype("u1")] * 4
    stamps: list | None = list(STAMPS / 1e6)
    if fault == "complex":
        pictures = [RAMP.astype("c8")] * 4
    elif fault == "no stamp":
        stamps = None
    elif fault == "one stamp is missing":
        stamps[1] = None
    elif fault == "no picture":
        pictures = [np.arange(5)] * 4
    else:
        pictures = [np.zeros((0, 20), "u1")] * 4
    with open_recording(save_h5(tmp_path / "a.h5", pictures, stamps)) as recording:
        assert_same_events(all_events(recording), EVENTS)
        assert "left out" in said(recording)
        assert (recording.ground_truth is not None) is (fault == "one stamp is missing")
        if recording.ground_truth is not None:
            assert recording.ground_truth.stamps.tolist() == [0, 100_000, 140_000]


@pytest.mark.parametrize("scale", [1.0, 1e-3, 1e-6, 1e3])
def test_frames_whose_stamps_count_another_unit_are_brought_to_the_events(scale, tmp_path):
    with open_recording(save_h5(tmp_path / "a.h5", [RAMP.astype("f4")] * 4, STAMPS * scale)) as recording:
        assert recording.ground_truth.stamps.tolist() == STAMPS.tolist()
        assert ("stamps of the frames count" in said(recording)) is (scale != 1e-6)


def test_frames_on_another_clock_are_kept_and_advised_on(tmp_path):
    path = save_h5(tmp_path / "a.h5", [RAMP.astype("f4")] * 4, 1.6e9 + STAMPS / 1e6)
    with open_recording(path) as recording:
        assert len(recording.ground_truth) == 4
        assert "advice: 4 of 4 frames lie outside the events' time" in said(recording)


def test_frames_of_another_size_are_kept_and_advised_on(tmp_path):
    with open_recording(save_h5(tmp_path / "a.h5", [np.zeros((24, 40), "u1")] * 4)) as recording:
        assert "advice: the frames have 40×24 pixels, the sensor 20×12" in said(recording)


def test_stacked_frames_are_found_by_their_stamps(tmp_path):
    pairs = {"frame": "frame_ts", "ovc/left/data": "ovc/ts", "images": "timestamps", "cam/aps": "cam/aps_timestamps"}
    for pictures, stamps in pairs.items():
        with h5py.File(tmp_path / "a.h5", "w") as file:
            for axis, column in (("x", EVENTS.x), ("y", EVENTS.y), ("t", EVENTS.t), ("p", EVENTS.p > 0)):
                file[f"events/{axis}"] = column
            file[pictures], file[stamps] = np.zeros((4, 12, 20), "u1"), STAMPS
            file["depth"], file["depth_ts"] = np.zeros((4, 12, 20), "f4"), STAMPS
        with open_recording(tmp_path / "a.h5") as recording:
            assert f"frames are in {pictures}, their stamps in {stamps}" in said(recording)
            assert recording.ground_truth.stamps.tolist() == STAMPS.tolist()


SECONDS = [f"{t / 1e6:.6f}" for t in STAMPS]
LISTS = {
    "plain": "".join(f"{t} images/frame_{i:08d}.png\n" for i, t in enumerate(SECONDS)),
    "whole micros": "".join(f"{t} images/frame_{i:08d}.png\n" for i, t in enumerate(STAMPS)),
    "bare names": "".join(f"{t} frame_{i:08d}.png\n" for i, t in enumerate(SECONDS)),
    "commas and a head": "# t, file\n" + "".join(f"{t},images/frame_{i:08d}.png\n" for i, t in enumerate(SECONDS)),
    "a head without a mark": "time,file\n" + "".join(f"{t},images/frame_{i:08d}.png\n" for i, t in enumerate(SECONDS)),
    "name first": "".join(f"images/frame_{i:08d}.png;{t}\n" for i, t in enumerate(SECONDS)),
    "backslashes": "".join(f"{t} images\\frame_{i:08d}.png\n" for i, t in enumerate(SECONDS)),
    "one stamp a line": "".join(f"{t}\n" for t in STAMPS),
    "rows that are counted": "".join(f"{7 + i} {t} images/frame_{i:08d}.png\n" for i, t in enumerate(SECONDS)),
    "counted rows and whole micros": "".join(f"{i},{t},images/frame_{i:08d}.png\n" for i, t in enumerate(STAMPS)),
    "a head that names the stamps' place": "# exported by hand\n# id timestamp image_name\n"
    + "".join(f"{2 * i} {t} images/frame_{i:08d}.png\n" for i, t in enumerate(SECONDS)),
    "names of several words": "picture number, time stamp [ms], file\n"
    + "".join(f"{2 * i},{t / 1000},images/frame_{i:08d}.png\n" for i, t in enumerate(STAMPS)),
    "an exposure behind the stamp": "".join(f"{t} 0.5 images/frame_{i:08d}.png\n" for i, t in enumerate(STAMPS)),
    "words that name no place": "# pictures, each with its time\n# a time of day is not kept\n"
    + "".join(f"{t} images/frame_{i:08d}.png\n" for i, t in enumerate(SECONDS)),
}


@pytest.mark.parametrize("form", LISTS)
def test_lists_of_pictures_are_read_in_every_form(form, tmp_path):
    with open_recording(save_folder(tmp_path / "a", LISTS[form])) as recording:
        assert recording.ground_truth.stamps.tolist() == STAMPS.tolist()
        np.testing.assert_allclose(recording.ground_truth.read_frame(3), RAMP, atol=1 / 254)


def test_pictures_that_are_missing_or_have_no_list_are_said(tmp_path):
    with open_recording(save_folder(tmp_path / "a", LISTS["plain"], pictures=2)) as recording:
        assert len(recording.ground_truth) == 2
        assert "2 pictures that images.txt names are missing" in said(recording)
    with open_recording(save_folder(tmp_path / "b", None)) as recording:
        assert recording.ground_truth is None
        assert "4 pictures have no list of stamps" in said(recording)
    with open_recording(save_folder(tmp_path / "c", LISTS["one stamp a line"], pictures=3)) as recording:
        assert recording.ground_truth is None
        assert "images.txt has 4 stamps, no folder has as many pictures (images 3)" in said(recording)


def test_a_bad_line_of_a_list_costs_the_pictures_alone(tmp_path):
    with open_recording(save_folder(tmp_path / "a", "0.0 images/frame_00000000.png\nnonsense here\n")) as recording:
        assert_same_events(all_events(recording), EVENTS)
        assert "line 2 of images.txt" in said(recording)


def test_pictures_named_by_their_stamps_need_no_list(tmp_path):
    folder = save_folder(tmp_path / "a", None)
    for i, t in enumerate(STAMPS):
        (folder / "images" / f"frame_{i:08d}.png").rename(folder / "images" / f"{t * 1000:015d}.png")
    with open_recording(folder) as recording:
        assert recording.ground_truth.stamps.tolist() == STAMPS.tolist()
        assert "are named by their stamps" in said(recording)


def test_stamps_of_what_is_no_picture_cost_the_pictures_nothing(tmp_path):
    folder = save_folder(tmp_path / "a", None)
    (folder / "images" / "timestamps.txt").write_text(LISTS["one stamp a line"])
    (folder / "disparity").mkdir()
    (folder / "disparity" / "timestamps.txt").write_text("".join(f"{t}\n" for t in STAMPS[::2]))
    with open_recording(folder) as recording:
        assert recording.ground_truth.stamps.tolist() == STAMPS.tolist()
        assert "left out" not in said(recording)


@pytest.mark.parametrize("form", ["plain", "one stamp a line"])
def test_a_recording_may_be_called_as_what_is_no_picture(form, tmp_path):
    save_folder(tmp_path / "a" / "slider_depth", LISTS[form])
    with open_recording(tmp_path / "a") as recording:
        assert recording.ground_truth.stamps.tolist() == STAMPS.tolist()


def test_pictures_of_10_bits_are_not_black(tmp_path):
    image = (RAMP * 1023).astype(np.uint16)
    with open_recording(save_folder(tmp_path / "a", LISTS["plain"], image=image)) as recording:
        np.testing.assert_allclose(recording.ground_truth.read_frame(0), RAMP, atol=1 / 1022)


def test_a_picture_beyond_the_bound_is_not_decoded(tmp_path):
    folder = save_folder(tmp_path / "a", LISTS["plain"], image=np.zeros((40, 40), np.uint8))
    with open_recording(folder, assume=Assumptions(max_pixels=1599)) as recording:
        assert recording.ground_truth is None
        assert "--max-pixels 1600" in said(recording)

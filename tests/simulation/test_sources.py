"""Folders of pictures, photos in motion, and what is stored of them."""

import cv2
import h5py
import numpy as np
import pytest

from etnet.errors import RecordingError
from etnet.events.open import open_recording
from etnet.simulation.camera_path import PhotoInMotion
from etnet.simulation.decode import VideoFootage
from etnet.simulation.footage import Framing
from etnet.simulation.picture_folder import PictureFolder
from etnet.simulation.settings import PixelSettings
from etnet.simulation.video import VideoConfig, simulate_footage, simulate_video
from tests.simulation.films import drifting, write_film

IDEAL = VideoConfig(pixels=PixelSettings())


def folder_of(path, num=5, kind=np.uint8, names="frame_{}.png"):
    path.mkdir()
    for i, picture in enumerate(drifting(num, 2.0, kind=kind)):
        cv2.imwrite(str(path / names.format(i)), picture)
    return path


def stamps_of(footage):
    return [round(frame.t) for frame in footage]


def test_pictures_come_in_the_order_of_their_numbers(tmp_path):
    folder = folder_of(tmp_path / "p", 12)
    frames = list(PictureFolder(folder, fps=100.0))
    assert [round(frame.t) for frame in frames] == [10_000 * i for i in range(12)]
    again = PictureFolder(folder / "frame_1*.png", fps=100.0)
    assert len(list(again)) == 3
    expected = np.rint(again.tone.code(frames[10].light) * 255)
    assert np.array_equal(expected, drifting(11, 2.0)[10])


@pytest.mark.parametrize(
    ("table", "lines"),
    [
        ("images.txt", [f"{i * 0.05:.6f} images/frame_{i}.png" for i in range(5)]),
        ("timestamps.txt", [f"{i * 0.05:.6f}" for i in range(5)]),
        ("timestamps.txt", ["# frame, time", *(f"{i} {i * 0.05:.6f}" for i in range(5))]),
        ("stamps.csv", ["filename,stamp_us", *(f"frame_{i}.png,{i * 50_000}" for i in range(5))]),
        ("data.csv", ["#timestamp [ns],filename", *(f"{10**18 + i * 50_000_000},frame_{i}.png" for i in range(5))]),
    ],
)
def test_stamps_are_read_in_the_layouts_people_have(tmp_path, table, lines):
    folder = folder_of(tmp_path / "p")
    (folder / table).write_text("\n".join(lines) + "\n")
    assert np.allclose(stamps_of(PictureFolder(folder)), [50_000 * i for i in range(5)], atol=1)


def test_names_that_are_nanoseconds_are_stamps(tmp_path):
    folder = folder_of(tmp_path / "p", 3, names="14036365{}9763555584.png")
    assert stamps_of(PictureFolder(folder)) == [0, 10_000_000, 20_000_000]


def test_pictures_without_times_or_of_none_are_one_line(tmp_path):
    with pytest.raises(RecordingError, match="give --fps or --stamps"):
        PictureFolder(folder_of(tmp_path / "p"))
    (tmp_path / "empty").mkdir()
    with pytest.raises(RecordingError, match="holds 0 pictures"):
        PictureFolder(tmp_path / "empty", fps=10.0)
    (tmp_path / "p" / "stamps.csv").write_text("0\n1\n")
    with pytest.raises(RecordingError, match="holds 2 stamps for 5 pictures"):
        PictureFolder(tmp_path / "p")


def photo_of(path):
    rng = np.random.default_rng(0)
    cv2.imwrite(str(path), cv2.GaussianBlur(rng.integers(0, 256, (200, 300), np.uint8), (0, 0), 2))
    return path


def test_saccades_draw_a_triangle_and_come_back(tmp_path):
    footage = PhotoInMotion(photo_of(tmp_path / "a.png"), "saccades", Framing(size=(64, 48)), reach=8.0)
    frames = list(footage)
    assert footage.duration == pytest.approx(0.3)
    assert np.abs(frames[0].light - frames[-1].light).max() < 1e-4
    assert np.abs(frames[0].light - frames[len(frames) // 2].light).mean() > 0.01
    assert frames[1].t - frames[0].t <= 1_000


def test_a_path_from_a_table_moves_turns_and_zooms(tmp_path):
    table = tmp_path / "path.csv"
    table.write_text("seconds,x,y,degrees,zoom\n0,0,0,0,1\n0.1,5,0,0,1\n0.2,5,0,90,2\n")
    frames = list(PhotoInMotion(photo_of(tmp_path / "a.png"), table, Framing(size=(64, 64))))
    at = {round(frame.t): frame.light for frame in frames}
    moved = at[100_000]
    assert np.abs(moved[:, :-5] - frames[0].light[:, 5:]).max() < 0.02
    assert frames[-1].light.shape == (64, 64)
    table.write_text("0,0,0\n0,1,1\n")
    with pytest.raises(RecordingError, match="ascending seconds"):
        PhotoInMotion(photo_of(tmp_path / "a.png"), table)


@pytest.mark.parametrize(
    ("rows", "pixels_a_second"),
    [
        ("0,0,0\n0.1,0,0\n0.11,30,40\n0.2,30,40\n", 5_000),
        ("0,0,0,0,4\n0.1,0,0,0,4\n0.11,20,0,0,4\n0.2,20,0,0,4\n", 8_000),
        ("0,0,0,0\n0.1,0,0,0\n0.11,0,0,90\n0.2,0,0,90\n", 50 * np.pi * 16),
        ("0,0,0,0,0.5\n0.1,0,0,0,0.5\n0.11,0,0,0,2\n0.2,0,0,0,2\n", 300 * 16),
    ],
)
def test_nothing_moves_more_than_half_a_pixel_between_two_moments_where_a_path_is_fastest(
    tmp_path, rows, pixels_a_second
):
    table = tmp_path / "path.csv"
    table.write_text(rows)
    footage = PhotoInMotion(photo_of(tmp_path / "a.png"), table, Framing(size=(32, 24)))
    assert footage.interval * 1e-6 * pixels_a_second <= 0.5 + 1e-9
    part = PhotoInMotion(photo_of(tmp_path / "a.png"), table, Framing(size=(32, 24), start=0.05))
    assert part.interval * 1e-6 * pixels_a_second <= 0.5 + 1e-9
    hair_before_rest = float(np.nextafter(0.11, 0))
    rest = PhotoInMotion(photo_of(tmp_path / "a.png"), table, Framing(size=(32, 24), start=hair_before_rest))
    assert rest.interval == pytest.approx(1_000, rel=0.02)


def test_the_built_in_motions_have_a_thousand_moments_a_second(tmp_path):
    for motion in ("saccades", "drift"):
        footage = PhotoInMotion(photo_of(tmp_path / "a.png"), motion, Framing(size=(32, 24)))
        assert footage.interval == pytest.approx(1_000)


def test_a_path_that_would_take_absurdly_many_moments_is_one_line(tmp_path):
    table = tmp_path / "path.csv"
    table.write_text("0,0,0\n1,0,0\n1.000001,60,80\n2,60,80\n")
    with pytest.raises(
        RecordingError, match=r"path.csv: moves by 100 pixels in 1e-06 s, from 1 s on; .* at most 1,000"
    ):
        PhotoInMotion(photo_of(tmp_path / "a.png"), table, Framing(size=(32, 24)))
    table.write_text("0,0,0\n1,nan,0\n")
    with pytest.raises(RecordingError, match="finite numbers"):
        PhotoInMotion(photo_of(tmp_path / "a.png"), table, Framing(size=(32, 24)))


def test_a_photo_in_motion_becomes_a_recording_with_a_cameras_frames(tmp_path):
    footage = PhotoInMotion(photo_of(tmp_path / "a.png"), "drift", Framing(size=(64, 48)), seconds=0.5)
    written = simulate_footage(footage, tmp_path / "a.h5", IDEAL)
    assert written.num_events > 5_000
    with open_recording(tmp_path / "a.h5") as recording:
        assert 20 <= len(recording.ground_truth) <= 30


def test_frames_are_stored_in_their_own_depth_with_flow_and_all_parameters(tmp_path):
    folder = folder_of(tmp_path / "p", kind=np.uint16)
    config = VideoConfig(pixels=PixelSettings(pos_thres=0.15), has_flow=True)
    written = simulate_footage(PictureFolder(folder, fps=50.0), tmp_path / "a.h5", config)
    with h5py.File(tmp_path / "a.h5") as file:
        assert file["images/image000000000"].dtype == np.uint16
        assert np.array_equal(file["images/image000000002"], drifting(5, 2.0, kind=np.uint16)[2])
        assert len(file["flow"]) == 4
        assert file.attrs["pos_thres"] == 0.15
        assert file.attrs["interpolate"] == "auto"
        assert file.attrs["num_events"] == written.num_events
    with open_recording(tmp_path / "a.h5") as recording:
        told = " ".join(remark.text for remark in recording.remarks)
        assert '"pos_thres": 0.15' in told
        flow = recording.ground_truth.read_flow(2)
        assert np.median(flow[0]) == pytest.approx(-2, abs=0.3)


def test_colour_and_blurred_frames_are_stored_on_request(tmp_path):
    red = [np.zeros((48, 64, 3), np.uint8) for _ in range(4)]
    for i, picture in enumerate(red):
        picture[:, 8 * i : 8 * i + 20] = (250, 30, 10)
    path = write_film(tmp_path / "red.mkv", red, codec="ffv1", pixels="bgr0")
    simulate_video(path, tmp_path / "colour.h5", VideoConfig(has_colour=True))
    with h5py.File(tmp_path / "colour.h5") as file:
        assert file["images/image000000001"].shape == (48, 64, 3)
        assert file["images/image000000001"].attrs["type"] == "color_bgr"
        assert np.abs(file["images/image000000001"][0, 10].astype(int) - [10, 30, 250]).max() <= 1
    for name, exposure in (("sharp", 0.0), ("blurred", 30_000.0)):
        simulate_video(path, tmp_path / f"{name}.h5", VideoConfig(exposure_us=exposure))
    with h5py.File(tmp_path / "sharp.h5") as sharp, h5py.File(tmp_path / "blurred.h5") as blurred:
        steps = [np.abs(np.diff(file["images/image000000002"][20].astype(int))).max() for file in (sharp, blurred)]
    assert steps[1] < 0.75 * steps[0]


def test_nothing_ends_in_no_events_without_a_sentence(tmp_path):
    still = write_film(tmp_path / "still.mp4", [np.full((48, 64), 90, np.uint8)] * 5)
    footage = VideoFootage(still)
    written = simulate_footage(footage, tmp_path / "still.h5", IDEAL)
    assert written.num_events == 0
    assert any(text.startswith("0 events: log intensity changes by") for text in written.remarks)

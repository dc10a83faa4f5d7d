"""`etnet simulate --video`: an option that a source cannot follow is refused, every other one is followed."""

import cv2
import h5py
import numpy as np
import pytest

from etnet.cli.main import main
from etnet.events.open import open_recording
from tests.simulation.films import drifting, write_film
from tests.simulation.networks import mean_network


@pytest.fixture(scope="module")
def sources(tmp_path_factory):
    folder = tmp_path_factory.mktemp("sources")
    write_film(folder / "clip.mkv", drifting(5, 2.0), codec="ffv1", pixels="gray")
    (folder / "pictures").mkdir()
    for i, picture in enumerate(drifting(5, 2.0)):
        cv2.imwrite(str(folder / "pictures" / f"{i}.png"), picture)
    cv2.imwrite(str(folder / "photo.png"), drifting(1, size=(96, 72))[0])
    (folder / "path.csv").write_text("0,0,0\n0.1,5,0\n")
    (folder / "stamps.csv").write_text("".join(f"{0.02 * i:.2f}\n" for i in range(5)))
    return folder


def done(sources, out, *words) -> int:
    named = {"clip.mkv", "pictures", "photo.png", "path.csv", "stamps.csv"}
    return main(["simulate", str(out), *(str(sources / word) if word in named else str(word) for word in words)])


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (["clip.mkv", "--fps", 30], "clip.mkv: is a video, and --fps is for pictures"),
        (["clip.mkv", "--stamps", "stamps.csv"], "--stamps is for pictures"),
        (["clip.mkv", "--seconds", 1], "--seconds is for a photo in motion"),
        (["pictures", "--fps", 30, "--reach", 4], "--reach is for a photo in motion"),
        (["photo.png", "--motion", "drift", "--drop-repeats"], "--drop-repeats is for a video or pictures"),
        (["photo.png", "--motion", "drift", "--store-flow"], "--store-flow is for a video or pictures"),
        (["photo.png", "--motion", "drift", "--interpolate", 4], "--interpolate is for a video or pictures"),
        (["photo.png", "--motion", "path.csv", "--seconds", 1], "says itself how long"),
        (["photo.png", "--motion", "path.csv", "--reach", 3], "leave --reach out"),
        (["clip.mkv", "--camera", "DAVIS346", "--side", 100], "--side and --camera both say how large"),
        (["clip.mkv", "--size", 32, 24, "--side", 100], "--side and --size both say how large"),
        (["clip.mkv", "--camera", "DAVIS346", "--noise", 0], "--contrast and --noise have no part in it"),
        (["clip.mkv", "--colour", "--exposure-ms", 5], "in colour are stored as they come"),
        (["clip.mkv", "--num", 3], "--num: of --photos, not of --video"),
        (["clip.mkv", "--sensor.leak-hz", 0, 1], "--sensor.…: of --photos"),
        (["clip.mkv", "--photos", "pictures"], "do not go together"),
        (["clip.mkv", "--hot-share", 0.01, "--hot-hz", -5], "hot_hz is -5; it takes 0"),
    ],
)
def test_an_option_that_the_source_cannot_follow_is_refused(sources, tmp_path, words, told, capsys):
    assert done(sources, tmp_path / "a.h5", "--video", *words) == 1
    assert told in capsys.readouterr().err
    assert not list(tmp_path.iterdir())


def test_options_of_a_video_are_refused_with_photos(sources, tmp_path, capsys):
    assert done(sources, tmp_path / "out", "--photos", "pictures", "--from", 1, "--pos-thres", 0.3) == 1
    assert "--pos-thres, --from: of --video, not of --photos" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


def test_a_size_cuts_the_pictures_to_its_shape(sources, tmp_path):
    assert done(sources, tmp_path / "a.h5", "--video", "clip.mkv", "--size", 32, 32) == 0
    with open_recording(tmp_path / "a.h5") as recording:
        assert str(recording.sensor) == "32×32"


def test_stamps_gamma_and_the_tone_that_was_taken_stand_in_the_file(sources, tmp_path, capsys):
    given = ("--video", "pictures", "--stamps", "stamps.csv")
    assert done(sources, tmp_path / "a.h5", *given) == 0
    assert "taken as sRGB" in capsys.readouterr().err
    assert done(sources, tmp_path / "b.h5", *given, "--gamma", 3) == 0
    assert "taken as sRGB" not in capsys.readouterr().err
    with h5py.File(tmp_path / "a.h5") as plain, h5py.File(tmp_path / "b.h5") as steep:
        assert (plain.attrs["tone"], steep.attrs["tone"]) == ("sRGB", "gamma 3")
        assert plain.attrs["stamps"] == "stamps.csv"
        assert [round(plain[f"images/image{i:09d}"].attrs["timestamp"] * 100) for i in range(5)] == [0, 2, 4, 6, 8]
        assert steep.attrs["num_events"] > plain.attrs["num_events"]


def test_flow_is_stored_on_request(sources, tmp_path):
    assert done(sources, tmp_path / "a.h5", "--video", "clip.mkv", "--store-flow") == 0
    with open_recording(tmp_path / "a.h5") as recording:
        assert np.median(recording.ground_truth.read_flow(2)[0]) == pytest.approx(-2, abs=0.4)


def test_frames_get_an_exposure_and_noise_on_request(sources, tmp_path):
    frames = {}
    for name, more in {"plain": [], "noisy": ["--frame-noise", 0.1], "long": ["--exposure-ms", 33]}.items():
        assert done(sources, tmp_path / f"{name}.h5", "--video", "clip.mkv", *more) == 0
        with h5py.File(tmp_path / f"{name}.h5") as file:
            frames[name] = file["images/image000000002"][()].astype(int)
    assert 5 < np.abs(frames["noisy"] - frames["plain"]).mean() < 60
    # Waves that run to the left, seen for 33 ms up to the frame's stamp: where they were one pixel ago, on average.
    shifted = np.roll(frames["plain"], 1, axis=1)[:, 8:-8]
    assert np.abs(frames["long"][:, 8:-8] - shifted).mean() < 0.5 * np.abs(frames["plain"][:, 8:-8] - shifted).mean()


def test_hot_pixels_and_dark_current_have_their_options(sources, tmp_path):
    quiet = ("--video", "clip.mkv", "--noise", 0)
    assert done(sources, tmp_path / "a.h5", *quiet, "--dark", 0.05) == 0
    assert done(sources, tmp_path / "b.h5", *quiet, "--dark", 0.05, "--hot-share", 0.01, "--hot-hz", 2000) == 0
    with h5py.File(tmp_path / "a.h5") as clean, h5py.File(tmp_path / "b.h5") as hot:
        assert (hot.attrs["dark"], hot.attrs["hot_share"], hot.attrs["hot_hz"]) == (0.05, 0.01, 2000)
        assert hot.attrs["num_events"] > clean.attrs["num_events"] + 1000


def test_an_interpolator_is_taken_by_its_path(sources, tmp_path, capsys):
    (tmp_path / "mean.onnx").write_bytes(mean_network((64, 64)))
    given = ("--video", "clip.mkv", "--interpolator", tmp_path / "mean.onnx")
    assert done(sources, tmp_path / "a.h5", *given) == 0
    with h5py.File(tmp_path / "a.h5") as file:
        assert (file.attrs["interpolator"], file.attrs["interpolate"]) == ("mean.onnx", "learned")
    assert done(sources, tmp_path / "b.h5", *given, "--interpolate", "off") == 1
    assert "so --interpolator has none to make" in capsys.readouterr().err

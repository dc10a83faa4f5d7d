"""What may be asked of pictures and photos is done as of a video: tone, colour, parts, repeats, exposure."""

import av
import cv2
import numpy as np
import pytest

from etnet.errors import RecordingError
from etnet.simulation.camera_path import PhotoInMotion
from etnet.simulation.footage import Framing
from etnet.simulation.picture_file import read_picture
from etnet.simulation.picture_folder import PictureFolder
from etnet.simulation.settings import PixelSettings
from etnet.simulation.tone import Tone
from etnet.simulation.video import VideoConfig, simulate_footage
from tests.simulation.films import drifting, write_film

IDEAL = PixelSettings()


def written(folder, pictures, name="{}.png"):
    folder.mkdir()
    for i, picture in enumerate(pictures):
        assert cv2.imwrite(str(folder / name.format(i)), picture)
    return folder


def write_exr(path, picture):
    """Linear light, red, green, blue."""
    with av.open(str(path), "w", format="image2", options={"update": "1"}) as container:
        stream = container.add_stream("exr", rate=1)
        stream.height, stream.width = picture.shape[:2]
        stream.pix_fmt = "gbrpf32le"
        container.mux(stream.encode(av.VideoFrame.from_ndarray(picture, "gbrpf32le")))
        container.mux(stream.encode(None))


def coloured(num=4):
    """Blue, green, red, as OpenCV writes them."""
    return [np.stack([picture // 4, picture // 2, picture], 2) for picture in drifting(num, 2.0)]


def said(footage, words):
    return any(words in text for text in footage.remarks)


def test_the_tone_of_pictures_is_assumed_and_said_or_taken_from_the_option(tmp_path):
    folder = written(tmp_path / "p", drifting(3))
    plain = PictureFolder(folder, fps=10.0)
    assert plain.tone == Tone("srgb")
    assert said(plain, "taken as sRGB")
    stated = PictureFolder(folder, fps=10.0, tone=Tone("gamma", 1.8))
    assert not said(stated, "taken as")
    light = next(iter(stated)).light
    assert np.allclose(light, (drifting(1)[0] / 255) ** 1.8, atol=1e-5)
    photo = PhotoInMotion(folder / "0.png", framing=Framing(size=(24, 16)), reach=4.0)
    assert said(photo, "taken as sRGB")


def test_floats_are_light_itself_and_may_be_brighter_than_white(tmp_path):
    folder = tmp_path / "render"
    folder.mkdir()
    light = [np.stack([picture / 64] * 3, 2).astype(np.float32) for picture in drifting(4, 2.0)]
    for i, picture in enumerate(light):
        write_exr(folder / f"{i}.exr", picture)
    footage = PictureFolder(folder, fps=30.0)
    frames = list(footage)
    assert footage.tone == Tone("linear")
    assert said(footage, "taken as light itself")
    assert said(footage, "times white")
    assert np.abs(frames[2].light - light[2][..., 0]).max() < 1e-3 < frames[2].light.max() - 1
    flat = written(tmp_path / "tiff", [picture[..., 0] for picture in light], "{}.tiff")
    assert np.abs(list(PictureFolder(flat, fps=30.0))[2].light - light[2][..., 0]).max() < 1e-6
    (folder / "0.exr").write_bytes(b"nothing of the kind")
    with pytest.raises(RecordingError, match=r"0.exr: cannot be read"):
        read_picture(folder / "0.exr")


def test_values_that_are_no_numbers_are_refused_by_the_pictures_name(tmp_path):
    broken = [np.full((16, 24), value, np.float32) for value in (0.5, np.nan)]
    with pytest.raises(RecordingError, match=r"1.tiff: holds values"):
        list(PictureFolder(written(tmp_path / "p", broken, "{}.tiff"), fps=10.0))


def test_pictures_and_photos_give_their_colour_where_they_have_one(tmp_path):
    folder = written(tmp_path / "p", coloured())
    frames = list(PictureFolder(folder, fps=10.0, has_colour=True))
    assert np.array_equal(frames[2].colour, coloured()[2])
    assert next(iter(PictureFolder(folder, fps=10.0))).colour is None
    deep = written(tmp_path / "deep", [picture.astype(np.uint16) * 257 for picture in coloured()])
    assert np.array_equal(next(iter(PictureFolder(deep, fps=10.0, has_colour=True))).colour, coloured()[0])
    grey = PictureFolder(written(tmp_path / "grey", drifting(3)), fps=10.0, has_colour=True)
    assert next(iter(grey)).colour is None
    assert said(grey, "there is no colour")
    photo = PhotoInMotion(folder / "0.png", framing=Framing(size=(24, 16)), reach=4.0, has_colour=True)
    moments = list(photo)
    assert all((frame.colour is not None) == frame.is_stored for frame in moments)
    top = coloured()[0].reshape(-1, 3).max(0)
    assert moments[0].colour.shape == (16, 24, 3)
    assert (moments[0].colour.reshape(-1, 3).max(0) <= top).all()
    assert moments[0].colour[..., 2].mean() > 2 * moments[0].colour[..., 0].mean()


def test_repeated_pictures_are_told_and_left_out_on_request(tmp_path):
    folder = written(tmp_path / "p", [picture for picture in coloured() for _ in range(2)])
    footage = PictureFolder(folder, fps=10.0)
    assert len(list(footage)) == 8
    assert said(footage, "4 of 8 frames repeat the one before")
    footage = PictureFolder(folder, fps=10.0, drops_repeats=True)
    assert [round(frame.t / 1e5) for frame in footage] == [0, 2, 4, 6]
    assert said(footage, "left out")


def test_pictures_that_a_table_does_not_name_are_counted(tmp_path):
    folder = written(tmp_path / "p", drifting(4))
    (folder / "stamps.csv").write_text("0.png,0.0\n2.png,0.1\n3.png,0.3\n")
    footage = PictureFolder(folder)
    assert [round(frame.t / 1e5) for frame in footage] == [0, 1, 3]
    assert said(footage, "1 pictures that it does not name are left out")


def test_a_part_of_a_motion_is_that_part_of_the_whole(tmp_path):
    photo = written(tmp_path / "p", drifting(1, size=(96, 72))) / "0.png"
    whole = {round(frame.t): frame.light for frame in PhotoInMotion(photo, framing=Framing(size=(32, 24)))}
    part = list(PhotoInMotion(photo, framing=Framing(size=(32, 24), start=0.1, stop=0.25)))
    assert round(part[-1].t) == 150_000
    assert np.abs(part[0].light - whole[100_000]).max() < 1e-4
    assert np.abs(part[-1].light - whole[250_000]).max() < 1e-4
    fast = PhotoInMotion(photo, framing=Framing(size=(32, 24), start=0.1, stop=0.25, speed=3.0))
    assert fast.duration == pytest.approx(0.05)
    with pytest.raises(RecordingError, match=r"its motion takes 0.3 s; nothing of it is left from 0.5 s on"):
        PhotoInMotion(photo, framing=Framing(size=(32, 24), start=0.5))


def test_a_crop_that_leaves_the_photo_is_refused(tmp_path):
    photo = written(tmp_path / "p", drifting(1, size=(96, 72))) / "0.png"
    with pytest.raises(RecordingError, match="96×72; a crop of"):
        PhotoInMotion(photo, framing=Framing(crop=(50, 0, 60, 40), size=(16, 12)))


def test_a_part_that_begins_before_the_start_is_one_line():
    with pytest.raises(RecordingError, match=r"the part is -1 s … the end"):
        Framing(start=-1.0)


def test_an_exposure_longer_than_a_moment_of_the_photo_blurs_what_is_stored(tmp_path):
    import h5py

    photo = written(tmp_path / "p", drifting(1, size=(96, 72))) / "0.png"
    stored = {}
    for name, exposure in (("sharp", 0.0), ("blurred", 40_000.0)):
        footage = PhotoInMotion(photo, framing=Framing(size=(32, 24)))
        simulate_footage(footage, tmp_path / f"{name}.h5", VideoConfig(pixels=IDEAL, exposure_us=exposure))
        with h5py.File(tmp_path / f"{name}.h5") as file:
            stored[name] = np.stack([file[f"images/image{i:09d}"][()] for i in range(3, 12)]).astype(int)
    # At 20 ms from one frame to the next, 40 ms of light are about the mean of three.
    sharp = stored["sharp"]
    mean = (sharp[:-2] / 2 + sharp[1:-1] + sharp[2:] / 2) / 2
    assert np.abs(stored["blurred"][2:] - mean).mean() < 0.5 * np.abs(sharp[2:] - mean).mean()


def test_what_is_asked_for_and_cannot_be_is_said(tmp_path):
    with pytest.raises(RecordingError, match="in colour are stored as they come"):
        VideoConfig(has_colour=True, exposure_us=10.0)
    path = write_film(tmp_path / "a.mkv", drifting(4, 2.0), codec="ffv1", pixels="gray")
    from etnet.simulation.decode import VideoFootage
    from etnet.simulation.walk import Stepping

    footage = VideoFootage(path)
    simulate_footage(footage, tmp_path / "a.h5", VideoConfig(has_flow=True, stepping=Stepping("off")))
    assert said(footage, "there is no flow to store")

from dataclasses import replace

import av
import cv2
import numpy as np
import pytest

from etnet.errors import Cancelled, EtnetError, RecordingError
from etnet.events.recording import recording_of_events
from etnet.export.frames import write_frames
from etnet.export.images import to_uint8
from etnet.export.pictures import GAP, Look, draw
from etnet.export.take import Take
from etnet.export.video import write_gif, write_video
from etnet.playback.playback import Playback
from etnet.windows import ByCount, Window, plan_windows
from tests.export.recordings_made_up import NUM_WINDOWS, SENSOR, made_up_model, made_up_recording, made_up_take

WIDTH, HEIGHT = SENSOR.width, SENSOR.height


def decoded(path, channels=1) -> list[np.ndarray]:
    """Frames in the order in which they are shown."""
    with av.open(str(path)) as container:
        kind = "gray" if channels == 1 else "rgb24"
        return [frame.to_ndarray(format=kind) for frame in container.decode(video=0)]


def test_a_picture_without_stamps_is_the_frame_and_nothing_else():
    moment = next(made_up_take().moments())
    assert np.array_equal(draw(moment, Look(gamma=2.2), 5), to_uint8(moment.frame, 2.2))


def test_stamps_stand_below_the_picture_and_hide_no_pixel():
    moment = next(made_up_take().moments())
    plain, stamped = draw(moment, Look(scale=4), 5), draw(moment, Look(scale=4, has_stamps=True), 5)
    assert np.array_equal(stamped[: HEIGHT * 4], plain)
    assert stamped[HEIGHT * 4 :].max() > 150


def test_panels_stand_side_by_side_in_the_order_asked_for():
    moment = next(made_up_take().moments())
    picture = draw(moment, Look(("camera", "events", "reconstruction")), 5)
    assert picture.shape == (HEIGHT, 3 * WIDTH + 2 * GAP, 3)
    assert np.array_equal(picture[:, :WIDTH, 0], to_uint8(moment.camera))
    assert np.array_equal(picture[:, -WIDTH:, 1], to_uint8(moment.frame))


def test_a_camera_panel_without_a_camera_names_the_recording():
    recording = recording_of_events(made_up_recording().read(0, 600), "no camera")
    take = Take.of(Playback(made_up_model(), recording, plan_windows(recording, ByCount(300))))
    with pytest.raises(RecordingError, match="no camera: has no camera frames"):
        draw(next(take.moments()), Look(("camera",)), 2)


def test_a_video_is_h264_that_browsers_play_and_shows_the_frames(tmp_path):
    path = tmp_path / "out.mp4"
    take = made_up_take()
    assert write_video(take, path, Look(scale=4)) == NUM_WINDOWS
    with av.open(str(path)) as container:
        stream = container.streams.video[0]
        assert (stream.codec_context.name, stream.codec_context.pix_fmt) == ("h264", "yuv420p")
        assert stream.average_rate == 25
    for frame, moment in zip(decoded(path), take.moments(), strict=True):
        error = frame[: HEIGHT * 4, : WIDTH * 4].astype(int) - draw(moment, Look(scale=4), 5)
        assert np.abs(error).mean() < 6


def test_a_grey_gif_loses_nothing_and_loops(tmp_path):
    path = tmp_path / "out.gif"
    take = made_up_take()
    assert write_gif(take, path, Look()) == NUM_WINDOWS
    frames = decoded(path)
    assert all(np.array_equal(a, draw(m, Look(), 5)) for a, m in zip(frames, take.moments(), strict=True))
    assert b"NETSCAPE2.0" in path.read_bytes()


def test_a_gif_in_colour_keeps_the_two_hues_apart(tmp_path):
    path = tmp_path / "out.gif"
    take = made_up_take(0, 1)
    look = Look(("events",))
    write_gif(take, path, look)
    wanted = draw(next(take.moments()), look, 5)
    assert np.abs(decoded(path, 3)[0].astype(int) - wanted).max() < 24


def test_frames_are_the_same_pictures_with_a_table_of_their_stamps(tmp_path):
    take = made_up_take(1, 4)
    assert write_frames(take, tmp_path / "frames", Look(("events", "reconstruction"))) == 3
    for moment in take.moments():
        read = cv2.imread(str(tmp_path / f"frames/frame_{moment.window.index:06d}.png"))
        assert np.array_equal(read[..., ::-1], draw(moment, Look(("events", "reconstruction")), 5))
    lines = (tmp_path / "frames/stamps.csv").read_text().splitlines()
    assert lines[1] == f"1,80000,40000,{take.windows[0].num_events}"


def test_a_former_takes_frames_stay_until_a_new_one_can_be_drawn_and_then_none_stays(tmp_path):
    write_frames(made_up_take(3, 5), tmp_path, Look())
    before = {path.name: path.read_bytes() for path in tmp_path.iterdir()}
    assert sorted(before) == ["frame_000003.png", "frame_000004.png", "stamps.csv"]
    blind = Playback(made_up_model(), replace(made_up_recording(), ground_truth=None), made_up_take().windows)
    with pytest.raises(EtnetError, match="no camera frames"):
        write_frames(Take.of(blind, 0, 2), tmp_path, Look(("camera",)))
    assert {path.name: path.read_bytes() for path in tmp_path.iterdir()} == before
    is_begun = (tmp_path / "frame_000000.png").exists
    with pytest.raises(Cancelled):
        write_frames(made_up_take(0, 2), tmp_path, Look(), is_cancelled=is_begun)
    assert [path.name for path in tmp_path.iterdir()] == ["frame_000000.png"], "without a table it is not finished"
    write_frames(made_up_take(0, 2), tmp_path, Look())
    assert sorted(path.name for path in tmp_path.iterdir()) == ["frame_000000.png", "frame_000001.png", "stamps.csv"]


@pytest.mark.parametrize(("writer", "name"), [(write_video, "v.mp4"), (write_gif, "v.gif")])
@pytest.mark.parametrize("panels", [("reconstruction",), ("events", "camera")])
def test_a_video_with_timestamps_has_one_size_however_long_its_lines(tmp_path, writer, name, panels):
    model, recording = made_up_model(), made_up_recording()
    windows = [Window(0, 0, 1, 9_940_000, 9_980_000), Window(1, 1, 1_400, 9_980_000, 10_020_000)]
    take = Take.of(Playback(model, recording, windows))
    look = Look(panels, scale=4 // len(panels), has_stamps=True)
    pictures = [draw(moment, look, 12_345) for moment in take.moments()]
    assert pictures[0].shape == pictures[1].shape
    writer(take, tmp_path / name, look)
    assert len(decoded(tmp_path / name)) >= 2


@pytest.mark.parametrize(("writer", "name"), [(write_video, "v.mp4"), (write_gif, "v.gif")])
def test_a_cancelled_export_leaves_no_file_and_keeps_the_old_one(tmp_path, writer, name):
    (tmp_path / name).write_bytes(b"old")
    calls = iter(range(100))
    with pytest.raises(Cancelled):
        writer(made_up_take(), tmp_path / name, Look(), is_cancelled=lambda: next(calls) > 4)
    assert [path.name for path in tmp_path.iterdir()] == [name]
    assert (tmp_path / name).read_bytes() == b"old"


@pytest.mark.parametrize("wrong", [{"panels": ()}, {"scale": 0}, {"gamma": 0.0}])
def test_a_look_that_cannot_be_drawn_is_refused(wrong):
    with pytest.raises(EtnetError):
        Look(**wrong)

"""Runs side by side in a picture: at one moment of time, each with its name, as frames, differences or errors."""

from dataclasses import replace

import numpy as np
import pytest

from etnet.errors import RecordingError
from etnet.events.recording import recording_of_events
from etnet.export.compared import GAP, LIMIT, Runs, RunTitle
from etnet.export.images import to_uint8
from etnet.export.pictures import Look, draw
from etnet.export.take import Beside, Take
from etnet.export.video import write_gif, write_video
from etnet.playback.playback import Playback
from etnet.render.colours import RUNS, diverge
from etnet.windows import BetweenFrames, ByDuration, from_window, plan_windows
from tests.export.recordings_made_up import SENSOR, made_up_model, made_up_recording, made_up_take
from tests.export.test_pictures import decoded

WIDTH, HEIGHT, SCALE = SENSOR.width, SENSOR.height, 3


def compared_take(policy=None, first=0, recording=None, frame_offset=0):
    """Run A between frames; run B in windows of its own, from a window of its own."""
    take = made_up_take(recording=recording)
    windows = plan_windows(take.recording, policy or ByDuration(16_000))
    windows = from_window(windows, first)
    return replace(
        take, beside=(Beside(Playback(made_up_model(), take.recording, windows)),), frame_offset=frame_offset
    )


def look(sight="frames", panels=("reconstruction", "camera"), num=2, camera_error=None, **more):
    titles = tuple(RunTitle(f"network {number}", "settings") for number in range(num))
    return Look(panels, scale=SCALE, runs=Runs(titles, sight, camera_error), **more)


def cells(picture, num_columns, num_rows=1):
    """The pictures below the titles, at their own size."""
    width, height = WIDTH * SCALE, (picture.shape[0] - GAP * (num_rows - 1)) // num_rows
    found = []
    for row in range(num_rows):
        for column in range(num_columns):
            x, bottom = column * (width + GAP), row * (height + GAP) + height
            found.append(picture[bottom - HEIGHT * SCALE : bottom : SCALE, x : x + width : SCALE])
    return found


def grey(frame):
    return to_uint8(frame)[..., None].repeat(3, axis=2)


def test_every_run_shows_its_window_that_ends_nearest_to_the_moment():
    take = compared_take()
    plan = take.beside[0].playback.windows
    for moment in take.moments():
        (other,) = moment.beside
        apart = [abs(window.t_stop - moment.window.t_stop) for window in plan]
        assert abs(other.window.t_stop - moment.window.t_stop) == min(apart)
        a, b, camera = cells(draw(moment, look(), 5), 3)
        assert np.array_equal(a, grey(moment.frame))
        assert np.array_equal(b, grey(take.beside[0].playback.at(other.window.index).frame[0, 0].numpy()))
        assert np.array_equal(camera, grey(moment.camera))


def test_a_run_of_the_same_plan_shows_the_same_window_though_others_end_at_its_stamp():
    take = made_up_take()
    windows = [replace(window, t_stop=80_000, t_start=0) for window in take.playback.windows]
    twin = Playback(made_up_model(), take.recording, windows)
    same = replace(Take(twin, 0, len(windows)), beside=(Beside(twin, is_same_plan=True),))
    assert [moment.beside[0].window.index for moment in same.moments()] == [
        moment.window.index for moment in same.moments()
    ]


def test_a_run_from_a_cold_start_has_seen_nothing_before_it():
    cold = compared_take(BetweenFrames(), first=2)
    moments = list(cold.moments())
    whole = list(made_up_take().moments())
    assert not np.array_equal(moments[3].beside[0].frame, whole[3].frame)
    assert moments[3].beside[0].window.t_stop == whole[3].window.t_stop


@pytest.mark.parametrize("camera_error", [None, 1])
def test_differences_and_errors_are_of_raw_frames_on_one_scale(camera_error):
    moment = next(compared_take().moments())
    (other,) = moment.beside
    a, b, camera = cells(draw(moment, look("difference", camera_error=camera_error), 5), 3)
    assert np.array_equal(a, grey(moment.frame))
    assert np.array_equal(b, diverge(other.frame - moment.frame, LIMIT))
    shown = grey(moment.camera) if camera_error is None else diverge(other.frame - other.camera, LIMIT)
    assert np.array_equal(camera, shown)
    a, b, _ = cells(draw(moment, look("error"), 5), 3)
    assert np.array_equal(a, diverge(moment.frame - moment.camera, LIMIT))
    assert np.array_equal(b, diverge(other.frame - other.camera, LIMIT))


def test_an_error_without_a_camera_is_refused_with_a_way_out():
    recording = recording_of_events(made_up_recording().read(0, 600), "no camera")
    windows = plan_windows(recording, ByDuration(20_000))
    playback = Playback(made_up_model(), recording, windows)
    take = replace(Take.of(playback), beside=(Beside(playback, is_same_plan=True),))
    with pytest.raises(RecordingError, match="no camera frames of the sensor's size"):
        draw(next(take.moments()), look("error", ("reconstruction",)), 5)


def test_an_offset_of_the_frames_clock_chooses_another_camera_frame():
    truth = made_up_recording().ground_truth
    for offset, shift in ((0, 0), (40_000, -1)):
        moment = list(compared_take(frame_offset=offset).moments())[2]
        at = truth.nearest(moment.window.t_stop) + shift
        assert np.array_equal(moment.camera, truth.read_frame(at))
        assert moment.camera_lag == 0


def test_names_stand_above_the_pictures_in_their_hues_and_say_what_ends_at_another_time():
    take = compared_take()
    moment = next(take.moments())
    picture = draw(moment, look(num=2), 5)
    strip = picture[: picture.shape[0] - HEIGHT * SCALE]
    second = strip[:, WIDTH * SCALE + GAP : 2 * WIDTH * SCALE + GAP]
    assert (second == RUNS[1]).all(axis=-1).any()
    assert not (strip[:, : WIDTH * SCALE] == RUNS[1]).all(axis=-1).any()
    apart = moment.beside[0].window.t_stop - moment.window.t_stop
    assert abs(apart) > 1_000
    exact = replace(moment, beside=(replace(moment.beside[0], window=moment.window),))
    right = slice(second.shape[1] // 2, None)
    unsaid = draw(exact, look(num=2), 5)[: strip.shape[0], WIDTH * SCALE + GAP : 2 * WIDTH * SCALE + GAP]
    low = strip.shape[0] // 2
    assert second[low:, right].max() > 100 > unsaid[low:, right].max()


def test_a_run_keeps_its_letter_where_another_one_is_left_out():
    moment = next(compared_take().moments())
    shown = look(num=2)
    picture = draw(moment, replace(shown, runs=replace(shown.runs, numbers=(0, 2))), 5)
    strip = picture[: picture.shape[0] - HEIGHT * SCALE, WIDTH * SCALE + GAP : 2 * WIDTH * SCALE + GAP]
    assert (strip == RUNS[2]).all(axis=-1).any()
    assert not (strip == RUNS[1]).all(axis=-1).any()


@pytest.mark.parametrize(("num_runs", "num_columns", "num_rows"), [(2, 3, 1), (3, 2, 2), (4, 3, 2)])
def test_more_than_three_pictures_stand_in_two_rows(num_runs, num_columns, num_rows):
    take = made_up_take()
    beside = tuple(Beside(take.playback, is_same_plan=True) for _ in range(num_runs - 1))
    moment = next(replace(take, beside=beside).moments())
    picture = draw(moment, look(num=num_runs), 5)
    assert picture.shape[1] == num_columns * WIDTH * SCALE + (num_columns - 1) * GAP
    found = cells(picture, num_columns, num_rows)
    assert all(np.array_equal(cell, grey(moment.frame)) for cell in found[:num_runs])
    assert np.array_equal(found[num_runs], grey(moment.camera))


@pytest.mark.parametrize(("writer", "name"), [(write_video, "v.mp4"), (write_gif, "v.gif")])
def test_a_film_of_runs_has_one_size_and_every_moment(tmp_path, writer, name):
    take = compared_take()
    shown = look(has_stamps=True)
    assert writer(take, tmp_path / name, shown) == len(take)
    for frame, moment in zip(decoded(tmp_path / name, 3), take.moments(), strict=True):
        wanted = draw(moment, shown, 5)
        assert np.abs(frame[: wanted.shape[0], : wanted.shape[1]].astype(int) - wanted).mean() < 8

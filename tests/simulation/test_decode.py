"""Films as people have them: their own times, upright, progressive, in their own tone and depth."""

import av
import cv2
import numpy as np
import pytest

from etnet.errors import RecordingError
from etnet.events.open import open_recording
from etnet.simulation.decode import VideoFootage
from etnet.simulation.footage import Framing
from etnet.simulation.tone import Tone
from etnet.simulation.video import VideoConfig, simulate_footage
from tests.simulation.films import drifting, write_film


def watched(path, **options):
    footage = VideoFootage(path, **options)
    frames = list(footage)
    footage.close()
    return footage, frames


def said(footage, words):
    return any(words in text for text in footage.remarks)


def codes(footage, frame):
    return footage.tone.code(frame.light) * 255


def test_frames_of_a_variable_rate_keep_their_own_times(tmp_path):
    stamps = np.concatenate([np.arange(10) * 0.033, 0.297 + np.arange(1, 11) * 0.1])
    footage, frames = watched(write_film(tmp_path / "phone.mp4", drifting(20), stamps.tolist()))
    assert np.allclose([frame.t for frame in frames], stamps * 1e6, atol=1_001)
    assert said(footage, "variable rate")


def test_an_even_rate_is_not_called_variable(tmp_path):
    footage, _ = watched(write_film(tmp_path / "even.mp4", drifting(8)))
    assert not said(footage, "variable rate")
    assert not said(footage, "repeat")


def test_a_turned_film_stands_upright(tmp_path):
    corner = np.zeros((48, 64), np.uint8)
    corner[:12, :20] = 255
    footage, frames = watched(write_film(tmp_path / "turned.mp4", [corner] * 3, rotation=90))
    assert frames[0].light.shape == (64, 48)
    assert frames[0].light[-6:, :6].mean() > 0.8 > 0.2 > frames[0].light[:6, :6].mean()
    assert said(footage, "turned upright")


def interlaced(path, fields, begins=0.0, is_top_first=True):
    """A film of 25 frames a second, each of two fields of 1/50 s."""
    is_first = (np.arange(48) % 2 == (0 if is_top_first else 1))[:, None]
    woven = [np.where(is_first, first, second) for first, second in zip(fields[::2], fields[1::2], strict=True)]
    stamps = [begins + i / 25 for i in range(len(woven))]
    return write_film(path, woven, stamps, options={"crf": "6"}, fields="tff" if is_top_first else "bff")


@pytest.mark.parametrize("is_top_first", [True, False])
def test_interlaced_fields_become_frames_in_their_order_and_it_is_said(tmp_path, is_top_first):
    fields = drifting(24, speed=3.0)
    footage, frames = watched(interlaced(tmp_path / "tv.mp4", fields, is_top_first=is_top_first))
    assert said(footage, "interlaced: each field")
    assert np.allclose(np.diff([frame.t for frame in frames]), 20_000, atol=1)
    middle = frames[4:20]
    error = [np.abs(codes(footage, frame) - fields[i]).mean() for i, frame in enumerate(middle, start=4)]
    assert max(error) < 3  # the waves move by 3 pixels from field to field: one field off would be 15


def test_a_film_that_is_interlaced_from_its_middle_on_is_de_interlaced_there(tmp_path):
    plain, fields = drifting(10, speed=3.0), drifting(24, speed=3.0)
    first = write_film(tmp_path / "a.ts", plain, [i / 25 for i in range(10)], options={"crf": "6"})
    second = interlaced(tmp_path / "b.ts", fields, begins=0.6)
    (tmp_path / "both.ts").write_bytes(first.read_bytes() + second.read_bytes())
    footage, frames = watched(tmp_path / "both.ts")
    assert said(footage, "(12 of 22 frames are): each field became a frame")
    assert len(frames) == 10 + 24
    stamps = np.array([frame.t for frame in frames])
    assert np.allclose(np.diff(stamps[:10]), 40_000, atol=1_001)
    assert np.allclose(np.diff(stamps[10:]), 20_000, atol=1_001)
    for shown, seen in ((plain, frames[:10]), (fields, frames[10:])):
        assert max(np.abs(codes(footage, frame) - one).mean() for frame, one in zip(seen, shown, strict=True)) < 3


@pytest.mark.parametrize(
    ("name", "codec", "pixels", "kind", "bits", "close"),
    [
        ("av1.mp4", "libsvtav1", "yuv420p", np.uint8, 8, 3.0),
        ("ten.mkv", "ffv1", "yuv420p10le", np.uint16, 10, 0.2),
        ("sixteen.mkv", "ffv1", "gray16le", np.uint16, 16, 0.002),
    ],
)
def test_codecs_and_depths_are_read_as_they_are(tmp_path, name, codec, pixels, kind, bits, close):
    pictures = drifting(6, kind=kind)
    footage, frames = watched(write_film(tmp_path / name, pictures, codec=codec, pixels=pixels))
    assert footage.bits == bits
    assert len(frames) == 6
    whole = np.iinfo(kind).max / 255
    assert np.abs(codes(footage, frames[0]) - pictures[0] / whole).mean() < close


@pytest.mark.parametrize(
    ("transfer", "tone"), [(1, Tone("bt709")), (13, Tone("srgb")), (16, Tone("pq")), (18, Tone("hlg")), (4, Tone())]
)
def test_the_tone_is_what_the_file_states(tmp_path, transfer, tone):
    footage, _ = watched(write_film(tmp_path / "stated.mp4", drifting(3), transfer=transfer))
    assert footage.tone == tone
    assert not said(footage, "states no transfer curve")


def test_a_tone_that_is_not_stated_is_assumed_and_said(tmp_path):
    footage, _ = watched(write_film(tmp_path / "plain.mp4", drifting(3)), gamma=1.8)
    assert footage.tone == Tone("gamma", 1.8)
    assert said(footage, "states no transfer curve; taken as gamma 1.8")


@pytest.mark.parametrize("curve", ["bt709", "srgb", "pq", "hlg", "linear", "gamma"])
def test_light_and_code_are_inverse_and_ascend(curve):
    tone, code = Tone(curve), np.linspace(0, 1, 1001)
    light = tone.light(code)
    assert (np.diff(light) > 0).all()
    assert np.allclose(tone.code(light), code, atol=3e-4)  # the two parts of BT.709 meet roughly
    assert light[-1] == pytest.approx({"pq": 10_000 / 203, "hlg": 1 / 0.265}.get(curve, 1.0), rel=0.01)


def test_a_gif_is_told_apart(tmp_path):
    pictures = [np.stack([picture] * 3, 2) for picture in drifting(6)]
    footage, frames = watched(write_film(tmp_path / "a.gif", pictures, 25.0, "gif", "rgb8"))
    assert len(frames) == 6
    assert said(footage, "GIF")


def test_repeated_frames_are_counted_and_left_out_on_request(tmp_path):
    twice = [picture for picture in drifting(6) for _ in range(2)]
    path = write_film(tmp_path / "screen.mkv", twice, codec="ffv1", pixels="gray")
    footage, frames = watched(path)
    assert (len(frames), said(footage, "6 of 12 frames repeat")) == (12, True)
    footage, frames = watched(path, drops_repeats=True)
    assert [round(frame.t / 1e6 * 30) for frame in frames] == [0, 2, 4, 6, 8, 10]


def test_an_encoder_does_not_hide_repeats_and_slow_motion_is_none(tmp_path):
    pictures = drifting(6, 3.0, (96, 72))
    twice = [picture for picture in pictures for _ in range(2)]
    footage, frames = watched(write_film(tmp_path / "telecine.mp4", twice), drops_repeats=True)
    assert said(footage, "6 of 12 frames repeat")
    assert len(frames) == 6
    footage, _ = watched(write_film(tmp_path / "slow.mkv", drifting(6, 0.1), codec="ffv1", pixels="gray"))
    assert not said(footage, "repeat")


def test_a_film_whose_pictures_change_their_size_midway_is_seen_to_its_end_and_it_is_said(tmp_path):
    large = [cv2.resize(picture, (128, 96)) for picture in drifting(6)]
    first = write_film(tmp_path / "a.ts", drifting(6), [i / 25 for i in range(6)])
    second = write_film(tmp_path / "b.ts", large, [0.4 + i / 25 for i in range(6)])
    (tmp_path / "both.ts").write_bytes(first.read_bytes() + second.read_bytes())
    footage, frames = watched(tmp_path / "both.ts")
    assert [frame.light.shape for frame in frames] == [(48, 64)] * 12
    assert sum("change their size, from 64×48 to 128×96" in text for text in footage.remarks) == 1
    assert not said(footage, "repeat")


def test_a_part_beyond_the_end_says_how_long_the_film_is(tmp_path):
    path = write_film(tmp_path / "a.mp4", drifting(6))
    with pytest.raises(RecordingError, match=r"has 0 frames from 5 s, and is 0.2 s long; events need two"):
        watched(path, framing=Framing(start=5.0))


def test_an_mp4_without_its_index_and_an_empty_file_are_told_as_what_they_are(tmp_path):
    content = write_film(tmp_path / "whole.mp4", drifting(30, size=(320, 240))).read_bytes()
    (tmp_path / "half.mp4").write_bytes(content[: len(content) // 2])
    with pytest.raises(RecordingError, match=r"half.mp4: ends before its index.*copy it again"):
        VideoFootage(tmp_path / "half.mp4")
    (tmp_path / "empty.mp4").touch()
    with pytest.raises(RecordingError, match=r"empty.mp4: is empty"):
        VideoFootage(tmp_path / "empty.mp4")


def test_a_film_that_breaks_off_is_used_up_to_there_and_said(tmp_path):
    path = write_film(tmp_path / "whole.mkv", drifting(200, size=(320, 240)), options={"g": "10"})
    content = path.read_bytes()
    (tmp_path / "half.mkv").write_bytes(content[: len(content) // 2])
    footage, frames = watched(tmp_path / "half.mkv")
    assert 20 < len(frames) < 150
    assert said(footage, "breaks off")
    (tmp_path / "half.mp4").write_bytes(content[: len(content) // 50])
    with pytest.raises(RecordingError, match=r"half.mp4: (cannot be read|holds 0 frames)"):
        watched(tmp_path / "half.mp4")


def test_a_film_of_one_frame_is_one_line(tmp_path):
    path = write_film(tmp_path / "one.mp4", drifting(1))
    with pytest.raises(RecordingError, match=r"one.mp4: holds 1 frame that can be read; events need two"):
        watched(path)


def test_a_cut_in_a_film_starts_the_sensor_anew_and_is_said(tmp_path):
    first = drifting(8, 2.0, (96, 72))
    rng = np.random.default_rng(0)
    other = cv2.GaussianBlur(rng.random((72, 120), np.float32), (0, 0), 3)
    other = np.rint(200 + 55 * (other - other.min()) / np.ptp(other)).astype(np.uint8)
    second = [other[:, i : i + 96] for i in range(8)]
    path = write_film(tmp_path / "cut.mp4", first + second, options={"crf": "10"})
    footage = VideoFootage(path)
    written = simulate_footage(footage, tmp_path / "cut.h5", VideoConfig(noise=0.0))
    assert any("1 cut, at 0.27 s: the sensor starts again" in text for text in written.remarks)
    with open_recording(tmp_path / "cut.h5") as recording:
        t = recording.read(0, recording.num_events).t
    before, over, after = (((t >= a) & (t < a + 33_333)).sum() for a in (200_000, 233_334, 266_667))
    assert over == 0 < min(before, after)


def test_what_holds_no_picture_is_one_line(tmp_path):
    with av.open(str(tmp_path / "sound.wav"), "w") as container:
        stream = container.add_stream("pcm_s16le", rate=8000)
        frame = av.AudioFrame.from_ndarray(np.zeros((1, 800), np.int16), layout="mono")
        frame.sample_rate = 8000
        container.mux(stream.encode(frame))
    with pytest.raises(RecordingError, match="holds no video stream"):
        VideoFootage(tmp_path / "sound.wav")


def test_4k_is_brought_to_the_sensor_as_light(tmp_path):
    checks = (np.indices((2160, 3840)).sum(0) % 2 * 255).astype(np.uint8)
    path = write_film(tmp_path / "large.mkv", [checks] * 2, codec="ffv1", pixels="gray")
    _, frames = watched(path, framing=Framing(longest_side=320))
    assert frames[0].light.shape == (180, 320)
    assert np.abs(frames[0].light - 0.5).max() < 0.01  # half of it is white; its code values would average to .22


def test_a_part_is_cropped_turned_and_cut_out(tmp_path):
    pictures = drifting(30)
    path = write_film(tmp_path / "a.mkv", pictures, codec="ffv1", pixels="gray")
    framing = Framing(crop=(8, 4, 32, 20), rotate=90, start=0.2, stop=0.5)
    footage, frames = watched(path, framing=framing)
    assert frames[0].light.shape == (32, 20)
    assert len(frames) == 10
    assert np.abs(codes(footage, frames[0]) - np.rot90(pictures[6][4:24, 8:40], -1)).max() < 0.01
    sensor = VideoFootage(path, Framing(size=(40, 40))).sensor
    assert (sensor.width, sensor.height) == (40, 40)
    with pytest.raises(RecordingError, match="leaves them"):
        VideoFootage(path, Framing(crop=(0, 0, 100, 10)))


def test_colour_comes_along_when_asked_for(tmp_path):
    red = np.zeros((48, 64, 3), np.uint8)
    red[..., 0] = 200
    _, frames = watched(write_film(tmp_path / "red.mkv", [red] * 2, codec="ffv1", pixels="bgr0"), has_colour=True)
    assert frames[0].colour.shape == (48, 64, 3)
    assert np.abs(frames[0].colour[0, 0].astype(int) - [0, 0, 200]).max() <= 1

"""The pictures and the motion that cameras write between their events, from bytes as the formats describe them."""

from __future__ import annotations

import numpy as np
import pytest

from etnet.events.formats.aedat import aedat2
from etnet.events.open import open_recording
from tests.events.containers import all_events
from tests.real_data import real_file

WIDTH, HEIGHT = 240, 180
HEADER = b"#!AER-DAT2.0\r\n# AEChip: eu.seebetter.ini.chips.davis.Davis240C\r\n"


def reads(kind, values, t):
    """Words of one read of the whole picture, column by column from the right: an order of jAER's chips."""
    x, row = np.meshgrid(np.arange(WIDTH)[::-1], np.arange(HEIGHT), indexing="ij")
    # jAER counts rows from the bottom.
    level = values[HEIGHT - 1 - row, x]
    words = 1 << 31 | row.astype(np.int64) << 22 | x << 12 | kind << 10 | level
    stamps = t + np.arange(WIDTH)[:, None] * 10 + np.zeros_like(words)
    return np.stack([words, stamps], 2)


def picture(rng):
    """A reset level for each pixel, and what light takes from it."""
    reset = rng.integers(700, 1024, (HEIGHT, WIDTH))
    return reset, reset - rng.integers(0, 700, (HEIGHT, WIDTH))


def global_shutter(pictures):
    """All resets, the exposure, all signals."""
    parts = []
    for i, (reset, signal) in enumerate(pictures):
        parts += [reads(0, reset, 40_000 * i), reads(1, signal, 40_000 * i + 9000)]
    return np.concatenate([part.reshape(-1, 2) for part in parts])


def rolling_shutter(pictures):
    """The signals of a column follow its resets by three columns."""
    columns = []
    for i, (reset, signal) in enumerate(pictures):
        first, second = reads(0, reset, 40_000 * i), reads(1, signal, 40_000 * i + 30)
        for column in range(WIDTH + 3):
            columns += [first[column]] if column < WIDTH else []
            columns += [second[column - 3]] if column >= 3 else []
    return np.concatenate(columns)


def with_events(words):
    """An event after every 1,000th word."""
    places = np.arange(0, len(words), 1000)
    events = np.stack([7 << 22 | 5 << 12 | (places % 2) << 11, words[places, 1]], 1)
    return np.insert(words, places + 1, events, axis=0), len(places)


def saved(path, words):
    words = words[np.argsort(words[:, 1], kind="stable")]
    path.write_bytes(HEADER + (words & 0xFFFFFFFF).astype(">u4").tobytes())
    return path


@pytest.mark.parametrize(
    ("shutter", "block"), [(global_shutter, 1 << 17), (global_shutter, 20_011), (rolling_shutter, 1 << 17)]
)
def test_pictures_of_a_davis_come_back_whatever_the_shutter(shutter, block, tmp_path, monkeypatch):
    monkeypatch.setattr(aedat2, "_BLOCK", block)
    rng = np.random.default_rng(0)
    pictures = [picture(rng) for _ in range(4)]
    words, num_events = with_events(shutter(pictures))
    # The file begins and ends within a picture.
    path = saved(tmp_path / "a.aedat", words[60_000:-30_000])
    with open_recording(path) as recording:
        assert 0 < len(all_events(recording)) < num_events
        truth = recording.ground_truth
        assert len(truth) == 2
        for index, (reset, signal) in enumerate(pictures[1:3], 1):
            np.testing.assert_allclose(truth.read_frame(index - 1), (reset - signal) / 1023, atol=2**-15)
            middle = 40_000 * index + 10 * (WIDTH - 1) / 2 + (4500 if shutter is global_shutter else 15)
            assert truth.stamps[index - 1] == pytest.approx(middle, abs=1)
        assert any("not read out whole" in remark.text for remark in recording.remarks)


def test_events_and_pictures_of_a_davis_show_the_scene_the_same_way_round(tmp_path):
    reset, signal = np.full((HEIGHT, WIDTH), 900), np.full((HEIGHT, WIDTH), 800)
    signal[30:40, 20:30] = 200
    # The picture's x is as stored, an event's is counted from the right, y of both from the bottom.
    t = np.arange(90_000, 90_100)
    events = np.stack([(HEIGHT - 1 - 35) << 22 | (WIDTH - 1 - 25) << 12 | 1 << 11 | 0 * t, t], 1)
    words = np.concatenate([global_shutter([(reset, signal)] * 2), events])
    with open_recording(saved(tmp_path / "a.aedat", words)) as recording:
        found, frame = all_events(recording), recording.ground_truth.read_frame(0)
    rows, columns = np.nonzero(frame > 0.5)
    assert (columns.min(), columns.max(), rows.min(), rows.max()) == (20, 29, 30, 39)
    assert set(found.x.tolist()) == {25}
    assert set(found.y.tolist()) == {35}


def test_motion_of_a_davis_is_read_in_g_and_degrees_a_second(tmp_path):
    rng = np.random.default_rng(1)
    values = rng.integers(-(1 << 15), 1 << 15, (300, 7))
    words = [
        (1 << 31 | axis << 28 | (int(v) & 0xFFFF) << 12 | 3 << 10, 1000 * i)
        for i, row in enumerate(values)
        for axis, v in enumerate(row)
    ]
    # The first words belong to a sample that began before the file, and one sample lacks its third word.
    words = [word for place, word in enumerate(words) if place >= 3 and place != 7 * 100 + 2]
    words, _ = with_events(np.array(words))
    with open_recording(saved(tmp_path / "a.aedat", words)) as recording:
        motion = recording.inertial
        kept = np.delete(np.arange(300), [0, 100])
        np.testing.assert_array_equal(motion.stamps, 1000 * kept)
        np.testing.assert_allclose(motion.acceleration, values[kept, :3] / 8192, rtol=1e-6)
        np.testing.assert_allclose(motion.rotation, values[kept, 4:] / 65.5, rtol=1e-6)


@pytest.mark.real
@pytest.mark.parametrize(
    ("name", "num_samples"),
    [
        ("aedat4/davis346_street_0.17s.aedat4", 160),
        ("aedat4/dvxplorer_lite_face_headphones_1.5s.aedat4", 1176),
    ],
)
def test_a_real_camera_feels_the_weight_of_the_earth(name, num_samples):
    with open_recording(real_file(name)) as recording:
        motion = recording.inertial
        assert len(motion) == num_samples
        assert np.median(np.linalg.norm(motion.acceleration, axis=1)) == pytest.approx(1, abs=0.1)
        assert (np.diff(motion.stamps) >= 0).all()
        assert recording.span.start - 50_000 < motion.stamps[0] < motion.stamps[-1] < recording.span.stop + 50_000

"""Written recordings against the layout's documentation, read back with h5py alone."""

import json
from itertools import pairwise

import cv2
import h5py
import numpy as np
import pytest

from etnet.errors import RecordingError
from etnet.events.events import Events, Sensor
from etnet.events.open import open_recording
from etnet.simulation.config import SequenceConfig
from etnet.simulation.dataset import write_dataset
from etnet.simulation.pictures import PicturePool, is_held_out
from etnet.simulation.sequence import simulate_sequence
from etnet.simulation.sink import RecordingSink
from etnet.simulation.write import Take, take_of, write_take
from etnet.windows import BetweenFrames, plan_windows
from tests.simulation.pictures_made_up import made_up_pool
from tests.strategies import make_events

POOL = made_up_pool()
CONFIG = SequenceConfig(size=(40, 56), num_windows=6)


def test_a_written_clip_reads_back_the_same(tmp_path):
    sequence = simulate_sequence(POOL, CONFIG, np.random.default_rng(0))
    write_take(tmp_path / "a.h5", take_of(sequence), {"source": "test"})
    events = sequence.events
    with h5py.File(tmp_path / "a.h5") as file:
        assert np.array_equal(file["events/xs"], events.x)
        assert np.array_equal(file["events/ys"], events.y)
        assert np.array_equal(np.rint(file["events/ts"][:] * 1e6).astype(int), events.t)
        assert np.array_equal(file["events/ps"][:] * 2 - 1, events.p)
        assert file["events/ps"].dtype == bool
        assert tuple(file.attrs["sensor_resolution"]) == (40, 56)
        assert file.attrs["num_events"] == len(events) == file.attrs["num_pos"] + file.attrs["num_neg"]
        assert file.attrs["num_imgs"] == file.attrs["num_flow"] == 7 == len(file["images"]) == len(file["flow"])
        for i, edge in enumerate(sequence.window_edges):
            image, flow = file[f"images/image{i:09d}"], file[f"flow/flow{i:09d}"]
            truth = sequence.first_frame if i == 0 else sequence.frames[i - 1]
            assert np.abs(image[()] / 255 - truth).max() <= 0.5 / 255 + 1e-6
            assert round(image.attrs["timestamp"] * 1e6) == round(flow.attrs["timestamp"] * 1e6) == edge
            assert image.attrs["event_idx"] == max(0, np.searchsorted(events.t, edge) - 1)
            if i:
                seconds = (edge - sequence.window_edges[i - 1]) * 1e-6
                assert np.allclose(flow[()] * seconds, sequence.flow[i - 1], atol=1e-4)
            else:
                assert not flow[()].any()


def test_our_own_reader_opens_a_written_clip_with_its_frames_flow_and_windows(tmp_path):
    sequence = simulate_sequence(POOL, CONFIG, np.random.default_rng(0))
    write_take(tmp_path / "a.h5", take_of(sequence), {})
    with open_recording(tmp_path / "a.h5") as recording:
        events = recording.read(0, recording.num_events)
        for column in ("x", "y", "t", "p"):
            assert np.array_equal(getattr(events, column), getattr(sequence.events, column))
        truth = recording.ground_truth
        assert truth is not None
        assert np.array_equal(truth.stamps, sequence.window_edges)
        assert truth.read_flow is not None
        for i in range(6):
            assert np.allclose(truth.read_frame(i + 1), sequence.frames[i], atol=0.5 / 255 + 1e-6)
            assert np.allclose(truth.read_flow(i + 1), sequence.flow[i], atol=1e-4)
        assert not truth.read_flow(0).any()
        windows = plan_windows(recording, BetweenFrames())
        assert [(w.start, w.stop) for w in windows] == list(pairwise(sequence.event_index))


def test_a_recording_without_events_can_be_written(tmp_path):
    take = Take(Events.empty(Sensor(8, 8)), np.array([0, 10]), np.zeros((2, 8, 8), np.uint8))
    write_take(tmp_path / "a.h5", take, {})
    with h5py.File(tmp_path / "a.h5") as file:
        assert file.attrs["num_events"] == 0
        assert "flow" not in file


@pytest.mark.parametrize("name", ["take.h5", "film.h5"])
def test_a_quiet_simulation_is_as_long_when_read_again(name, tmp_path):
    events = make_events(150, Sensor(346, 260), duration=600 * 10**6)
    if name == "take.h5":
        write_take(tmp_path / name, Take(events, np.array([0, 10]), np.zeros((2, 260, 346), np.uint8)), {})
    else:
        with h5py.File(tmp_path / name, "w") as file:
            sink = RecordingSink(file, events.sensor)
            sink.append(events)
            sink.finish({})
    with open_recording(tmp_path / name) as recording:
        assert np.array_equal(recording.read(0, 150).t, events.t)


def test_the_same_take_gives_the_same_bytes_and_a_broken_run_leaves_no_recording(tmp_path):
    take = take_of(simulate_sequence(POOL, CONFIG, np.random.default_rng(0)))
    for name in ("a.h5", "b.h5"):
        write_take(tmp_path / name, take, {"k": 1})
    assert (tmp_path / "a.h5").read_bytes() == (tmp_path / "b.h5").read_bytes()
    with pytest.raises(TypeError):
        write_take(tmp_path / "c.h5", take, {"k": object()})
    assert not (tmp_path / "c.h5").exists()


def test_a_dataset_goes_on_where_it_stopped_and_refuses_other_settings(tmp_path):
    whole = write_dataset(tmp_path / "whole", POOL, CONFIG, 3, seed=5)
    broken = write_dataset(tmp_path / "broken", POOL, CONFIG, 2, seed=5)
    kept = broken[0].stat().st_mtime_ns
    counted = []
    resumed = write_dataset(tmp_path / "broken", POOL, CONFIG, 3, 5, progress=counted.append)
    assert [p.read_bytes() for p in resumed] == [p.read_bytes() for p in whole]
    assert broken[0].stat().st_mtime_ns == kept
    assert counted == [1 / 3, 2 / 3, 1]
    assert whole[0].read_bytes() != whole[1].read_bytes()
    with pytest.raises(RecordingError, match="other settings"):
        write_dataset(tmp_path / "broken", POOL, CONFIG, 3, seed=6)
    whole[0].write_bytes(b"broken")
    with pytest.raises(RecordingError, match="not a readable HDF5"):
        write_dataset(tmp_path / "whole", POOL, CONFIG, 3, seed=5)


def photos_in(folder):
    """Twenty photos, some of them held out, and four objects."""
    rng = np.random.default_rng(0)
    for kind, num, channels in (("photos", 20, 1), ("cutouts", 4, 4)):
        (folder / kind).mkdir(parents=True)
        for i in range(num):
            picture = rng.integers(0, 256, (48, 64, channels), np.uint8)
            assert cv2.imwrite(str(folder / kind / f"{i:02d}.png"), picture)
    return folder / "photos", folder / "cutouts"


def test_no_folder_holds_sequences_of_other_pictures_or_of_another_split(tmp_path):
    photos, cutouts = photos_in(tmp_path)
    pool = PicturePool.from_folder(photos, cutouts, "all")
    (path,) = write_dataset(tmp_path / "data", pool, CONFIG, 1, seed=5)
    kept = path.read_bytes()
    others = [PicturePool.from_folder(photos, cutouts, split) for split in ("train", "held-out")]
    others += [PicturePool.from_folder(photos, None, "all")]
    (photos / "00.png").rename(photos / "a.png")
    others += [PicturePool.from_folder(photos, cutouts, "all")]
    for other in others:
        with pytest.raises(RecordingError, match="other pictures"):
            write_dataset(tmp_path / "data", other, CONFIG, 2, seed=5)
    (photos / "a.png").rename(photos / "00.png")
    again = PicturePool.from_folder(photos, cutouts, "all")
    assert len(write_dataset(tmp_path / "data", again, CONFIG, 2, seed=5)) == 2
    assert path.read_bytes() == kept


def test_a_split_that_holds_the_same_pictures_is_another_one(tmp_path):
    photos, _ = photos_in(tmp_path)
    for path in photos.iterdir():
        if is_held_out(path.name):
            path.unlink()
    write_dataset(tmp_path / "data", PicturePool.from_folder(photos, split="train"), CONFIG, 1, seed=5)
    with pytest.raises(RecordingError, match="other pictures"):
        write_dataset(tmp_path / "data", PicturePool.from_folder(photos, split="all"), CONFIG, 1, seed=5)


def test_a_folder_of_the_former_version_which_told_nothing_of_its_pictures_goes_on(tmp_path):
    photos, _ = photos_in(tmp_path)
    pool = PicturePool.from_folder(photos)
    (path,) = write_dataset(tmp_path / "data", pool, CONFIG, 1, seed=5)
    with h5py.File(path, "r+") as file:
        settings = json.loads(file.attrs["settings"])
        former = {name: settings[name] for name in ("seed", "flow", "config")}
        file.attrs["settings"] = json.dumps(former, sort_keys=True)
    assert len(write_dataset(tmp_path / "data", pool, CONFIG, 2, seed=5)) == 2
    with pytest.raises(RecordingError, match="other settings"):
        write_dataset(tmp_path / "data", pool, CONFIG, 2, seed=6)


def test_a_recording_of_a_dataset_tells_its_settings_when_it_is_opened(tmp_path):
    (path,) = write_dataset(tmp_path, POOL, CONFIG, 1, seed=5)
    with open_recording(path) as recording:
        assert any('"seed": 5' in remark.text and '"num_windows": 6' in remark.text for remark in recording.remarks)

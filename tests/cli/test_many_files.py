"""convert-events, cut and simulate take many files: each once, a failure is named and ends nothing else."""

import json

import cv2
import pytest

from etnet.cli.main import main
from etnet.events.open import open_recording
from etnet.events.recording import recording_of_events
from etnet.events.write import write_recording
from etnet.simulation.dataset import write_dataset
from tests.simulation.films import drifting, write_film
from tests.simulation.pictures_made_up import made_up_pool
from tests.strategies import make_events


@pytest.fixture
def recordings(tmp_path):
    folder = tmp_path / "in"
    (folder / "deep").mkdir(parents=True)
    for name, num_events in (("a.h5", 300), ("b.npz", 400), ("deep/c.h5", 500)):
        write_recording(recording_of_events(make_events(num_events)), folder / name)
    return folder


def run(*words) -> int:
    return main([str(word) for word in words])


def counts(out, suffix=".h5"):
    """Events of each file, by its name."""
    found = {}
    for path in sorted(out.glob(f"*/*{suffix}")):
        with open_recording(path) as recording:
            found[path.stem] = recording.num_events
    return found


def test_a_folder_of_recordings_becomes_a_folder_of_files(recordings, tmp_path, capsys):
    (recordings / "broken.h5").write_bytes(b"\x89HDF\r\n\x1a\n and no more")
    out = tmp_path / "out"
    assert run("convert-events", recordings, out) == 1
    said = capsys.readouterr().err
    assert "3 of 4 recordings are done, 1 failed:" in said
    assert str(recordings / "broken.h5") in said.splitlines()[-1]
    assert counts(out) == {"a": 300, "b": 400, "c": 500}
    assert json.loads((out / "b" / "done.json").read_text())["events"] == 400
    before = (out / "a" / "a.h5").stat().st_mtime_ns
    (recordings / "broken.h5").unlink()
    assert run("convert-events", recordings, out) == 0
    assert (out / "a" / "a.h5").stat().st_mtime_ns == before
    assert run("convert-events", recordings, out, "--overwrite") == 0
    assert (out / "a" / "a.h5").stat().st_mtime_ns > before


def test_named_files_get_the_layout_and_the_filter_that_were_asked_for(recordings, tmp_path):
    given = recordings / "a.h5", recordings / "b.npz", tmp_path / "out"
    assert run("convert-events", *given, "--layout", "aedat4", "--region", 0, 0, 10, 6) == 0
    cropped = counts(tmp_path / "out", ".aedat4")
    assert list(cropped) == ["a", "b"]
    assert 0 < cropped["a"] < 300
    assert run("convert-events", *given, "--layout", "aedat4") == 0
    assert counts(tmp_path / "out", ".aedat4") == {"a": 300, "b": 400}


def test_a_cut_of_many_takes_the_same_stretch_of_each(recordings, tmp_path):
    assert run("cut", recordings, tmp_path / "out", "--to", 0.004) == 0
    for name in ("a", "b", "c"):
        with open_recording(tmp_path / "out" / name / f"{name}.h5") as part:
            assert part.num_events > 0
            assert part.span.duration < 4_000


def test_many_recordings_do_not_go_into_one_file(recordings, tmp_path, capsys):
    assert run("convert-events", recordings / "a.h5", recordings / "b.npz", tmp_path / "all.h5") == 1
    assert "all.h5: names one file, and there are 2 to write; name a folder" in capsys.readouterr().err
    assert run("convert-events", recordings / "a.h5") == 1
    assert "at last, what to write; got 1" in capsys.readouterr().err
    assert not (tmp_path / "all.h5").exists()


def test_two_processes_share_the_files_out(recordings, tmp_path, monkeypatch):
    monkeypatch.setenv("WORLD_SIZE", "2")
    seen = []
    for rank in ("0", "1"):
        monkeypatch.setenv("RANK", rank)
        assert run("convert-events", recordings, tmp_path / "out") == 0
        seen.append(len(counts(tmp_path / "out")))
    assert seen[0] < seen[1] == 3


@pytest.fixture
def videos(tmp_path):
    folder = tmp_path / "videos"
    (folder / "pictures").mkdir(parents=True)
    write_film(folder / "one.mkv", drifting(4, 2.0), codec="ffv1", pixels="gray")
    write_film(folder / "two.mkv", drifting(6, 2.0), codec="ffv1", pixels="gray")
    for i, picture in enumerate(drifting(5, 2.0)):
        cv2.imwrite(str(folder / "pictures" / f"{i}.png"), picture)
    return folder


def test_a_folder_of_videos_becomes_a_folder_of_recordings(videos, tmp_path, capsys):
    (videos / "broken.mp4").write_bytes(b"no video")
    out = tmp_path / "out"
    line = ("simulate", out, "--video", videos, "--pos-thres", 0.3)
    assert run(*line) == 1
    said = capsys.readouterr().err
    assert "2 of 4 recordings are done, 2 failed:" in said
    assert any("broken.mp4" in row for row in said.splitlines()[-2:])
    frames = {name: json.loads((out / name / "done.json").read_text())["frames"] for name in ("one", "two")}
    assert frames == {"one": 4, "two": 6}
    before = (out / "one" / "one.h5").stat().st_mtime_ns
    (videos / "broken.mp4").unlink()
    assert run("simulate", out, "--video", videos / "one.mkv", videos / "two.mkv", "--pos-thres", 0.3) == 0
    assert (out / "one" / "one.h5").stat().st_mtime_ns == before
    assert run("simulate", out, "--video", videos / "one.mkv", videos / "two.mkv", "--pos-thres", 0.4) == 0
    assert (out / "one" / "one.h5").stat().st_mtime_ns > before


def test_pictures_among_videos_are_a_source_of_their_own(videos, tmp_path, capsys):
    stamps = tmp_path / "stamps.csv"
    stamps.write_text("".join(f"{0.02 * i:.2f}\n" for i in range(5)))
    assert run("simulate", tmp_path / "out", "--video", videos / "pictures", "--stamps", stamps) == 1
    assert "no layout is known" in capsys.readouterr().err
    assert run("simulate", tmp_path / "a.h5", "--video", videos / "pictures", "--stamps", stamps) == 0
    assert run("simulate", tmp_path / "b.h5", "--video", videos) == 1
    assert "b.h5: names one file, and there are 3 to write" in capsys.readouterr().err
    cv2.imwrite(str(videos / "a.png"), drifting(1)[0])
    cv2.imwrite(str(videos / "b.png"), drifting(1)[0])
    assert run("simulate", tmp_path / "out", "--video", videos) == 1
    assert "holds 2 pictures and 2 videos; name the videos" in capsys.readouterr().err


def test_every_photo_of_a_folder_is_moved_over(tmp_path):
    photos = tmp_path / "photos"
    photos.mkdir()
    for i in range(2):
        cv2.imwrite(str(photos / f"p{i}.png"), drifting(i + 1, 5.0, (96, 72))[i])
    given = ("--video", photos, "--motion", "saccades", "--layout", "npz", "--reach", 3)
    assert run("simulate", tmp_path / "out", *given) == 0
    assert sorted(counts(tmp_path / "out", ".npz")) == ["p0", "p1"]


def test_a_sequence_of_photos_that_fails_ends_no_other_and_is_named(tmp_path, monkeypatch, capsys):
    for i, photo in enumerate(made_up_pool().photos):
        cv2.imwrite(str(tmp_path / f"{i}.png"), photo)
    out = tmp_path / "out"
    line = f"simulate {out} --photos {tmp_path} --num 3 --seconds 0.1 --size 48 32 --fps 20 --split all --no-flow"
    from etnet.simulation import dataset

    simulated = dataset.simulate_sequence

    def fails_once(pictures, config, rng):
        if len(list(out.glob("*.h5"))) == 1:
            raise MemoryError("no room")
        return simulated(pictures, config, rng)

    monkeypatch.setattr(dataset, "simulate_sequence", fails_once)
    assert main(line.split()) == 1
    said = capsys.readouterr().err
    assert "2 of 3 sequences failed" in said
    assert f"{out / 'sequence_00001.h5'}: MemoryError: no room" in said
    assert [path.name for path in sorted(out.iterdir())] == ["sequence_00000.h5"]
    monkeypatch.setattr(dataset, "simulate_sequence", simulated)
    assert main(line.split()) == 0
    assert [path.name for path in sorted(out.iterdir())] == [f"sequence_0000{i}.h5" for i in range(3)]


def test_a_sequence_that_another_process_is_at_is_left_to_it(tmp_path, monkeypatch):
    from etnet.simulation import dataset
    from etnet.simulation.config import SequenceConfig

    config = SequenceConfig(size=(32, 48), num_windows=2)
    pool, simulated, inner = made_up_pool(), dataset.simulate_sequence, []

    def meanwhile(*arguments):
        if not inner:
            inner.append(())
            inner.append(write_dataset(tmp_path, pool, config, 1, seed=5))
        return simulated(*arguments)

    monkeypatch.setattr(dataset, "simulate_sequence", meanwhile)
    assert len(write_dataset(tmp_path, pool, config, 1, seed=5)) == 1
    assert inner == [(), ()]

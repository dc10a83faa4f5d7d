"""Which recordings a folder stands for: one in several files is one, and what a command wrote is none."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest

from etnet.cli.main import main
from etnet.cli.many import CLAIM, FAILED, jobs_of
from etnet.cli.many_sources import recordings_in
from etnet.events.open import open_recording
from etnet.events.recording import recording_of_events
from etnet.events.write import write_recording
from tests.strategies import make_events

EVENTS = make_events(400)


def columns(part=slice(None)) -> dict[str, np.ndarray]:
    return {"x": EVENTS.x[part], "y": EVENTS.y[part], "t": EVENTS.t[part], "p": (EVENTS.p[part] > 0).astype("u1")}


def save_pieces(folder: Path, follow: bool = True) -> Path:
    """Three numbered files: one recording where they follow one another, else three."""
    folder.mkdir(parents=True)
    for i, part in enumerate(np.array_split(np.arange(len(EVENTS)), 3)):
        np.savez(folder / f"{i:06d}.npz", **columns(part if follow else slice(None)))
    return folder


def save_h5(path: Path) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    write_recording(recording_of_events(EVENTS), path)
    return path


def save_pictures(folder: Path, names: str = "{:06d}.png", count: int = 3) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    for i in range(count):
        assert cv2.imwrite(str(folder / names.format(i)), np.full((12, 20), 9 * i, np.uint8))


def save_output(out: Path) -> Path:
    """As `etnet reconstruct` leaves it for one of several recordings."""
    save_pictures(out / "frames", "frame_{:06d}.png")
    (out / "stamps.csv").write_text("frame,t_stop_us,t_start_us,num_events\n0,10,0,5\n1,20,10,5\n2,30,20,5\n")
    for name in (".etnet-frames", CLAIM):
        (out / name).touch()
    (out / FAILED).write_text("an error of a former run\n")
    return out


def found(folder: Path) -> tuple[Path, ...]:
    return recordings_in((folder,), folder / "out")


@pytest.mark.parametrize("names", [("x", "y", "t", "p"), ("dataset_events_xy", "dataset_events_t", "dataset_events_p")])
def test_a_folder_of_columns_is_one_recording(tmp_path, names):
    given = {**columns(), "xy": np.stack([EVENTS.x, EVENTS.y], 1)}
    folder = tmp_path / "in" / "seq"
    folder.mkdir(parents=True)
    for name in names:
        np.save(folder / f"{name}.npy", given[name.rpartition("_")[2]])
    assert found(folder) == (folder,)
    assert found(tmp_path / "in") == (folder,)


def test_a_folder_of_pieces_is_one_recording_and_one_of_numbered_recordings_is_several(tmp_path):
    pieces, several = save_pieces(tmp_path / "in" / "pieces"), save_pieces(tmp_path / "in" / "takes", follow=False)
    for i in range(2):
        save_h5(tmp_path / "in" / "made" / f"sequence_{i:05d}.h5")
    assert found(pieces) == (pieces,)
    assert len(found(several)) == 3
    assert len(found(tmp_path / "in")) == 1 + 3 + 2


def test_a_recording_is_opened_with_the_pictures_beside_it(tmp_path):
    file, pieces = save_h5(tmp_path / "in" / "a" / "events.h5"), save_pieces(tmp_path / "in" / "b" / "events")
    for folder in (file.parent, pieces.parent):
        save_pictures(folder / "images")
        (folder / "images" / "timestamp.txt").write_text("0.001\n0.02\n0.04\n")
    alone = save_h5(tmp_path / "in" / "c" / "alone.h5")
    assert found(tmp_path / "in") == (file.parent, pieces.parent, alone)
    for folder in (file.parent, pieces.parent):
        assert found(folder) == (folder,)
        with open_recording(folder) as recording:
            assert recording.num_events == len(EVENTS)
            assert recording.ground_truth is not None
            assert len(recording.ground_truth) == 3


def test_what_a_command_wrote_is_no_recording_and_its_frames_no_cameras(tmp_path):
    folder = tmp_path / "in"
    file, _ = save_h5(folder / "a.h5"), save_output(folder / "half" / "a")
    assert found(folder) == (file,)
    save_output(folder)
    assert found(folder) == (file,)
    (made,) = jobs_of([save_h5(tmp_path / "made" / "b" / "b.h5")], tmp_path / "frames")
    (made.path.parent / CLAIM).touch()
    assert found(tmp_path / "made") == (made.path,)


def test_the_cameras_pictures_are_shown_though_frames_of_a_former_run_lie_beside_them(tmp_path):
    folder = save_h5(tmp_path / "in" / "events.h5").parent
    save_pictures(folder / "images" / "left")
    (folder / "images" / "left" / "timestamps.txt").write_text("0.001\n0.02\n0.04\n")
    save_output(folder / "half")
    with open_recording(folder) as recording:
        assert recording.ground_truth is not None
        assert recording.ground_truth.stamps.tolist() == [1_000, 20_000, 40_000]


def test_what_is_written_below_a_recordings_folder_does_not_change_it(tmp_path):
    folder, out = save_pieces(tmp_path / "seq"), tmp_path / "seq" / "out"
    before = jobs_of([folder], out)
    save_output(out / "seq")
    assert jobs_of([folder], out) == before
    assert jobs_of([folder], tmp_path / "elsewhere")[0].nbytes > before[0].nbytes


def test_a_folder_is_not_read_from_and_written_to(tmp_path, capsys):
    folder = save_h5(tmp_path / "in" / "a.h5").parent
    save_h5(folder / "b.h5")
    for line in (
        ["reconstruct", folder, "--out", folder / "." / "out" / ".."],
        ["convert-events", folder, folder],
        ["cut", folder / "a.h5", folder, folder, "--to", "0.01"],
    ):
        (folder / "out").mkdir(exist_ok=True)
        assert main([str(word) for word in line]) == 1
        said = capsys.readouterr().err
        assert "is read from, and what is written there would be read too; name another folder" in said
    assert sorted(path.name for path in folder.iterdir()) == ["a.h5", "b.h5", "out"]

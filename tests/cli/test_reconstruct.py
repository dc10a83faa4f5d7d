"""`etnet reconstruct` gives frames at the moments that somebody wants, named as their tool wants them."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from etnet.cli.main import main
from etnet.cli.reconstruct import Reconstruct, _settings
from etnet.events.events import Sensor
from etnet.events.recording import recording_of_events
from etnet.events.triggers import Triggers
from etnet.events.write import write_recording
from tests.strategies import make_events

STAMPS = (20_000, 45_000, 90_000)


@pytest.fixture(scope="module")
def file(tmp_path_factory):
    path = tmp_path_factory.mktemp("recording") / "a.raw"
    events = make_events(4_000, Sensor(32, 24), duration=100_000)
    events = replace(events, t=events.t - int(events.t[0]))
    stamps = np.array([10_000, 30_000, 50_000])
    triggers = Triggers(stamps, np.array([0, 0, 1], np.int16), np.array([1, -1, 1], np.int8))
    write_recording(replace(recording_of_events(events), triggers=triggers), path)
    return path


def reconstructed(file, out, *options: str) -> tuple[list[str], list[int]]:
    assert main(["reconstruct", str(file), "--out", str(out), "--precision", "fp32", *options]) == 0
    names = sorted(path.name for folder in ("frames", "cam0") for path in (out / folder).glob("*.png"))
    rows = (out / "stamps.csv").read_text().splitlines()[1:]
    return names, [int(row.split(",")[1]) for row in rows]


def table(tmp_path):
    path = tmp_path / "calib.csv"
    path.write_text("#timestamp [ns],name\n" + "".join(f"{1000 * stamp + 17},x\n" for stamp in STAMPS))
    return str(path)


@pytest.mark.parametrize(
    "windows", [[], ["--windows", "duration=5ms"], ["--windows", "count=300"], ["--upsample", "3"]]
)
def test_a_table_of_stamps_gives_one_frame_for_each(file, tmp_path, windows):
    names, stamps = reconstructed(file, tmp_path / "out", "--stamps", table(tmp_path), *windows)
    assert stamps == list(STAMPS)
    assert names == [f"frame_{i:06d}.png" for i in range(3)]
    assert cv2.imread(str(tmp_path / "out/frames" / names[0]), 0).shape == (24, 32)


def test_kalibr_finds_the_frames_by_the_nanoseconds_that_were_given(file, tmp_path):
    names, _ = reconstructed(file, tmp_path / "out", "--stamps", table(tmp_path), "--layout", "kalibr")
    assert [int(name.removesuffix(".png")) for name in names] == [1000 * stamp + 17 for stamp in STAMPS]
    assert {len(name) for name in names} == {19 + len(".png")}
    assert not (tmp_path / "out/video.mp4").exists()


@pytest.mark.parametrize(
    ("chosen", "stamps"),
    [("triggers", [10_000, 30_000, 50_000]), ("triggers=0", [10_000, 30_000]), ("triggers=0/falling", [30_000])],
)
def test_triggers_give_the_moments(file, tmp_path, chosen, stamps):
    assert reconstructed(file, tmp_path / "out", "--stamps", chosen)[1] == stamps


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["--stamps", "triggers=7"], "no such triggers"),
        (["--stamps", "nowhere.csv"], "no such file"),
        (["--stamps", "triggers", "--windows", "density=1"], "duration=20ms or count=10000"),
        (["--upsample", "3"], "--stamps"),
        (["--to", "inf"], "--from and --to take seconds, got inf"),
        (["--from", "nan", "--to", "2"], "--from and --to take seconds, got nan"),
    ],
)
def test_what_cannot_be_is_one_line(file, tmp_path, capsys, options, words):
    assert main(["reconstruct", str(file), "--out", str(tmp_path / "out"), *options]) == 1
    assert words in capsys.readouterr().err


def test_other_stamps_are_other_settings(tmp_path):
    table, folder = tmp_path / "stamps.csv", tmp_path / "cam1"
    folder.mkdir()
    table.write_text("t_us\n100\n")
    picture = folder / "0000000000000100000.png"
    picture.write_bytes(b"picture")

    def settings(stamps: Path | str | None) -> str:
        return _settings(Reconstruct((), tmp_path / "out", stamps=None if stamps is None else str(stamps)))

    before = settings(table), settings(folder)
    assert (settings(table), settings(folder)) == before
    table.write_text("t_us\n100\n200\n")
    picture.rename(folder / "0000000000000200000.png")
    assert settings(table) != before[0]
    assert settings(folder) != before[1]
    assert settings("triggers=0/rising").endswith("speed=1.0)")
    assert settings(None).endswith("speed=1.0)")


def pictures(out):
    return {path.name: path.read_bytes() for path in sorted((out / "frames").glob("*.png"))}


def test_seconds_choose_the_frames_that_are_written_and_they_are_those_of_the_whole_run(file, tmp_path):
    whole, part = tmp_path / "whole", tmp_path / "part"
    _, stamps = reconstructed(file, whole, "--windows", "duration=20ms")
    names, chosen = reconstructed(file, part, "--windows", "duration=20ms", "--from", "0.02", "--to", "0.06")
    assert chosen == [stamp for stamp in stamps if 20_000 < stamp <= 60_000]
    assert names == [f"frame_{stamps.index(stamp):06d}.png" for stamp in chosen]
    assert pictures(part).items() < pictures(whole).items()
    _, moments = reconstructed(file, tmp_path / "moments", "--stamps", table(tmp_path), "--from", "0.03")
    assert moments == [stamp for stamp in STAMPS if stamp > 30_000]
    assert main(["reconstruct", str(file), "--out", str(tmp_path / "none"), "--from", "9"]) == 1


def test_frames_that_are_there_are_replaced_when_asked_alone_and_then_altogether(file, tmp_path, capsys):
    out = tmp_path / "out"
    many, _ = reconstructed(file, out, "--windows", "duration=10ms")
    (out / "frames/mine.png").write_bytes(b"mine")
    before = pictures(out)
    again = ["reconstruct", str(file), "--out", str(out), "--windows", "duration=25ms"]
    assert main(again) == 1
    assert "--overwrite" in capsys.readouterr().err
    assert pictures(out) == before
    assert main([*again, "--overwrite"]) == 0
    left = pictures(out)
    assert left.pop("mine.png") == b"mine"
    assert 0 < len(left) < len(many)
    (out / "stamps.csv").unlink()  # as after a run that was stopped: nothing finished is lost
    assert main(again) == 0

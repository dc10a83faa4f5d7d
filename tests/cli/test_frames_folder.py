"""`etnet reconstruct`, with a camera too, takes away only what it wrote itself, and finished frames only when asked."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from etnet.cli.frames_folder import MARKER, check_frames, make_room
from etnet.cli.main import main
from etnet.cli.reconstruct import Reconstruct
from etnet.errors import EtnetError
from etnet.events.events import Sensor
from etnet.events.recording import recording_of_events
from etnet.events.write import write_recording
from etnet.nets.presets import build_model
from etnet.nets.weights import save_weights
from tests.strategies import make_events

SENSOR = Sensor(32, 24)


@pytest.fixture(scope="module")
def given(tmp_path_factory) -> Path:
    """A folder with a recording of 0.1 s and a network."""
    folder = tmp_path_factory.mktemp("given")
    events = make_events(2_000, SENSOR, duration=100_000)
    write_recording(recording_of_events(replace(events, t=events.t - int(events.t[0]))), folder / "ev.h5")
    save_weights(build_model("tiny"), folder / "tiny.safetensors")
    return folder


def reconstruct(given: Path, out: Path, *options: str) -> int:
    return main(["reconstruct", str(given / "ev.h5"), *_common(given, out), *options])


def live(given: Path, out: Path, *options: str) -> int:
    return main(["reconstruct", "--live", str(given / "ev.h5"), "--speed", "0", *_common(given, out), *options])


def _common(given: Path, out: Path) -> list[str]:
    return ["--out", str(out), "--model", str(given / "tiny.safetensors")]


def below(out: Path) -> dict[str, bytes]:
    return {str(path.relative_to(out)): path.read_bytes() for path in sorted(out.rglob("*")) if path.is_file()}


def put(path: Path) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(b"mine")
    return path


@pytest.mark.parametrize("name", ["stamps.csv", "video.mp4", "frames/frame_000001.png"])
def test_what_was_not_written_by_it_stays_unless_it_may_be_replaced(given, tmp_path, capsys, name):
    put(tmp_path / name)
    put(tmp_path / "frames/mine.png")
    before = below(tmp_path)
    for command in (reconstruct, live):
        assert command(given, tmp_path, "--windows", "duration=50ms") == 1
        said = capsys.readouterr().err
        assert str(tmp_path) in said
        assert "give another --out, or --overwrite" in said
        assert below(tmp_path) == before
    assert reconstruct(given, tmp_path, "--windows", "duration=50ms", "--overwrite") == 0
    after = below(tmp_path)
    assert after["frames/mine.png"] == b"mine"
    assert after.get(name) != b"mine"


@pytest.mark.parametrize("options", [(), ("--overwrite",)])
def test_the_pictures_whose_names_give_the_moments_are_never_taken_away(given, tmp_path, capsys, options):
    pictures = tmp_path / "cam0"
    pictures.mkdir()
    for stamp in (20_000_000, 60_000_000):
        cv2.imwrite(str(pictures / f"{stamp:019d}.png"), np.zeros((4, 4), np.uint8))
    before = below(tmp_path)
    line = ("--stamps", str(tmp_path / "." / "cam0"), "--layout", "kalibr", *options)
    assert reconstruct(given, tmp_path, *line) == 1
    assert "--stamps" in capsys.readouterr().err
    assert below(tmp_path) == before
    assert reconstruct(given, tmp_path / "bag", *line) == 0
    assert below(pictures) == {name.removeprefix("cam0/"): content for name, content in before.items()}


def test_the_table_whose_stamps_give_the_moments_is_never_taken_away(given, tmp_path, capsys):
    out = tmp_path / "out"
    assert reconstruct(given, out, "--windows", "duration=50ms") == 0
    before = below(out)
    line = ("--stamps", str(out / "." / "stamps.csv"), "--overwrite")
    assert reconstruct(given, out, *line) == 1
    assert "what is written would replace it; give another --out" in capsys.readouterr().err
    assert below(out) == before
    assert reconstruct(given, tmp_path / "again", *line) == 0
    assert below(out) == before


@pytest.mark.parametrize("note", ['{"settings": "ConvertEvents(paths=())"}', '{"settings": 1}', "[]", "{", ""])
def test_what_another_command_noted_as_finished_makes_nothing_this_commands_own(given, tmp_path, capsys, note):
    (tmp_path / "done.json").write_text(note)
    film = put(tmp_path / "video.mp4")
    assert reconstruct(given, tmp_path, "--windows", "duration=50ms") == 1
    assert "video.mp4: not known to be of this command" in capsys.readouterr().err
    assert film.read_bytes() == b"mine"
    assert reconstruct(given, tmp_path, "--windows", "duration=50ms", "--overwrite") == 0
    assert (tmp_path / "done.json").read_text() == note


def test_what_this_command_noted_as_finished_makes_the_rest_its_own(given, tmp_path):
    for name in ("a", "b"):
        (tmp_path / f"{name}.h5").write_bytes((given / "ev.h5").read_bytes())
    out = tmp_path / "out"
    line = ["reconstruct", str(tmp_path / "a.h5"), str(tmp_path / "b.h5"), *_common(given, out), "--windows"]
    assert main([*line, "duration=25ms"]) == 0
    (out / "a" / MARKER).unlink()  # as former versions left it
    assert main([*line, "duration=50ms"]) == 0
    assert "duration=50ms" in json.loads((out / "a" / "done.json").read_text())["settings"]


def test_a_picture_is_taken_away_only_where_the_layout_has_such_names(given, tmp_path):
    assert reconstruct(given, tmp_path, "--windows", "duration=50ms") == 0
    other = put(tmp_path / "frames" / f"{20_000_000:019d}.png")
    assert reconstruct(given, tmp_path, "--windows", "duration=50ms", "--overwrite") == 0
    assert other.read_bytes() == b"mine"


def test_a_run_that_was_stopped_is_begun_again_without_asking(tmp_path):
    folder = tmp_path / "out" / "frames"
    make_room(folder, overwrite=False)
    assert (tmp_path / "out" / MARKER).is_file()
    left = put(folder / "frame_000007.png")
    check_frames(folder, overwrite=False)
    make_room(folder, overwrite=False)
    assert not left.exists()
    put(folder.parent / "stamps.csv")
    with pytest.raises(EtnetError, match="holds frames already"):
        check_frames(folder, overwrite=False)
    check_frames(folder, overwrite=True)


def test_of_many_what_is_not_of_this_command_fails_alone_and_other_settings_do_the_rest_again(given, tmp_path, capsys):
    for name in ("a", "b"):
        (tmp_path / f"{name}.h5").write_bytes((given / "ev.h5").read_bytes())
    out = tmp_path / "out"
    film = put(out / "b" / "video.mp4")
    line = ["reconstruct", str(tmp_path / "a.h5"), str(tmp_path / "b.h5"), *_common(given, out), "--windows"]
    assert main([*line, "duration=25ms"]) == 1
    assert "video.mp4" in capsys.readouterr().err.splitlines()[-1]
    assert film.read_bytes() == b"mine"
    first = below(out / "a")
    assert main([*line, "duration=50ms"]) == 1
    again = below(out / "a")
    assert 0 < len([name for name in again if "frames" in name]) < len([name for name in first if "frames" in name])
    assert main([*line, "duration=50ms", "--overwrite"]) == 0
    assert film.read_bytes() != b"mine"


def test_frames_of_other_settings_that_were_stopped_halfway_do_not_count_as_the_former_ones(tmp_path):
    folder = tmp_path / "frames"
    make_room(folder, overwrite=False)
    (tmp_path / "done.json").write_text(json.dumps({"settings": f"{Reconstruct(files=())}"}))
    make_room(folder, overwrite=False)
    assert not (tmp_path / "done.json").exists()


def test_a_live_take_is_repeated_when_asked_and_leaves_nothing_of_a_longer_one(given, tmp_path, capsys):
    out, record = tmp_path / "out", tmp_path / "live.h5"
    take = ("--windows", "duration=10ms", "--record", str(record))
    assert live(given, out, *take) == 0
    before = below(out)
    stale = put(out / "frames/frame_000999.png")
    record.unlink()
    capsys.readouterr()
    assert live(given, out, *take) == 1
    assert "holds frames already" in capsys.readouterr().err
    assert not record.exists()
    assert before.items() < below(out).items()
    assert live(given, out, *take, "--overwrite") == 0
    assert not stale.exists()
    stale = put(out / "frames/frame_000999.png")
    again = ["reconstruct", str(record), "--windows", "as-cut", *_common(given, out)]
    assert main(again) == 1
    assert stale.exists()
    assert main([*again, "--overwrite"]) == 0
    assert not stale.exists()


def test_a_camera_is_not_started_for_frames_that_would_replace_others(tmp_path, capsys):
    put(tmp_path / "stamps.csv")
    assert main(["reconstruct", "--live", "davis346", "--out", str(tmp_path)]) == 1
    assert "holds frames already" in capsys.readouterr().err


@pytest.mark.parametrize("command", [reconstruct, live])
def test_a_gamma_that_cannot_be_is_said_before_anything_is_replaced(given, tmp_path, capsys, command):
    put(tmp_path / "frames/frame_000001.png")
    for gamma in ("0", "nan", "11"):
        assert command(given, tmp_path, "--overwrite", "--gamma", gamma) == 1
        assert f"display gamma is {gamma}; it takes a number from 0.1 to 10" in capsys.readouterr().err
    assert set(below(tmp_path)) == {"frames/frame_000001.png"}


@pytest.mark.parametrize("speed", ["0", "-1", "nan", "inf", "1e-9", "1e12"])
def test_a_speed_that_no_video_has_is_said_before_anything_is_replaced(given, tmp_path, capsys, speed):
    put(tmp_path / "frames/frame_000001.png")
    assert reconstruct(given, tmp_path, "--overwrite", "--windows", "duration=50ms", "--speed", speed) == 1
    assert f"speed is {float(speed):g}" in capsys.readouterr().err
    assert set(below(tmp_path)) == {"frames/frame_000001.png"}

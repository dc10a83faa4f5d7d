import cv2
import h5py
import pytest
import tyro

from etnet.cli.main import main
from etnet.cli.simulate import Simulate, run
from tests.simulation.pictures_made_up import made_up_pool


def test_the_command_writes_recordings_of_the_size_length_and_rate_asked_for(tmp_path, capsys):
    for i, photo in enumerate(made_up_pool().photos):
        cv2.imwrite(str(tmp_path / f"{i}.png"), photo)
    line = f"{tmp_path / 'out'} --photos {tmp_path} --num 2 --seconds 0.2 --size 48 32 --fps 20 --split all --no-flow"
    assert run(tyro.cli(Simulate, args=line.split())) == 0
    assert "2 recordings" in capsys.readouterr().err
    for path in sorted((tmp_path / "out").iterdir()):
        with h5py.File(path) as file:
            assert tuple(file.attrs["sensor_resolution"]) == (32, 48)
            stamps = [file[f"images/image{i:09d}"].attrs["timestamp"] for i in range(5)]
            assert stamps == pytest.approx([0, 0.05, 0.1, 0.15, 0.2])
            assert "flow" not in file


def test_a_length_of_nothing_is_refused(tmp_path):
    with pytest.raises(ValueError, match="--seconds is 0"):
        Simulate(tmp_path, tmp_path, seconds=0)


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["--size", "4", "4"], "--size is 4×4; wanted at least 8 pixels a side"),
        (["--fps", "20000"], "--fps is 20000; wanted at most 10,000"),
        (["--seconds", "inf"], "--seconds is inf; wanted a finite number above 0"),
    ],
)
def test_what_no_recording_can_be_is_a_sentence_and_no_traceback(tmp_path, capsys, options, said):
    with pytest.raises(SystemExit) as ended:
        main(["simulate", str(tmp_path / "out"), "--photos", str(tmp_path), *options])
    assert ended.value.code == 2
    assert said in " ".join("".join(capsys.readouterr()).replace("│", " ").split())
    assert not (tmp_path / "out").exists()

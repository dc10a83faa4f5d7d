import pytest

from etnet.bundled import samples
from etnet.cli.export import parse_queries
from etnet.cli.main import main
from etnet.cli.runs import RunOptions, parse_run
from etnet.errors import EtnetError
from etnet.nets.weights import save_weights
from tests.export.recordings_made_up import made_up_model


@pytest.fixture
def weights(tmp_path):
    save_weights(made_up_model(), tmp_path / "tiny.safetensors", {"title": "tiny"})
    return tmp_path / "tiny.safetensors"


SAMPLE = str(next(path for path in samples() if path.stem == "prints"))


@pytest.mark.parametrize(
    ("kind", "name", "more"),
    [
        ("video", "v.mp4", ["--panels", "events", "reconstruction", "--stamps", "--speed", "0.5"]),
        ("gif", "g.gif", ["--scale", "2", "--no-stamps"]),
        ("frames", "frames", []),
        (
            "video",
            "runs.mp4",
            [
                "--also",
                "windows=count=3000 filter=hot,5ms",
                "leaky-integrator cold-from=0.02",
                "--panels",
                "reconstruction",
                "camera",
                "--show",
                "error",
                "--frame-offset",
                "1.5",
                "--camera-error",
                "B",
            ],
        ),
        ("arrays", "a.npz", ["--what", "frames", "attention", "--queries", "120,90"]),
        ("csv", "t.csv", []),
        ("page", "p.html", ["--queries", "3", "2"]),
        ("session", "s.json", ["--intervention", '{"removed_scales": [3]}', "--at", "2"]),
    ],
)
def test_every_kind_of_export_is_written_from_the_command_line(tmp_path, weights, capsys, kind, name, more):
    out = tmp_path / "out" / name
    assert main(["export", kind, SAMPLE, "-o", str(out), "--model", str(weights), "--range", "1:4", *more]) == 0
    assert out.exists()
    assert f"{name}: " in capsys.readouterr().err


@pytest.mark.parametrize("name", ["encode.onnx", "decode.onnx", "step_61x45.onnx"])
def test_graphs_of_another_network_stay_unless_they_may_be_replaced(tmp_path, weights, capsys, name):
    (tmp_path / name).write_bytes(b"of A")
    line = ["export", "onnx", "-o", str(tmp_path), "--model", str(weights), "--size", "61x45"]
    assert main(line) == 1
    assert f"{name}: is there already" in capsys.readouterr().err.replace("\n", "")
    assert (tmp_path / name).read_bytes() == b"of A"
    assert [path.name for path in tmp_path.glob("*.onnx")] == [name]


def test_frames_that_are_replaced_are_all_replaced_once_there_is_a_new_one(tmp_path, weights, capsys):
    out = tmp_path / "frames"
    line = ["export", "frames", SAMPLE, "-o", str(out), "--model", str(weights), "--range"]
    assert main([*line, "5:8"]) == 0
    mine = out / "frame_1.png"
    mine.write_bytes(b"mine")
    before = {path.name: path.read_bytes() for path in out.iterdir()}
    assert main([*line, "1:3"]) == 1
    assert {path.name: path.read_bytes() for path in out.iterdir()} == before
    assert main([*line, "1:3", "--overwrite"]) == 0
    names = ["frame_000001.png", "frame_000002.png", "frame_1.png", "stamps.csv"]
    assert sorted(path.name for path in out.iterdir()) == names
    assert mine.read_bytes() == b"mine"


def test_a_session_is_replayed_and_a_forged_one_is_found_out(tmp_path, weights, capsys):
    out = tmp_path / "s.json"
    assert main(["export", "session", SAMPLE, "-o", str(out), "--model", str(weights), "--range", "1:3"]) == 0
    check = ["replay", "--check", str(out), "--model", str(weights)]
    assert main(check) == 0
    assert "all 2 frames" in capsys.readouterr().out
    text = out.read_text()
    out.write_text(text.replace('"torch_version": "', '"torch_version": "other '))
    assert main(check) == 0
    assert "contract differs: torch_version: other" in capsys.readouterr().err.replace("\n", "")
    first = text.split('"frames": [\n  "')[1][:64]
    out.write_text(text.replace(first, "0" * 64))
    assert main(check) == 1
    assert "1 of 2 frames differ, the first at window 1" in capsys.readouterr().out


def test_a_session_of_a_part_is_replayed_without_saying_so_again(tmp_path, weights, capsys):
    out, options = tmp_path / "s.json", ["--model", str(weights)]
    seen = ["--region", "20", "10", "160", "120", "--downsample", "2", "--rotate", "90", "--polarity", "inverted"]
    assert main(["export", "session", SAMPLE, "-o", str(out), *options, "--range", "1:3", *seen]) == 0
    assert main(["replay", "--check", str(out), *options]) == 0
    assert "all 2 frames" in capsys.readouterr().out
    assert main(["replay", "--check", str(out), *options, *seen[:-2]]) == 1
    assert "opened otherwise" in capsys.readouterr().err.replace("\n", " ")


def test_a_failure_is_one_line_and_exit_code_one(tmp_path, weights, capsys):
    arguments = ["export", "csv", SAMPLE, "-o", str(tmp_path / "t.csv"), "--model", str(weights), "--range", "70:80"]
    assert main(arguments) == 1
    assert "range 70:80 holds none of the 50 windows" in capsys.readouterr().err


@pytest.mark.parametrize("option", ["--from", "--to"])
@pytest.mark.parametrize("seconds", ["nan", "inf"])
def test_seconds_without_an_end_are_one_line(tmp_path, weights, capsys, option, seconds):
    line = ["export", "csv", SAMPLE, "-o", str(tmp_path / "t.csv"), "--model", str(weights), option, seconds]
    assert main(line) == 1
    assert f"--from and --to take seconds, got {seconds}" in capsys.readouterr().err


def test_queries_are_pixels():
    assert parse_queries(("1,2", "30,4")) == ((1, 2), (30, 4))
    with pytest.raises(EtnetError, match="X,Y"):
        parse_queries(("1;2",))


@pytest.mark.parametrize(
    ("text", "wanted"),
    [
        ("", RunOptions()),
        ("pie-net-lite", RunOptions("pie-net-lite")),
        ("'my weights/a=b.pth' precision=bf16", RunOptions("my weights/a=b.pth", precision="bf16")),
        ("windows=count=100,duration=5ms filter=hot,5ms,2 cold-from=1.25",
         RunOptions(None, "count=100,duration=5ms", "hot,5ms,2", None, 1.25)),
    ],
)  # fmt: skip
def test_a_run_is_told_in_one_word_of_the_shell(text, wanted):
    assert parse_run(text) == wanted


def test_an_error_of_a_run_that_is_not_there_is_one_line(tmp_path, weights, capsys):
    line = ["export", "gif", SAMPLE, "-o", str(tmp_path / "g.gif"), "--model", str(weights), "--range", "1:3"]
    assert main([*line, "--camera-error", "A"]) == 1
    assert "--also" in capsys.readouterr().err
    assert main([*line, "--camera-error", "C", "--also", ""]) == 1
    assert "the last of 2 runs is B" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("runs", "words"),
    [
        (["cold-from=soon"], "not understood"), (["precision=fp8"], "fp32, bf16 or auto"),
        (["'open"], "not understood"),
        (["", "", "", ""], "at most 3"), (["cold-from=9999"], "start cold earlier"),
        (["cold-from=inf"], "inf is no number of seconds"),
    ],
)  # fmt: skip
def test_runs_that_cannot_be_are_one_line(tmp_path, weights, capsys, runs, words):
    line = ["export", "gif", SAMPLE, "-o", str(tmp_path / "g.gif"), "--model", str(weights), "--range", "1:3"]
    assert main([*line, "--also", *runs]) == 1
    assert words in capsys.readouterr().err
    assert not (tmp_path / "g.gif").exists()

"""`etnet evaluate` goes on where it stopped, names what it could not do, and shares its work out."""

import json
import os
from pathlib import Path

import pytest
import torch

from etnet.cli.main import main
from etnet.nets.presets import build_model
from etnet.nets.weights import save_weights
from tests.evaluation.recordings import made_up, write_event_utils


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    save_weights(build_model("tiny"), tmp_path / "mine.safetensors")
    write_event_utils(made_up(num_frames=5), tmp_path / "one.h5")
    write_event_utils(made_up(num_frames=6), tmp_path / "two.h5")
    return tmp_path


def evaluate(folder: Path, *items: str, options: tuple[str, ...] = ()) -> int:
    paths = [str(folder / item) for item in items]
    return main(["evaluate", *paths, "--out", str(folder / "out"), "--judge", "alex", "--flow", "file", *options])


def report(folder: Path) -> dict:
    return json.loads((folder / "out" / "report.json").read_text())


def no_evaluation(*_: object, **__: object) -> None:
    raise AssertionError("scored once more")


def test_it_scores_every_pair_and_a_second_call_reads_what_is_there(folder: Path, monkeypatch, capsys) -> None:
    assert evaluate(folder, "mine.safetensors", "one.h5", "two.h5") == 0
    first = report(folder)
    assert [(entry["model"], len(entry["stamps"])) for entry in first["scores"]] == [("mine", 4), ("mine", 5)]
    assert "[2/2]" in capsys.readouterr().err
    assert (folder / "out" / "report.md").read_text().startswith("# Scores, protocol `paper`")
    assert (folder / "out" / "report.svg").read_text().startswith("<svg")
    monkeypatch.setattr("etnet.evaluation.evaluate.evaluate", no_evaluation)
    assert evaluate(folder, "mine.safetensors", "one.h5", "two.h5") == 0
    assert report(folder) == first


def weights(path: Path, seed: int) -> None:
    path.parent.mkdir(exist_ok=True)
    save_weights(build_model("tiny", torch.Generator().manual_seed(seed)), path)


def test_files_of_one_name_in_two_folders_are_told_apart_in_every_line(folder: Path, capsys) -> None:
    for seed in (12, 13):
        weights(folder / f"{seed}" / "weights.safetensors", seed)
    for number, name in enumerate(("a", "b")):
        (folder / name).mkdir()
        write_event_utils(made_up(num_frames=4 + number), folder / name / "events.h5")
    items = "12/weights.safetensors", "13/weights.safetensors", "mine.safetensors", "a/events.h5", "b/events.h5"
    assert evaluate(folder, *items) == 0
    pairs = [(group, model) for group in ("a/events", "b/events") for model in ("12/weights", "13/weights", "mine")]
    written = report(folder)
    assert [(entry["recording"], entry["model"]) for entry in written["scores"]] == pairs
    assert [len(entry["stamps"]) for entry in written["scores"]] == [3, 3, 3, 4, 4, 4]
    raw = [line for line in written["lines"] if line["row"] == "as it is"]
    assert [(line["group"], line["model"]) for line in raw] == pairs
    assert len({line["values"]["mse"]["mean"] for line in raw}) == len(pairs)

    (folder / "a" / "events.h5").write_bytes(b"nothing")
    assert evaluate(folder, "mine.safetensors", "a/events.h5", "b/events.h5") == 1
    written = report(folder)
    assert [failure[:2] for failure in written["failures"]] == [[str(folder / "mine.safetensors"), "a/events.h5"]]
    assert [(entry["recording"], len(entry["stamps"])) for entry in written["scores"]] == [("b/events", 4)]
    assert "mine.safetensors on a/events.h5: " in capsys.readouterr().err


def test_a_file_that_is_named_twice_is_scored_once(folder: Path) -> None:
    assert evaluate(folder, "mine.safetensors", "./mine.safetensors", "one.h5", "../" + folder.name + "/one.h5") == 0
    assert [(entry["model"], entry["recording"]) for entry in report(folder)["scores"]] == [("mine", "one")]


def test_a_process_reports_no_score_of_former_weights_that_is_anothers_to_renew(folder: Path, monkeypatch) -> None:
    items = "mine.safetensors", "one.h5", "two.h5"
    assert evaluate(folder, *items) == 0
    former = [entry["rows"]["as it is"]["mse"] for entry in report(folder)["scores"]]
    (folder / "out" / "report.json").unlink()
    weights(folder / "mine.safetensors", 5)
    monkeypatch.setenv("WORLD_SIZE", "2")
    monkeypatch.setenv("RANK", "1")
    assert evaluate(folder, *items) == 0
    assert not (folder / "out" / "report.json").exists()
    monkeypatch.setenv("RANK", "0")
    assert evaluate(folder, *items) == 0
    now = [entry["rows"]["as it is"]["mse"] for entry in report(folder)["scores"]]
    assert all(new != old for new, old in zip(now, former, strict=True))


def test_other_weights_under_the_same_name_are_scored_anew(folder: Path) -> None:
    assert evaluate(folder, "mine.safetensors", "one.h5") == 0
    first = report(folder)["scores"][0]["rows"]["as it is"]["mse"]
    save_weights(build_model("tiny", torch.Generator().manual_seed(5)), folder / "mine.safetensors")
    assert evaluate(folder, "mine.safetensors", "one.h5") == 0
    assert report(folder)["scores"][0]["rows"]["as it is"]["mse"] != first


def test_a_recording_that_cannot_be_scored_is_a_failure_with_a_name_and_the_rest_is_done(folder: Path, capsys) -> None:
    (folder / "broken.h5").write_bytes(b"nothing")
    assert evaluate(folder, "mine.safetensors", "broken.h5", "one.h5") == 1
    written = report(folder)
    assert [failure[:2] for failure in written["failures"]] == [[str(folder / "mine.safetensors"), "broken.h5"]]
    assert len(written["scores"]) == 1
    assert "broken.h5" in capsys.readouterr().err
    write_event_utils(made_up(num_frames=4), folder / "broken.h5")
    assert evaluate(folder, "mine.safetensors", "broken.h5", "one.h5") == 0
    assert report(folder)["failures"] == []


def test_whatever_goes_wrong_with_one_pair_is_named_and_the_rest_is_done(folder: Path, monkeypatch, capsys) -> None:
    from etnet.evaluation import evaluate as module

    scored = module.evaluate

    def fails_at_one(model, recording, *more, **named):
        if recording.name == "one":
            raise MemoryError("no room")
        return scored(model, recording, *more, **named)

    monkeypatch.setattr(module, "evaluate", fails_at_one)
    assert evaluate(folder, "mine.safetensors", "one.h5", "two.h5") == 1
    written = report(folder)
    assert [failure[2] for failure in written["failures"]] == ["MemoryError: no room"]
    assert len(written["scores"]) == 1
    named = f"  {folder / 'mine.safetensors'} on one.h5: MemoryError: no room"
    assert named in capsys.readouterr().err.splitlines()


def test_a_folder_stands_for_the_recordings_in_it(folder: Path) -> None:
    (folder / "in" / "deep").mkdir(parents=True)
    (folder / "one.h5").rename(folder / "in" / "one.h5")
    (folder / "two.h5").rename(folder / "in" / "deep" / "two.h5")
    assert evaluate(folder, "mine.safetensors", "in") == 0
    assert sorted(entry["recording"] for entry in report(folder)["scores"]) == ["one", "two"]


def test_a_pair_that_another_process_is_at_is_left_to_it(folder: Path, monkeypatch, capsys) -> None:
    from etnet.evaluation import evaluate as module

    scored, inner = module.evaluate, []

    def meanwhile(*arguments, **named):
        if not inner:
            inner.append(0)
            inner.append(evaluate(folder, "mine.safetensors", "one.h5"))
        return scored(*arguments, **named)

    monkeypatch.setattr(module, "evaluate", meanwhile)
    assert evaluate(folder, "mine.safetensors", "one.h5") == 0
    assert inner == [0, 0]
    assert "another process is at it" in capsys.readouterr().err
    assert len(report(folder)["scores"]) == 1


@pytest.mark.parametrize("out", ["evaluation", "."])
def test_a_recording_is_the_same_though_the_report_lies_in_its_folder(folder: Path, monkeypatch, capsys, out) -> None:
    recording = folder / "one"
    recording.mkdir()
    (folder / "one.h5").rename(recording / "events.h5")
    monkeypatch.chdir(recording)
    line = ["evaluate", str(folder / "mine.safetensors"), ".", "--out", out, "--judge", "alex", "--flow", "file"]
    assert main(line) == 0
    assert "still at work" not in capsys.readouterr().err
    written = recording / out
    first = (written / "report.json").read_bytes()
    (written / ".report.md.1.0123abcd.unfinished").write_bytes(b"of another process")
    monkeypatch.setattr("etnet.evaluation.evaluate.evaluate", no_evaluation)
    assert main(line) == 0
    assert (written / "report.json").read_bytes() == first
    (recording / "labels.csv").write_bytes(b"of the recording")
    assert main(line) == 1
    assert "scored once more" in capsys.readouterr().err


@pytest.mark.parametrize("changed", ["recording", "weights"])
def test_a_pair_that_changed_while_it_was_scored_is_named_and_the_rest_is_reported(
    folder: Path, monkeypatch, capsys, changed
) -> None:
    from etnet.evaluation import evaluate as module

    weights(folder / "other.safetensors", 3)
    items = "mine.safetensors", "other.safetensors", "one.h5", "two.h5"
    assert evaluate(folder, *items) == 0
    scored, calls = module.evaluate, []

    def changes_the_first(*arguments, **named):
        found = scored(*arguments, **named)
        calls.append(0)
        if len(calls) == 1 and changed == "weights":
            weights(folder / "mine.safetensors", 7)
        elif len(calls) == 1:
            os.utime(folder / "one.h5", ns=(1, 1))
        return found

    weights(folder / "mine.safetensors", 6)
    monkeypatch.setattr(module, "evaluate", changes_the_first)
    capsys.readouterr()
    assert evaluate(folder, *items) == 1
    said = capsys.readouterr().err
    assert "mine.safetensors on one.h5: the recording or the weights changed while it was scored; run it again" in said
    assert "still at work" not in said
    failures = [failure[:2] for failure in report(folder)["failures"]]
    assert failures == [[str(folder / "mine.safetensors"), "one.h5"]]
    assert len(report(folder)["scores"]) == 3
    assert evaluate(folder, *items) == 0
    assert report(folder)["failures"] == []


@pytest.mark.parametrize("names", [("RANK", "WORLD_SIZE"), ("SLURM_PROCID", "SLURM_NTASKS")])
def test_two_processes_share_the_pairs_and_the_last_writes_the_report(folder: Path, monkeypatch, names) -> None:
    rank, size = names
    monkeypatch.setenv(size, "2")
    monkeypatch.setenv(rank, "1")
    assert evaluate(folder, "mine.safetensors", "one.h5", "two.h5") == 0
    assert len(list((folder / "out" / "scores").glob("*.json"))) == 1
    assert not (folder / "out" / "report.json").exists()
    monkeypatch.setenv(rank, "0")
    assert evaluate(folder, "mine.safetensors", "one.h5", "two.h5") == 0
    assert len(report(folder)["scores"]) == 2


@pytest.mark.parametrize("items", [("one.h5",), ("mine.safetensors",), ("mine.safetensors", "absent.h5")])
def test_a_call_that_lacks_a_model_or_a_recording_says_so(folder: Path, items, capsys) -> None:
    assert evaluate(folder, *items) == 1
    message = capsys.readouterr().err
    assert "no model" in message or "no recording" in message or "absent.h5" in message


@pytest.mark.parametrize("content", ["{", "[1]", '{"key": 1, "format": 1}', "[" * 100_000, "1" * 6000, '{"a": NaN}'])
def test_what_lies_where_scores_or_failures_should_is_named_in_one_line(folder: Path, content, capsys) -> None:
    assert evaluate(folder, "mine.safetensors", "one.h5") == 0
    scores = next((folder / "out" / "scores").glob("*.json"))
    kept = scores.read_text()
    key = json.loads(kept)["key"]
    scores.write_text(content.replace('"key": 1', f'"key": "{key}"'))
    assert evaluate(folder, "mine.safetensors", "one.h5") == 1
    assert "scores cannot be read" in report(folder)["failures"][0][2]
    scores.write_text(kept)
    (folder / "out" / "failures_7.json").write_text(content)
    monkey = {"RANK": "1", "WORLD_SIZE": "9"}
    with pytest.MonkeyPatch.context() as patch:
        for name, value in monkey.items():
            patch.setenv(name, value)
        capsys.readouterr()
        assert evaluate(folder, "mine.safetensors", "one.h5") == 1
    said = capsys.readouterr().err.strip().splitlines()
    assert "failures_7.json: cannot be read" in said[-1]


def test_a_part_in_seconds_is_scored_by_itself_and_the_report_says_which(folder: Path, capsys) -> None:
    assert evaluate(folder, "mine.safetensors", "two.h5") == 0
    whole = report(folder)["scores"][0]["stamps"]
    assert evaluate(folder, "mine.safetensors", "two.h5", options=("--from", "0.03", "--to", "0.18")) == 0
    part = report(folder)
    assert 0 < len(part["scores"][0]["stamps"]) < len(whole)
    said = "two: only its frames from 0.03 s to 0.18 s are scored"
    assert any(said in note for note in part["notes"])
    assert said in (folder / "out" / "report.md").read_text()
    assert evaluate(folder, "mine.safetensors", "two.h5") == 0
    assert report(folder)["scores"][0]["stamps"] == whole
    assert evaluate(folder, "mine.safetensors", "two.h5", options=("--whole", "--to", "1")) == 1
    assert "give one of the two" in capsys.readouterr().err

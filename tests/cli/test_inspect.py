"""`etnet inspect` tells all that it did not look at, and its picture replaces no recording."""

import json

import pytest

from etnet.cli.main import main
from etnet.events import examine as doctor
from etnet.events.write import write_recording
from tests.events.formats.test_triggers import EDGES, triggered
from tests.strategies import make_events

ROWS = "20 12\n" + "".join(f"{i / 1000:.6f} {i % 7} {i % 5} {i % 2}\n" for i in range(300))


@pytest.mark.parametrize("name", ["a.txt", "a.png", "b.raw", "none"])
def test_the_picture_is_a_png_and_never_the_recording(name, tmp_path, capsys):
    (tmp_path / "a.txt").write_text(ROWS)
    (tmp_path / "a.png").hardlink_to(tmp_path / "a.txt")
    (tmp_path / "b.raw").write_text("what is there")
    assert main(["inspect", str(tmp_path / "a.txt"), "--picture", str(tmp_path / name)]) == 1
    assert "--picture" in capsys.readouterr().err
    assert (tmp_path / "a.txt").read_text() == (tmp_path / "a.png").read_text() == ROWS
    assert (tmp_path / "b.raw").read_text() == "what is there"
    assert not (tmp_path / "none").exists()


def test_the_picture_is_written_and_replaces_another(tmp_path):
    (tmp_path / "a.txt").write_text(ROWS)
    for _ in range(2):
        assert main(["inspect", str(tmp_path / "a.txt"), "--picture", str(tmp_path / "a.PNG")]) == 0
    assert (tmp_path / "a.PNG").read_bytes()[:4] == b"\x89PNG"


def test_that_only_a_part_was_looked_at_is_told(tmp_path, capsys, monkeypatch):
    (tmp_path / "a.txt").write_text(ROWS)
    assert main(["inspect", str(tmp_path / "a.txt")]) == 0
    assert "looked at" not in capsys.readouterr().out
    monkeypatch.setattr(doctor, "LARGEST_LOOK", 150)
    monkeypatch.setattr(doctor, "_BLOCK", 50)
    assert main(["inspect", str(tmp_path / "a.txt")]) == 0
    assert "150 events, in blocks" in capsys.readouterr().out


def test_triggers_are_told_by_input_and_edge(tmp_path, capsys):
    path = tmp_path / "a.raw"
    write_recording(triggered(EDGES, make_events(2_000, duration=60_000)), path)
    assert main(["inspect", str(path)]) == 0
    told = " ".join(capsys.readouterr().out.split())
    assert "4 on input 0, 1, 3: 3 rising, 1 falling" in told
    assert main(["inspect", str(path), "--json"]) == 0
    found = json.loads(capsys.readouterr().out)["triggers"]
    assert (found["num_triggers"], found["channels"], found["num_outside_span"]) == (4, [0, 1, 3], 0)

"""`etnet simulate --video`: sources, cameras, twins, formats, and what is said."""

import json
import re

import cv2
import numpy as np
import pytest

from etnet.cli.main import main
from etnet.events.open import open_recording
from etnet.events.write import WITHOUT_PROVENANCE
from tests.simulation.films import drifting, write_film


@pytest.fixture(scope="module")
def film(tmp_path_factory):
    return write_film(tmp_path_factory.mktemp("film") / "drift.mp4", drifting(8, 2.0))


def done(*words) -> int:
    return main(["simulate", *map(str, words)])


TARGETS = {
    "event_utils": "a.h5",
    "dsec": "dsec.h5",
    "mvsec": "mvsec.hdf5",
    "aedat4": "a.aedat4",
    "evt3": "a.raw",
    "es": "a.es",
    "text": "a.txt",
    "rpg": "folder",
    "csv": "a.csv",
    "npz": "a.npz",
}


@pytest.mark.parametrize("layout", TARGETS)
def test_every_format_that_we_write_holds_the_same_events(film, tmp_path, layout, capsys):
    out = tmp_path / TARGETS[layout]
    assert done(tmp_path / "ours.h5", "--video", film) == 0
    assert done(out, "--video", film, "--layout", layout) == 0
    with open_recording(tmp_path / "ours.h5") as ours, open_recording(out) as other:
        assert ours.num_events == other.num_events > 1000
        one, two = ours.read(0, ours.num_events), other.read(0, other.num_events)
        assert np.array_equal(one.t - one.t[0], two.t - two.t[0])
        assert np.array_equal(np.sort(one.x), np.sort(two.x))
        if layout in ("event_utils", "mvsec", "aedat4", "rpg"):
            assert np.array_equal(ours.ground_truth.stamps, other.ground_truth.stamps)
            assert np.array_equal(ours.ground_truth.read_frame(3), other.ground_truth.read_frame(3))
    assert not [path for path in tmp_path.iterdir() if path.name.startswith("etnet-simulate")]
    beside = tmp_path / f"{out.name}.json"
    assert beside.exists() == (layout in WITHOUT_PROVENANCE)
    if beside.exists():
        assert json.loads(beside.read_text())["pos_thres"] == 0.2
        return
    capsys.readouterr()
    assert main(["inspect", str(out)]) == 0
    told = capsys.readouterr().out
    assert "simulated from drift" in told
    assert '"pos_thres": 0.2' in told


def test_all_that_was_asked_for_is_told_by_inspect(film, tmp_path, capsys):
    asked = ["--region", 4, 2, 56, 40, "--rotate", 90, "--from", 0.05, "--gamma", 1.8, "--camera", "davis240c"]
    assert done(tmp_path / "a.aedat4", "--video", film, *asked, "--drop-repeats", "--colour") == 0
    capsys.readouterr()
    assert main(["inspect", str(tmp_path / "a.aedat4"), "--json"]) == 0
    told = " ".join(json.loads(capsys.readouterr().out)["remarks"])
    for part in ('"crop": "4 2 56 40"', '"rotate": 90', '"start": 0.05', '"gamma": 1.8', '"camera": "davis240c"'):
        assert part in told
    assert '"drops_repeats": true' in told
    with open_recording(tmp_path / "a.aedat4") as recording:
        assert recording.ground_truth.read_colour is not None


def test_what_was_said_while_it_was_simulated_is_told_by_inspect(tmp_path, capsys):
    still = write_film(tmp_path / "repeats.mp4", [picture for picture in drifting(5, 2.0) for _ in range(2)])
    assert done(tmp_path / "a.npz", "--video", still) == 0
    said = [line.strip() for line in capsys.readouterr().err.splitlines() if "repeat" in line]
    assert said
    assert main(["inspect", str(tmp_path / "a.npz"), "--json"]) == 0
    told = " ".join(json.loads(capsys.readouterr().out)["remarks"])
    assert said[0] in told


def test_a_format_that_we_do_not_write_is_refused_before_the_work(tmp_path, capsys):
    assert done(tmp_path / "a.xyz", "--video", tmp_path / "is not even looked for.mp4") == 1
    assert 'no layout is known for ".xyz"; name one of' in capsys.readouterr().err


def test_a_cameras_size_and_single_parameters_are_taken(film, tmp_path, capsys):
    out = tmp_path / "a.h5"
    assert done(out, "--video", film, "--camera", "davis240c", "--cutoff-hz", 100, "--interpolate", 3) == 0
    with open_recording(out) as recording:
        assert str(recording.sensor) == "240×180"
        told = " ".join(remark.text for remark in recording.remarks)
    assert '"pos_thres": 0.11' in told
    assert '"cutoff_hz": 100.0' in told
    assert done(tmp_path / "b.h5", "--video", film, "--camera", "nonsense") == 1
    assert "choose from DAVIS240C" in capsys.readouterr().err


def test_a_twin_is_measured_said_and_simulated(film, tmp_path, capsys):
    assert done(tmp_path / "mine.h5", "--video", film, "--pos-thres", 0.3) == 0
    assert done(tmp_path / "like.h5", "--video", film, "--like", tmp_path / "mine.h5") == 0
    said = capsys.readouterr().err
    assert "the sensor of mine.h5: pos_thres" in said
    assert "assumed, not measured: sigma_thres 0.03, leak_rate_hz 0.1" in said
    for what in ("events of a pixel each second", "share of ON events", "interval, median (ms)"):
        row = re.search(rf"{re.escape(what)} +([\d.]+)%? +([\d.]+)%?", said)
        assert float(row[2]) == pytest.approx(float(row[1]), rel=0.3)
    assert (tmp_path / "like.h5").is_file()


def test_pictures_and_a_photo_are_sources_too(tmp_path, capsys):
    folder = tmp_path / "p"
    folder.mkdir()
    for i, picture in enumerate(drifting(4, 2.0)):
        cv2.imwrite(str(folder / f"{i}.png"), picture)
    assert done(tmp_path / "a.h5", "--video", folder, "--fps", 50) == 0
    assert done(tmp_path / "b.h5", "--video", folder / "*.png", "--fps", 50) == 0
    assert done(tmp_path / "c.h5", "--video", folder / "0.png", "--motion", "saccades", "--reach", 4) == 0
    assert done(tmp_path / "d.h5", "--video", folder / "0.png") == 1
    assert done(tmp_path / "d.h5", "--video", folder) == 1
    said = capsys.readouterr().err
    assert "give --motion" in said
    assert "give --fps or --stamps" in said


def test_nothing_that_moves_is_said_in_every_format(tmp_path, capsys):
    still = write_film(tmp_path / "still.mp4", [np.full((48, 64), 90, np.uint8)] * 4)
    assert done(tmp_path / "a.h5", "--video", still, "--noise", 0) == 0
    assert done(tmp_path / "a.csv", "--video", still, "--noise", 0) == 1
    said = capsys.readouterr().err
    assert said.count("0 events: log intensity changes by") == 2
    assert not (tmp_path / "a.csv").exists()
    assert done(tmp_path / "a.h5", "--video", still, "--interpolate", "often") == 1
    assert "takes auto, off, or a number" in capsys.readouterr().err


def test_a_part_in_seconds_and_pixels_is_seen_and_what_is_there_stays_unless_it_may_be_replaced(film, tmp_path, capsys):
    out = tmp_path / "a.h5"
    assert done(out, "--video", film) == 0
    before = out.read_bytes()
    part = ("--video", film, "--from", 0.04, "--to", 0.2, "--roi", "4,4,32,24")
    assert done(out, *part) == 1
    assert "--overwrite" in capsys.readouterr().err
    assert out.read_bytes() == before
    assert done(tmp_path / "b.h5", *part) == 0
    assert done(out, *part, "--overwrite") == 0
    with open_recording(out) as recording, open_recording(tmp_path / "b.h5") as other:
        assert recording.num_events == other.num_events
        assert recording.sensor.width * 24 == recording.sensor.height * 32
        assert recording.span.stop - recording.span.start < 200_000

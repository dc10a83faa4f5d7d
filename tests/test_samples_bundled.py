"""The recordings that come with the project: small, readable by anyone, like real ones, and made by their script."""

import importlib.util
import re
import sys
from itertools import pairwise

import h5py
import numpy as np
import pytest

from etnet.bundled import bundled_folder, samples
from etnet.events.events import Sensor
from etnet.events.open import open_recording
from etnet.windows import BetweenFrames, plan_windows

CARD = (bundled_folder() / "samples" / "README.md").read_text()


def statistics(path):
    with h5py.File(path) as file:
        events = {name: file[f"events/{name}"][:] for name in ("xs", "ys", "ts", "ps")}
        stamps = [image.attrs["timestamp"] for _, image in sorted(file["images"].items())]
        height, width = file.attrs["sensor_resolution"]
        frames = np.stack([image[()] for _, image in sorted(file["images"].items())])
    index = np.searchsorted(np.rint(events["ts"] * 1e6), np.rint(np.array(stamps) * 1e6))
    pixel = events["ys"].astype(int) * width + events["xs"]
    active = [len(np.unique(pixel[a:b])) for a, b in pairwise(index)]
    num_pixels = height * width
    return events, frames, np.diff(index) / num_pixels, np.mean(active) / num_pixels, events["ps"].mean()


def test_there_are_three_and_each_is_small_and_on_the_card():
    assert [path.stem for path in samples()] == ["astronaut", "prints", "rolling"]
    for path in samples():
        assert path.stat().st_size <= 2_000_000
        assert f"| {path.name} |" in CARD


@pytest.mark.parametrize("path", samples(), ids=lambda path: path.stem)
def test_the_card_tells_the_truth(path):
    events, frames, density, active, share_on = statistics(path)
    row = re.search(rf"\| {path.name} \|[^|]*\|([^|]*)\|([^|]*)\|([^|]*)\|([^|]*)\|", CARD)
    assert row is not None
    assert int(row[1].replace(",", "")) == len(events["ts"])
    assert float(row[2].split()[0]) == pytest.approx(density.mean(), abs=0.006)
    assert float(row[3].split()[0]) == pytest.approx(100 * active, abs=0.6)
    assert float(row[4]) == pytest.approx(share_on, abs=0.006)
    assert frames.shape == (51, 180, 240)
    assert (np.diff(events["ts"]) >= 0).all()
    assert 0.2 <= density.mean() <= 0.4


@pytest.mark.parametrize("path", samples(), ids=lambda path: path.stem)
def test_it_opens_with_nothing_to_mend_and_fifty_windows(path):
    with open_recording(path) as recording:
        assert not [remark for remark in recording.remarks if remark.kind != "detected"]
        assert recording.sensor == Sensor(240, 180)
        assert len(plan_windows(recording, BetweenFrames())) == 50


@pytest.mark.parametrize("path", samples(), ids=lambda path: path.stem)
def test_the_motion_is_a_closed_loop(path):
    _, frames, *_ = statistics(path)
    around, across = np.abs(frames[0] - frames[-1].astype(float)), np.abs(frames[0] - frames[25].astype(float))
    assert around.mean() < 0.1 * across.mean()


def test_the_script_makes_the_recording_again(tmp_path, monkeypatch):
    pytest.importorskip("skimage", reason="its wheel carries the pictures")
    spec = importlib.util.spec_from_file_location("make_samples", bundled_folder() / "samples" / "make.py")
    script = importlib.util.module_from_spec(spec)
    monkeypatch.setitem(sys.modules, spec.name, script)  # dataclasses look their module up
    spec.loader.exec_module(script)
    made = statistics(script.make("rolling", tmp_path))
    kept = statistics(bundled_folder() / "samples" / "rolling.h5")
    # Other versions of OpenCV interpolate by other last bits, which moves a few crossings.
    assert len(made[0]["ts"]) == pytest.approx(len(kept[0]["ts"]), rel=0.01)
    assert np.abs(made[1].astype(int) - kept[1]).mean() < 1

"""What makes no sense is said on opening, for every format: one stamp for all, a clock that no camera has."""

from __future__ import annotations

import numpy as np
import pytest

from etnet.cli import inspect
from etnet.cli.recording import Opening
from etnet.events.examine import examine
from etnet.events.open import Assumptions, open_recording
from tests.events.formats.test_recognition import dat
from tests.strategies import make_events

EVENTS = make_events(3000)
SIZE = {"width": 20, "height": 12}


def save(path, t):
    np.savez(path, x=EVENTS.x, y=EVENTS.y, t=t, p=EVENTS.p, **SIZE)
    return path


def advice(path, **stated) -> list[str]:
    with open_recording(path, assume=Assumptions(**stated)) as recording:
        return [remark.text for remark in recording.remarks if remark.kind == "advice"]


def test_a_sound_recording_gets_no_advice(tmp_path):
    assert advice(save(tmp_path / "a.npz", EVENTS.t)) == []


@pytest.mark.parametrize(
    ("stamps", "match"),
    [
        (np.zeros(3000, np.int64), "all 3,000 events have one timestamp"),
        (EVENTS.t // 10_000 * 10_000, "events share a stamp, and stamps lie 10,000 µs apart"),
        (np.linspace(0, 10**17, 3000).astype(np.int64), "no recording in any unit"),
    ],
)
def test_a_clock_that_no_camera_has_is_advised_on(stamps, match, tmp_path):
    (said,) = advice(save(tmp_path / "a.npz", stamps))
    assert match in said


@pytest.mark.parametrize(("unit", "match"), [("s", "days"), ("ns", "more than any camera reads out")])
def test_a_stated_unit_that_makes_no_recording_is_followed_and_advised_on(unit, match, tmp_path):
    t = np.linspace(0, 1000 if unit == "ns" else 10**6, 3000).astype(np.int64)
    assert any(match in said for said in advice(save(tmp_path / "a.npz", t), time_unit=unit))


def test_a_format_with_its_own_unit_is_held_against_it_too(tmp_path):
    content = dat("% Data file containing CD events.\n% Version 2\n% Width 1280\n% Height 720\n")
    head, body = content.split(b"\x0c\x08")
    words = np.frombuffer(body, "<u4").reshape(-1, 2).copy()
    words[:, 0] = np.linspace(0, 2**32 - 1, len(words)).astype(np.uint32)
    (tmp_path / "a.dat").write_bytes(head + b"\x0c\x08" + words.tobytes())
    assert any("which no camera gives" in said for said in advice(tmp_path / "a.dat"))


def test_floats_of_32_bits_say_how_coarse_they_are(tmp_path):
    stamps = (1_461_581_614.0 + EVENTS.t / 1e6).astype(np.float32)
    said = "\n".join(advice(save(tmp_path / "a.npz", stamps)))
    assert "resolve steps of 128 only" in said
    assert "all 3,000 events have one timestamp" in said


def test_the_page_has_the_advice_once_and_no_rate_without_time(tmp_path, capsys):
    path = save(tmp_path / "a.npz", np.zeros(3000, np.int64))
    assert inspect.run(inspect.Inspect(path, Opening())) == 0
    page = capsys.readouterr().out
    assert page.count("all 3,000 events have one timestamp") == 1
    assert "no rate" in page
    assert "M/s" not in page
    with open_recording(path) as recording:
        found = examine(recording)
    assert (found.mean_rate, found.peak_rate, found.suggested_duration) == (0, 0, 0)

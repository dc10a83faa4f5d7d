import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from etnet.events.events import Events, Sensor
from etnet.events.recording import recording_of_events
from etnet.render.timeline import (
    area_path,
    frame_ticks,
    nice_step,
    rate_curve,
    second_ticks,
)
from etnet.windows import ByDuration, plan_windows


def steady(num_events=4000, gap=250):
    zeros = np.zeros(num_events, np.uint16)
    t = np.arange(num_events, dtype=np.int64) * gap + 5_000_000
    return recording_of_events(Events(zeros, zeros, t, np.ones(num_events, np.int8), Sensor(4, 4)))


def test_a_steady_recording_has_a_flat_rate():
    curve = rate_curve(plan_windows(steady(), ByDuration(20_000)))
    assert np.allclose(curve.rates[:-1], 4000)
    assert len(curve.indices) == 50


def test_only_so_many_windows_are_planned():
    curve = rate_curve(plan_windows(steady(), ByDuration(500)), 40)
    assert len(curve.indices) == 40
    assert curve.indices[0] == 0
    assert curve.indices[-1] == 1999


def test_ticks_stand_at_round_seconds_from_the_first_event():
    curve = rate_curve(plan_windows(steady(), ByDuration(20_000)))
    ticks = second_ticks(curve, 5_000_000)
    assert [t for _, t in ticks] == pytest.approx([0.2, 0.4, 0.6, 0.8, 1.0])
    assert ticks[0][0] == pytest.approx(9)  # window 9 ends at 0.2 s


def test_frames_are_ticked_at_the_windows_that_end_with_them():
    curve = rate_curve(plan_windows(steady(), ByDuration(20_000)))
    stamps = np.array([0, 5_000_000 + 200_000, 5_000_000 + 9_000_000])
    assert frame_ticks(stamps, curve) == pytest.approx([9])


@given(st.floats(1e-6, 1e9), st.integers(1, 20))
def test_a_nice_step_gives_no_more_ticks_than_asked(span, num_ticks):
    step = nice_step(span, num_ticks)
    assert span / step <= num_ticks * (1 + 1e-6)
    assert float(f"{step:.6e}".split("e")[0]) in (1.0, 2.0, 5.0)


def test_an_empty_recording_has_no_curve_and_no_ticks():
    curve = rate_curve(())
    assert area_path(curve, 0, 100, 10) == ""
    assert second_ticks(curve, 0) == []
    assert len(frame_ticks(np.array([1, 2]), curve)) == 0


def test_the_curve_reaches_the_top_at_its_maximum():
    curve = rate_curve(plan_windows(steady(), ByDuration(20_000)))
    path = area_path(curve, 50, 1000, 30)
    assert path.startswith("M0.0 30")
    assert " 0.0" in path
    assert path.endswith("Z")

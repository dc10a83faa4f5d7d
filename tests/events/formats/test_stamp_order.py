"""Steps back in time are told apart: disorder, a turn of 32 bits, a restarted clock, and a column that is no time."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from etnet.errors import RecordingError
from etnet.events.formats import paged
from etnet.events.formats.stamp_order import StampOrder
from etnet.events.formats.wrapping_clock import PERIOD, WrappingClock
from etnet.events.open import Assumptions, open_recording
from tests.events.containers import all_events
from tests.strategies import make_events

SIZE = Assumptions(width=20, height=12)


def save(path, t):
    events = make_events(len(t))
    if path.suffix == ".npz":
        np.savez(path, x=events.x, y=events.y, t=t, p=events.p)
    else:
        rows = zip(t.tolist(), events.x, events.y, events.p, strict=True)
        path.write_text("t_us,x,y,p\n" + "".join(f"{a},{b},{c},{d}\n" for a, b, c, d in rows))
    return path


@given(
    start=st.integers(PERIOD // 2, PERIOD * 3),
    steps=st.lists(st.integers(0, PERIOD // 8), min_size=1, max_size=40),
    cuts=st.lists(st.integers(0, 40), max_size=4),
)
def test_a_clock_of_32_bits_goes_on_however_its_stamps_are_cut_into_pieces(start, steps, cuts):
    t = start + np.cumsum([0, *steps])
    clock, found = WrappingClock(), []
    for piece in np.split((t % PERIOD).astype(np.int64), sorted(cuts)):
        found.append(clock.unrolled(piece))
    np.testing.assert_array_equal(np.concatenate(found), t - start // PERIOD * PERIOD)


@pytest.mark.parametrize("form", [".npz", ".csv"])
@pytest.mark.parametrize("dtype", ["u4", "i8", "i4"])
@pytest.mark.parametrize("is_long", [False, True])
def test_a_turn_goes_on_in_every_format(form, dtype, is_long, tmp_path, monkeypatch):
    monkeypatch.setattr(paged, "SHORT", 0 if is_long else paged.SHORT)
    t = PERIOD - 60_000 + np.arange(3000) * 40
    stored = (t % PERIOD).astype("u4")
    if dtype == "i4":
        t = t - PERIOD // 2
        stored = (t - PERIOD * (t >= PERIOD // 2)).astype("i4")
    with open_recording(save(tmp_path / f"a{form}", stored.astype(dtype)), assume=SIZE) as recording:
        np.testing.assert_array_equal(all_events(recording).t, t)
        assert "stamps wrap" in "\n".join(map(str, recording.remarks))


@pytest.mark.parametrize("form", [".npz", ".csv"])
@pytest.mark.parametrize("parts", [2, 4])
def test_a_restarted_clock_is_called_so_and_sorting_is_not_advised(form, parts, tmp_path):
    t = np.tile(np.arange(1000) * 750, parts)
    with pytest.raises(RecordingError, match="the clock restarts") as refusal:
        open_recording(save(tmp_path / f"a{form}", t), assume=SIZE)
    assert "at event 1000" in str(refusal.value)
    assert f"{parts} recordings" in str(refusal.value)
    assert "--sort" not in str(refusal.value)


@pytest.mark.parametrize("form", [".npz", ".csv"])
def test_a_column_that_runs_back_all_the_time_is_probably_no_time(form, tmp_path):
    t = np.random.default_rng(0).integers(0, 10**6, 3000)
    with pytest.raises(RecordingError, match="probably another one") as refusal:
        open_recording(save(tmp_path / f"a{form}", t), assume=SIZE)
    assert "--sort" not in str(refusal.value)


def test_a_few_steps_back_can_be_sorted():
    order, t = StampOrder(), np.arange(2000) * 100
    t[500:510] -= 20_000
    order.look(t, 0, False)
    assert order.fault().endswith("open it with --sort")
    assert not order.is_small


def test_steps_are_judged_alike_in_one_piece_and_in_many():
    t = np.tile(np.arange(1000) * 750, 3)
    whole, pieces = StampOrder(), StampOrder()
    whole.look(t, 0, False)
    for start in range(0, len(t), 7):
        part = t[start : start + 7]
        pieces.look(part, start, bool((np.diff(part) >= 0).all()))
    assert whole.fault() == pieces.fault()


@pytest.mark.parametrize("form", [".npz", ".csv"])
@pytest.mark.parametrize("place", [700, 2999])
def test_an_event_off_the_sensor_and_out_of_time_costs_itself_alone(form, place, tmp_path):
    t = 5 * 10**6 + np.arange(3000) * 40
    path, kept = tmp_path / f"a{form}", np.delete(t, place)
    t[place] = 7
    events = make_events(3000)
    x = events.x.astype(np.uint16)
    x[place] = 4000
    if form == ".npz":
        np.savez(path, x=x, y=events.y, t=t, p=events.p)
    else:
        path.write_text("t_us,x,y,p\n" + "".join(f"{t[i]},{x[i]},{events.y[i]},{events.p[i]}\n" for i in range(3000)))
    with open_recording(path, assume=SIZE) as recording:
        np.testing.assert_array_equal(all_events(recording).t, kept)
        told = "\n".join(remark.text for remark in recording.remarks)
    assert f"the first came before event {place}" in told
    assert "sorted" not in told


@pytest.mark.parametrize("bits", [16, 24, 31, 32, 34])
@pytest.mark.parametrize("num_strays", [1, 3])
@pytest.mark.parametrize("length", [1, 2, 5, 1000])
def test_a_few_stamps_at_the_end_of_a_clock_are_no_turn(bits, num_strays, length):
    period = 1 << bits
    t = np.arange(1000) % (period >> 10)
    t.sort()
    t[500 : 500 + num_strays] = period - 1 - np.arange(num_strays)
    clock = WrappingClock()
    found = [clock.unrolled(t[start : start + length]) for start in range(0, len(t), length)]
    np.testing.assert_array_equal(np.concatenate(found), t)
    assert clock.turns == 0


@pytest.mark.parametrize("length", [1, 7, 5000])
def test_a_clock_that_paused_for_long_turns_all_the_same(length):
    t = np.concatenate([np.arange(100), PERIOD - 2000 + np.arange(4000)])
    clock = WrappingClock()
    found = [clock.unrolled((t % PERIOD)[start : start + length]) for start in range(0, len(t), length)]
    np.testing.assert_array_equal(np.concatenate(found), t)


@pytest.mark.parametrize("form", [".npz", ".csv"])
def test_one_stamp_of_ones_moves_nothing_that_follows(form, tmp_path):
    t = np.arange(3000) * 40
    t[1200] = PERIOD - 1
    path = save(tmp_path / f"a{form}", t)
    with pytest.raises(RecordingError, match="at event 1201"):
        open_recording(path, assume=SIZE)
    with open_recording(path, assume=replace(SIZE, sort=True)) as recording:
        np.testing.assert_array_equal(all_events(recording).t, np.sort(t))

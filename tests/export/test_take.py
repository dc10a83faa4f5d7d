import itertools

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st

from etnet.cli.export import parse_range
from etnet.errors import Cancelled, EtnetError, WindowError
from etnet.export.pace import pace_of
from etnet.reconstruction import reconstruct
from etnet.windows import BetweenFrames, Window
from tests.export.recordings_made_up import NUM_WINDOWS, made_up_take


def test_a_range_gives_the_frames_of_the_whole_run_bit_for_bit():
    take = made_up_take(2, 4)
    frames = [moment.frame for moment in take.moments()]
    sequential = reconstruct(take.playback.model, take.recording, BetweenFrames())
    wanted = [step.frame[0, 0].numpy() for _, step in itertools.islice(sequential, 2, 4)]
    assert all(np.array_equal(a, b) for a, b in zip(frames, wanted, strict=True))


def test_progress_counts_up_to_all_and_a_cancel_stops_before_the_next_window():
    told: list[tuple[int, int]] = []
    list(made_up_take().moments(progress=lambda done, total: told.append((done, total))))
    assert told == [(i + 1, NUM_WINDOWS) for i in range(NUM_WINDOWS)]
    moments = made_up_take().moments(is_cancelled=iter([False] * 4 + [True]).__next__)
    with pytest.raises(Cancelled, match=r"stopped|nobody"):
        list(moments)


@pytest.mark.parametrize(("start", "stop"), [(3, 3), (-1, 2), (0, 99)])
def test_a_range_outside_the_windows_is_refused(start: int, stop: int):
    with pytest.raises(WindowError, match="0:5"):
        made_up_take(start, stop)


@pytest.mark.parametrize(
    ("text", "wanted"), [(None, (0, 10)), ("2:5", (2, 5)), ("7:", (7, 10)), (":3", (0, 3)), ("-2:", (8, 10))]
)
def test_ranges_are_read_as_python_reads_them(text: str | None, wanted: tuple[int, int]):
    assert parse_range(text, 10) == wanted


@pytest.mark.parametrize("text", ["5:2", "a:b", "5", "1:2:3", "10:"])
def test_an_empty_or_broken_range_says_what_it_wants(text: str):
    with pytest.raises(WindowError, match="range"):
        parse_range(text, 10)


def windows_at(stamps: list[int]) -> list[Window]:
    return [Window(i, 0, 0, stamp - 1, stamp) for i, stamp in enumerate(stamps)]


def test_even_windows_are_shown_once_each_in_real_time():
    pace = pace_of(windows_at([0, 40_000, 80_000, 120_000]))
    assert pace.repeats == (1, 1, 1, 1)
    assert pace.frames_per_second == pytest.approx(25)
    assert pace_of(windows_at([0, 40_000, 80_000]), speed=0.5).frames_per_second == pytest.approx(12.5)


@given(
    st.lists(st.integers(1_000, 300_000), min_size=2, max_size=40),
    st.floats(0.05, 4.0),
)
def test_at_every_tick_the_newest_frame_is_shown_whose_stamp_has_passed(gaps: list[int], speed: float):
    stamps = list(itertools.accumulate([0, *gaps]))
    pace = pace_of(windows_at(stamps), speed)
    assert 1 <= pace.frames_per_second <= 60
    shown = [i for i, repeats in enumerate(pace.repeats) for _ in range(repeats)]
    if pace.repeats == (1,) * len(stamps):
        return
    for tick, index in enumerate(shown):
        clock = tick / pace.frames_per_second * speed * 1e6
        assert stamps[index] <= clock + 1
        assert index == len(stamps) - 1 or stamps[index + 1] > clock - 1
    seconds = stamps[-1] / 1e6 / speed
    assert len(shown) == pytest.approx(seconds * pace.frames_per_second, abs=1.5)


@pytest.mark.parametrize("speed", [0.0, -1.0, float("nan")])
def test_a_speed_that_is_none_is_refused(speed: float):
    with pytest.raises(EtnetError, match="speed"):
        pace_of(windows_at([0, 1]), speed)


def test_the_moment_counts_its_seconds_from_the_first_event():
    take = made_up_take()
    moment = next(take.moments())
    assert moment.seconds == (moment.window.t_stop - take.recording.span.start) / 1e6
    assert torch.equal(torch.from_numpy(moment.frame), moment.step.frame[0, 0])

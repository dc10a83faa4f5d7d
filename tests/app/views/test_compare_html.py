"""What a comparison shows is what is there: right runs, right marks, and in plain words what is missing."""

import re
from dataclasses import replace

import numpy as np
import pytest

from app.engine.jobs import JobResult
from app.engine.requests import FrameRequest, Ready
from app.html.moment import Moment
from app.html.pictures import Tones
from app.html.provenance import ModelFacts
from app.state.run import Run
from app.state.view_state import ViewState
from app.views.compare.html.run import RunShown, Truth
from app.views.compare.html.scores import chart_html, curves_over, means_html, means_title, trace
from app.views.compare.html.series import Series, common_keys, mean_over, within
from app.views.compare.html.side import pixel_html
from app.views.compare.html.stage import pictures_html
from app.views.compare.state import CompareState
from app.views.page import Page
from app.views.recording.html.fitness import fitness_html
from app.views.timeline.panel import measure_of
from etnet.events.fitness import Activity, Fitness, Lag, Thresholds
from etnet.stretch import windows_between
from etnet.windows import BetweenFrames, plan_windows
from tests.app.stand_ins import CONTRACT, SENSOR, recording


@pytest.fixture
def moment():
    opened = recording()
    return Moment("a", BetweenFrames(), 7, opened, plan_windows(opened, BetweenFrames()))


def run(moment, number, level=0.5, lag=0, values=None):
    request = FrameRequest("a", f"m{number}", "fp32", moment.policy, 7)
    frame = np.full((SENSOR.height, SENSOR.width), level, np.float32)
    ready = Ready(request, frame, None, 3.0, True, False, False, CONTRACT, 7)
    truth = Truth(8, lag, 100_000 + lag)
    return RunShown(
        number,
        Run(),
        request,
        moment.window,
        30,
        f"network {number}",
        (0.1, 1.0),
        5,
        Tones(),
        truth,
        ready,
        values=values,
    )


def test_the_best_value_is_marked_once_all_runs_have_one(moment):
    numbers = [{"mse": 0.02, "ssim": 0.6, "lpips": 0.3}, {"mse": 0.01, "ssim": 0.5, "lpips": 0.3}]
    runs = [run(moment, i, values=values) for i, values in enumerate(numbers)]
    best = lambda measure, shown=runs: re.findall(  # noqa: E731
        r'et-best" data-testid="value-of-(.)"', pictures_html(moment, shown, CompareState((Run(),), measure=measure))
    )
    assert (best("ssim"), best("mse"), best("lpips")) == (["A"], ["B"], [])
    assert best("ssim", [runs[0], replace(runs[1], values=None)]) == []


def test_equal_frames_are_called_equal_and_others_by_how_far_they_are_apart(moment):
    view = CompareState((Run(),), sight="difference")
    same = pictures_html(moment, [run(moment, 0), run(moment, 1)], view)
    assert "the same, bit for bit" in same
    other = pictures_html(moment, [run(moment, 0), run(moment, 1, 0.75)], view)
    assert "mean |difference| 0.25, largest 0.25" in other
    assert other.count('data-testid="scale"') == 2  # run B minus A, and A minus the camera


@pytest.mark.parametrize("sight", ["difference", "error"])
def test_every_signed_picture_has_a_colour_bar_and_says_what_its_colours_stand_for(moment, sight):
    html = pictures_html(moment, [run(moment, 0), run(moment, 1)], CompareState((Run(),), sight=sight))
    assert html.count('data-reads="ramp:-0.5:0.5:') == html.count('data-testid="scale"') > 0


def test_a_camera_frame_that_is_not_of_this_time_is_said_to_be(moment):
    late = run(moment, 0, lag=-12_000, values={"mse": 0.1, "ssim": 0.5, "lpips": 0.5})
    assert "12 ms before window end: motion between counts as error" in pictures_html(moment, [late], CompareState())
    on_time = run(moment, 0, lag=400, values={"mse": 0.1, "ssim": 0.5, "lpips": 0.5})
    assert "motion between" not in pictures_html(moment, [on_time], CompareState())


@pytest.mark.parametrize("is_cold", [False, True])
def test_a_frame_from_a_cold_start_is_called_so_and_not_changed(moment, is_cold):
    shown = run(moment, 0)
    ready = replace(shown.ready, is_exact=False, is_cold=is_cold, began_at=3)
    html = pictures_html(moment, [replace(shown, ready=ready)], CompareState())
    assert "from a cold start" in html
    assert "The memory was empty at window 3: what came before had left the buffer, or was passed over" in html
    assert "was changed" not in html


def test_a_frame_of_another_window_is_dimmed_and_said(moment):
    shown = run(moment, 0)
    html = pictures_html(moment, [replace(shown, request=replace(shown.request, index=9))], CompareState())
    assert "et-lags" in html
    assert "shows frame 7" in html


def test_the_place_of_the_camera_can_show_a_runs_error(moment):
    runs = [run(moment, 0), run(moment, 1, 0.75)]
    html = pictures_html(moment, runs, CompareState((Run(),), camera="B"))
    assert 'alt="Run B minus camera"' in html
    assert 'alt="Camera frame"' not in html


def test_a_swipe_holds_run_a_against_each_other_run_and_the_camera(moment):
    runs = [run(moment, 0), run(moment, 1), run(moment, 2)]
    html = pictures_html(moment, runs, CompareState((Run(), Run()), sight="swipe"))
    pairs = re.findall(r'et-swiped">(\w+)</span><span class="et-swiped">(\w+)', html)
    assert pairs == [("A", "B"), ("A", "C"), ("A", "camera")]


def test_raw_values_are_read_out_at_the_chosen_pixel(moment):
    html = pixel_html(moment, [run(moment, 0, 0.25), run(moment, 1, 0.75)], (20, 18))
    values = [float(value) for value in re.findall(r'data-value="([\d.]+)"', html)]
    assert values == pytest.approx([0.25, 0.75, (18 * 40 + 20) / (40 * 30 - 1)], rel=1e-6)


def series(moment, number, values, share=1.0, first=0, has_camera=True):
    stamps = np.array([moment.windows[first + i].t_stop for i in range(len(values))])
    columns = {"lpips": np.array(values, np.float64)}
    frames = np.arange(len(values)) + first + 1 if has_camera else np.full(len(values), -1)
    return Series(run(moment, number), stamps, frames, columns, np.zeros(len(values), np.int64), share, len(values))


def test_the_worst_frames_lead_to_their_moments(moment):
    html = means_html(moment, [series(moment, 0, [0.3, 0.9, np.nan, 0.5])], CompareState())
    start = moment.recording.span.start
    seconds = [f"goto:{(moment.windows[i].t_stop - start) / 1e6:.6f}" for i in (1, 3, 0)]
    assert re.findall(r"goto:[\d.]+", html) == seconds


def test_means_are_over_the_frames_that_all_runs_have(moment):
    one, two = series(moment, 0, [0.1, 0.2, 0.3, 0.4]), series(moment, 1, [0.9, 0.5], first=2)
    assert common_keys([one, two]).tolist() == [3, 4]
    assert mean_over(one, "lpips", common_keys([one, two])) == pytest.approx(0.35)
    assert means_title([one, two]) == "Means over the 2 frames that both have"
    html = means_html(moment, [one, two], CompareState())
    shown = {name: float(value) for name, value in re.findall(r'mean-(.)-lpips" data-value="([\d.]+)"', html)}
    assert shown == pytest.approx({"A": 0.35, "B": 0.7})
    assert re.search(r'mean-A-lpips"[^>]*et-best', html)


def test_means_between_two_marks_are_over_the_frames_between_them(moment):
    each = series(moment, 0, [0.1, 0.2, 0.3, 0.4])
    first, last = moment.windows[1], moment.windows[2]
    between = within(each, first.t_start, last.t_stop)  # a window's mark is its beginning, where the one before ends
    assert between.stamps.tolist() == [first.t_stop, last.t_stop]
    assert between.keys.tolist() == [2, 3]
    assert mean_over(between, "lpips", common_keys([between])) == pytest.approx(0.25)


@pytest.mark.parametrize(("first", "last"), [(1, 2), (0, 3), (2, 2), (None, 2), (3, None)])
def test_means_between_two_marks_are_over_the_windows_that_loop_trim_and_export_take(moment, first, last):
    each = series(moment, 0, np.linspace(0.1, 0.9, len(moment.windows)))
    begin = None if first is None else moment.windows[first].t_start
    end = None if last is None else moment.windows[last].t_stop
    taken = [moment.windows[index].t_stop for index in windows_between(moment.windows, begin, end)]
    assert within(each, begin, end).stamps.tolist() == taken


def test_means_are_grey_until_nothing_more_comes(moment):
    whole, half = series(moment, 0, [0.1, 0.2]), series(moment, 1, [0.3], share=0.5)
    assert "et-unfinished" in means_html(moment, [whole, half], CompareState())
    assert "et-unfinished" not in means_html(moment, [whole, series(moment, 1, [0.3, 0.4])], CompareState())


def test_runs_without_a_frame_in_common_are_not_averaged(moment):
    apart = [series(moment, 0, [0.1, 0.2]), series(moment, 1, [0.3, 0.4], first=5)]
    html = means_html(moment, apart, CompareState())
    assert "no frame in common" in html
    assert re.findall(r'data-value="([^"]+)"', html) == ["nan", "nan"]


def test_a_run_that_cannot_be_scored_takes_no_frame_from_the_others(moment):
    broken = Series(run(moment, 1), trouble="This recording has no camera frames.")
    html = means_html(moment, [series(moment, 0, [0.2, 0.4]), broken], CompareState())
    assert "This recording has no camera frames." in html
    assert 'mean-A-lpips" data-value="0.3' in html


def test_a_curve_breaks_where_windows_are_still_to_come():
    xs, ys = np.array([0.0, 1, 2, 9, 10]), np.zeros(5)
    assert trace(xs, ys).count("M") == 2


def test_the_timelines_legend_names_the_measure_of_the_curves_over_it(moment):
    page = Page(ViewState(workspace="compare").put(CompareState(measure="lpips")), moment)
    drawn = curves_over(moment, [series(moment, 0, [0.1, 0.2, 0.3])], "lpips")
    assert measure_of(replace(page, over_timeline=drawn)) == "LPIPS"
    assert measure_of(page) == ""


def test_the_curves_over_the_timeline_stand_where_their_windows_end(moment):
    drawn = curves_over(moment, [series(moment, 0, [0.1, 0.2, 0.3])], "lpips")
    xs = [float(x) for x in re.findall(r"[ML]([\d.]+) ", drawn)][3:]  # the first three are the dark edge
    span = moment.recording.span
    ends = [moment.windows[index].t_stop - span.start for index in range(3)]
    assert xs == pytest.approx([1000 * end / span.duration for end in ends], abs=0.1)


def test_a_measure_that_cannot_be_had_says_where_it_can(moment):
    html = chart_html(moment, [series(moment, 0, [0.3])], CompareState(measure="temporal"))
    assert "Only in the protocol’s range" in html


def test_what_the_card_does_not_say_is_not_guessed_and_what_it_says_is_judged(moment):
    activity = Activity(1000, 0.5, 0.2, 900.0)
    found = Fitness(activity, (), Lag(7000, 0.7, 0.4), Thresholds(0.3, 0.3, 0.8))
    result = JobResult(None, found, 1.0, True)
    model = ModelFacts("net", None, {"contrast_threshold": [0.5, 1.0], "noise_rate": [0.1, 1], "refractory_us": "fast"})
    html = fitness_html(moment, result, model)
    rows = dict(re.findall(r'data-testid="fit-([^"]+)">(.*?)</tr>', html))
    assert "outside" in rows["contrast threshold"]
    assert "inside" in rows["noise rate"]
    assert "not on card" in rows["ON : OFF"]
    assert "not on card" in rows["refractory period"]
    assert 'data-k="set:compare.offset:7000"' in rows["frame–event offset"]
    in_use = fitness_html(moment, result, model, offset=7000)
    assert "Use this offset" not in in_use
    assert "in use" in in_use


def test_a_sensor_that_is_too_small_for_the_metrics_is_named_as_such(moment):
    numbers, values = np.arange(3), {"sharpness": np.full(3, 0.2)}
    made = Series(run(moment, 0), stamps=numbers, frames=numbers, values=values, lags=0 * numbers, share=1.0)
    html = chart_html(moment, [made], CompareState((Run(),), measure="lpips"))
    assert "LPIPS needs 31 pixels a side, the sensor has 40×30" in html
    assert "No window ends near" not in html

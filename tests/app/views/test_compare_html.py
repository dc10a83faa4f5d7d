"""What a comparison shows is what is there: right runs, right marks, and in plain words what is missing."""

import re
from dataclasses import replace

import numpy as np
import pytest

from app.engine.jobs import JobResult
from app.engine.requests import FrameRequest, Ready
from app.html.moment import Moment
from app.html.provenance import ModelFacts
from app.html.tones import Tones
from app.state.run import Run
from app.views.compare.html.run import RunShown, Truth
from app.views.compare.html.runs import box_of, runs_html
from app.views.compare.html.scores import Series, curves_over, scores_html, trace
from app.views.compare.state import CompareState
from app.views.recording.html.fitness import fitness_html
from etnet.events.fitness import Activity, Fitness, Lag, Thresholds
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
    truth = Truth(8, lag)
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
    html = runs_html(moment, runs, CompareState("runs"))
    marked = re.findall(r'class="et-exact" title="best of these runs">([\d.]+)', html)
    assert marked == ["0.600", "0.0100"]
    waiting = [runs[0], replace(runs[1], values=None)]
    assert "best of these" not in runs_html(moment, waiting, CompareState("runs"))


def test_equal_frames_are_called_equal_and_others_by_how_far_they_are_apart(moment):
    view = CompareState("runs", (Run(),), sight="difference")
    same = runs_html(moment, [run(moment, 0), run(moment, 1)], view)
    assert "the same, bit for bit" in same
    other = runs_html(moment, [run(moment, 0), run(moment, 1, 0.75)], view)
    assert "mean |difference| 0.25, largest 0.25" in other


def test_a_camera_frame_that_is_not_of_this_time_is_said_to_be(moment):
    late = run(moment, 0, lag=-12_000, values={"mse": 0.1, "ssim": 0.5, "lpips": 0.5})
    assert "12 ms before the window ends: motion between counts as error" in runs_html(
        moment, [late], CompareState("runs")
    )
    on_time = run(moment, 0, lag=400, values={"mse": 0.1, "ssim": 0.5, "lpips": 0.5})
    assert "motion between" not in runs_html(moment, [on_time], CompareState("runs"))


def test_a_frame_of_another_window_is_dimmed_and_said(moment):
    shown = run(moment, 0)
    html = runs_html(moment, [replace(shown, request=replace(shown.request, index=9))], CompareState("runs"))
    assert "et-lags" in html
    assert "shows frame 7" in html


@pytest.mark.parametrize("query", [None, (0, 0), (39, 29), (20, 3)])
@pytest.mark.parametrize("zoom", [1, 2, 4, 8])
def test_a_zoom_stays_inside_the_sensor_and_holds_its_pixel(moment, zoom, query):
    x, y, width, height = box_of(moment, zoom, query)
    assert x >= 0
    assert y >= 0
    assert x + width <= SENSOR.width
    assert y + height <= SENSOR.height
    if query is not None:
        assert x <= query[0] < x + width
        assert y <= query[1] < y + height


def series(moment, number, values, share=1.0):
    stamps = np.array([moment.windows[i].t_stop for i in range(len(values))])
    columns = {"lpips": np.array(values, np.float64)}
    return Series(run(moment, number), stamps, columns, np.zeros(len(values), np.int64), share)


def test_the_worst_frames_lead_to_their_moments(moment):
    view = CompareState("scores")
    html = scores_html(moment, [series(moment, 0, [0.3, 0.9, np.nan, 0.5])], view)
    start = moment.recording.span.start
    seconds = [f"goto:{(moment.windows[i].t_stop - start) / 1e6:.6f}" for i in (1, 3, 0)]
    assert re.findall(r"goto:[\d.]+", html) == seconds
    assert f'data-value="{np.nanmean([0.3, 0.9, np.nan, 0.5])!r}"'.replace("np.float64(", "").replace(")", "") in html


def test_a_curve_breaks_where_windows_are_still_to_come():
    xs, ys = np.array([0.0, 1, 2, 9, 10]), np.zeros(5)
    assert trace(xs, ys).count("M") == 2


def test_the_curves_over_the_timeline_stand_where_their_windows_end(moment):
    drawn = curves_over(moment, [series(moment, 0, [0.1, 0.2, 0.3])], "lpips")
    xs = [float(x) for x in re.findall(r"[ML]([\d.]+) ", drawn)][3:]  # the first three are the dark edge
    span = moment.recording.span
    ends = [moment.windows[index].t_stop - span.start for index in range(3)]
    assert xs == pytest.approx([1000 * end / span.duration for end in ends], abs=0.1)


def test_a_measure_that_cannot_be_had_says_where_it_can(moment):
    html = scores_html(moment, [series(moment, 0, [0.3])], CompareState("scores", measure="temporal"))
    assert "replay the cut" in html


def test_what_the_card_does_not_say_is_not_guessed_and_what_it_says_is_judged(moment):
    activity = Activity(1000, 0.5, 0.2, 900.0)
    found = Fitness(activity, (), Lag(7000, 0.7, 0.4), Thresholds(0.3, 0.3, 0.8))
    result = JobResult(None, found, 1.0, True)
    model = ModelFacts("net", None, {"contrast_threshold": [0.5, 1.0], "noise_rate": [0.1, 1], "refractory_us": "fast"})
    html = fitness_html(moment, result, model)
    rows = dict(re.findall(r'data-testid="fit-([^"]+)">(.*?)</tr>', html))
    assert "outside" in rows["contrast threshold"]
    assert "inside" in rows["noise"]
    assert "not on card" in rows["ON : OFF"]
    assert "not on card" in rows["refractory time"]
    assert "worth setting as the camera’s clock" in rows["camera lags by"]

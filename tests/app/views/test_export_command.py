"""The command that the page shows is read by the command line as exactly what the page makes."""

import shlex
from dataclasses import replace
from pathlib import Path

import pytest
import tyro

from app.engine.requests import FrameRequest
from app.html.moment import Moment
from app.state.run import Run
from app.state.view_state import ViewState
from app.views.compare.state import CompareState
from app.views.export.command import CommandLine, export_command, policy_text
from app.views.export.runs import camera_error_of
from app.views.export.state import OrderedRun, StartExport
from etnet.cli.export import Arrays, Csv, Export, Frames, Gif, Video, chosen_range, parse_range
from etnet.cli.policy import parse_policy
from etnet.cli.runs import RunOptions, error_place, parse_run
from etnet.events.assumptions import Assumptions
from etnet.events.cleaning import UNCLEANED, Cleaning
from etnet.events.opened_as import OpenedAs, View
from etnet.windows import BetweenFrames, ByCount, ByDensity, ByDuration, plan_windows
from tests.export.recordings_made_up import NUM_WINDOWS, made_up_recording

POLICIES = [BetweenFrames(), ByCount(1234), ByDensity(0.35), ByDensity(1e-4), ByDuration(20_000), ByDuration(1_500, 5)]
WINDOWS, RUN = ByDuration(40_000), CommandLine("it's mine.h5", "etnet-half", "bf16")


def moment(policy=WINDOWS, recording_id="a"):
    recording = made_up_recording()
    return Moment(recording_id, policy, 3, recording, plan_windows(recording, BetweenFrames()))


def parsed(wanted, at, query=None, run=RUN):
    words = shlex.split(export_command(wanted, at, run, query, "out"))
    assert words[:2] == ["etnet", "export"]
    return tyro.cli(Export, args=words[2:])


@pytest.mark.parametrize("policy", POLICIES)
def test_a_policy_in_words_is_that_policy(policy):
    assert parse_policy(policy_text(policy)) == policy


@pytest.mark.parametrize(("format", "kind"), [("mp4", Video), ("gif", Gif)])
def test_everything_chosen_is_in_the_command(format, kind):
    panels = ("events", "reconstruction")
    got = parsed(StartExport(format, 1, 3, panels, 0.25, has_stamps=True), moment())
    assert isinstance(got, kind)
    assert (got.file, got.model, got.precision) == (Path("it's mine.h5"), "etnet-half", "bf16")
    assert (got.panels, got.speed, got.stamps) == (panels, 0.25, True)
    assert parse_policy(got.windows) == ByDuration(40_000)
    whole = moment()
    assert chosen_range(got, whole.recording, whole.windows) == (1, 4)
    plain = parsed(StartExport(format), moment())
    assert not plain.stamps
    assert parse_range(plain.range, NUM_WINDOWS) == (0, NUM_WINDOWS)


def test_a_picture_is_one_window_and_numbers_name_their_arrays():
    picture = parsed(StartExport("png"), moment())
    assert isinstance(picture, Frames)
    assert parse_range(picture.range, NUM_WINDOWS) == (3, 4)
    arrays = parsed(StartExport("npz", arrays=("frames", "attention", "states")), moment(), (9, 7))
    assert isinstance(arrays, Arrays)
    assert (arrays.what, arrays.queries) == (("frames", "attention", "states"), ("9,7",))
    assert parsed(StartExport("npz"), moment()).what == ("frames", "voxels")


def test_the_runs_beside_are_in_the_command_with_what_makes_them_differ():
    at, ask = moment(), lambda **more: FrameRequest("a", "m", "fp32", WINDOWS, 3, **more)
    start = at.recording.span.start
    runs = (
        OrderedRun(ask(), source="etnet-half"),
        OrderedRun(ask(), Run(model_id="x", cold_from=start + 1_250_000), "my nets/x.pth"),
        OrderedRun(ask(), Run(policy=ByCount(300), cleaning=Cleaning(True, 5_000), precision="bf16"), "etnet-half"),
        OrderedRun(ask(), Run(cleaning=UNCLEANED), "etnet-half"),
    )
    shown = ViewState().put(CompareState(sight="difference", offset=-2_500))
    words = shlex.split(export_command(StartExport("mp4", runs=runs), at, RUN, None, "out", shown=shown))
    got = tyro.cli(Export, args=words[2:])
    assert [parse_run(text) for text in got.also] == [
        RunOptions("my nets/x.pth", cold_from=1.25),
        RunOptions("etnet-half", "count=300", "hot,5ms", "bf16"),
        RunOptions("etnet-half", filter="none"),
    ]
    assert (got.show, got.frame_offset) == ("difference", -2.5)


@pytest.mark.parametrize(("sight", "camera", "place"), [
    ("side by side", "frame", None), ("side by side", "A", 0), ("side by side", "C", 2), ("error", "B", 1),
    ("difference", "frame", 0), ("difference", "B", 1),
])  # fmt: skip
def test_the_command_draws_the_error_that_stands_in_the_cameras_place(sight, camera, place):
    request = FrameRequest("a", "m", "fp32", WINDOWS, 3)
    runs = tuple(OrderedRun(request, source="etnet-half", number=number) for number in range(3))
    compare = CompareState(sight=sight, camera=camera)
    assert camera_error_of(compare, (0, 1, 2)) == place
    wanted = StartExport("gif", panels=("reconstruction", "camera"), runs=runs)
    words = shlex.split(export_command(wanted, moment(), RUN, None, "out", shown=ViewState().put(compare)))
    got = tyro.cli(Export, args=words[2:])
    assert error_place(got.camera_error, got.show, len(runs)) == place


@pytest.mark.parametrize("policy", [ByDuration(20_000, 5_000), ByDuration(16_000), ByCount(100)])
def test_the_command_takes_the_windows_between_the_marks_also_where_they_overlap(policy):
    recording = made_up_recording()
    windows = plan_windows(recording, policy)
    at = Moment("a", policy, 3, recording, windows)
    for first, last in ((0, 0), (3, 7), (0, 4), (5, len(windows) - 1), (2, None), (None, 6)):
        stretch = first or 0, (len(windows) - 1 if last is None else last) + 1
        assert chosen_range(parsed(StartExport("csv", first, last), at), recording, windows) == stretch


def test_what_was_stated_of_a_file_and_how_it_is_seen_is_stated_again():
    stated = Assumptions(640, 480, "ms", "inverted", sort=True, drop_outside=True)
    view = View((0, 0, 20, 10), downsample=2, flip="both", rotate=90)
    at = moment()
    got = parsed(StartExport("csv"), replace(at, recording=replace(at.recording, opened_as=OpenedAs(stated, view))))
    assert isinstance(got, Csv)
    assert got.opening.opened_as() == OpenedAs(stated, view)
    assert parsed(StartExport("csv"), moment(), run=CommandLine("-odd.h5", "m")).file == Path("-odd.h5")

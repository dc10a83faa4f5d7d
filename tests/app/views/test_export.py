"""What is exported through the page: the same files as the command line's, made without holding anybody up."""

import asyncio
import io
import json
import re
import threading
import time
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import av
import numpy as np
import pytest

from app.catalogue.cut import with_cut
from app.engine.downloads import Download
from app.engine.jobs import JobResult
from app.engine.pace import Pace
from app.engine.playbacks import LoadedPlayback
from app.engine.requests import FrameRequest
from app.html.provenance import ModelFacts
from app.state.run import Run
from app.state.view_state import Limits, ViewState
from app.views.compare.state import CompareState
from app.views.export.jobs import ExportJob, export_jobs
from app.views.export.runs import camera_error_of, ordered_runs
from app.views.export.state import EXPORT_SLOT, DropExport, ExportState, OrderedRun, StartExport
from app.views.inspect.state import Change, InspectState
from app.views.page import Page, RunFrame
from etnet.errors import Cancelled, EtnetError
from etnet.events.cleaning import UNCLEANED
from etnet.events.edit import EventEdit
from etnet.events.recording import Growth
from etnet.export import session_file
from etnet.export.arrays import ArraysChoice, write_arrays
from etnet.export.compared import Runs, title_of
from etnet.export.images import write_png
from etnet.export.page import PageConfig, write_page
from etnet.export.pictures import Look, draw
from etnet.export.session_file import record_session, write_session
from etnet.export.table import write_table
from etnet.export.take import Beside, Take
from etnet.export.video import write_gif, write_video
from etnet.live.buffer import Keep, LiveBuffer
from etnet.nets.intervention import Intervention
from etnet.nets.runtime import contract_of
from etnet.playback.playback import Playback
from etnet.windows import BetweenFrames, ByDuration, ByStamps, plan_windows
from tests.app.reducing import reduce
from tests.app.stand_ins import Browser, served
from tests.export.recordings_made_up import NUM_WINDOWS, made_up_model, made_up_take

STATE = ViewState(recording_id="a", model_id="m", precision="fp32", policy=BetweenFrames(), index=3, query=(9, 7))


def loaded():
    playback = made_up_take().playback
    return SimpleNamespace(playback=playback, windows=playback.windows, contract=contract_of(playback.model))


def ordered(**wanted):
    state = reduce(STATE, StartExport(**wanted), Limits())
    return ExportJob(state.of(ExportState).order)


def made(job, at=None, cancelled=lambda: False):
    answers = list(job.run(at or loaded(), cancelled))
    assert [share for _, share in answers] == sorted(share for _, share in answers)
    assert all(value is None for value, _ in answers[:-1])
    return answers[-1][0]


BY_HAND = {
    "mp4": lambda take, path: write_video(take, path, Look(("events", "reconstruction"), has_stamps=True), 0.5),
    "gif": lambda take, path: write_gif(take, path, Look(("events", "reconstruction"), has_stamps=True), 0.5),
    "h5": lambda take, path: write_arrays(
        take, path, ArraysChoice(("frames", "voxels", "attention"), ((9, 7),))
    ),
    "csv": write_table,
    "page": lambda take, path: write_page(take, BetweenFrames(), path, PageConfig("made up")),
    "session": lambda take, path: write_session(record_session(take, BetweenFrames()), path),
}  # fmt: skip


@pytest.mark.parametrize("format", BY_HAND)
def test_a_file_is_the_command_lines_to_the_byte(format, tmp_path):
    wanted = {"panels": ("events", "reconstruction"), "speed": 0.5, "has_stamps": True, "first": 1, "last": 3}
    taken = made(ordered(format=format, **wanted))
    path = tmp_path / taken.name
    BY_HAND[format](Take(made_up_take().playback, 1, 4), path)
    assert taken.content == path.read_bytes()


def request(policy=None, **more):
    return FrameRequest("a", "m", "fp32", policy or BetweenFrames(), 3, **more)


def beside_at(playbacks):
    """The engine's playbacks, by policy."""
    at = loaded()
    at.beside = lambda request: SimpleNamespace(playback=playbacks[request.policy], windows=None, contract=at.contract)
    return at


@pytest.mark.parametrize("format", ["mp4", "gif", "png"])
@pytest.mark.parametrize(("sight", "shown", "camera_error"), [
    ("side by side", "frames", None), ("swipe", "frames", None), ("difference", "difference", 0),
    ("error", "error", None),
])  # fmt: skip
def test_compared_runs_are_exported_side_by_side_as_the_command_line_does(tmp_path, format, sight, shown, camera_error):
    policy, take = ByDuration(16_000), made_up_take()
    other = Playback(made_up_model(), take.recording, plan_windows(take.recording, policy))
    runs = OrderedRun(request()), OrderedRun(request(policy), Run(policy=policy), number=1)
    state = STATE.put(CompareState(sight=sight, offset=500))
    wanted = StartExport(format, 1, 3, ("reconstruction", "camera"), 0.5, runs=runs)
    taken = made(ExportJob(reduce(state, wanted, Limits()).of(ExportState).order), beside_at({policy: other}))
    titles = (title_of(take.playback.model, BetweenFrames(), UNCLEANED, None, 1.0),
              title_of(other.model, policy, UNCLEANED, None, 1.0))  # fmt: skip
    look = Look(("reconstruction", "camera"), runs=Runs(titles, shown, camera_error))
    first, last = (3, 4) if format == "png" else (1, 4)
    compared = Take(take.playback, first, last, (Beside(other),), 500)
    path = tmp_path / taken.name
    match format:
        case "mp4":
            write_video(compared, path, look, 0.5)
        case "gif":
            write_gif(compared, path, look, 0.5)
        case "png":
            write_png(path, draw(next(compared.moments()), look, NUM_WINDOWS))
    assert taken.content == path.read_bytes()


def test_a_protocols_runs_are_exported_over_its_own_windows_between_the_marks():
    take = made_up_take()
    stops = tuple(window.t_stop for window in take.playback.windows)
    replayed = request(ByStamps(stops), cold_at=1)
    state = replace(STATE, mark_a=stops[0], mark_b=stops[2])
    wanted = StartExport("gif", runs=(OrderedRun(replayed, Run(replays="paper")),))
    order = reduce(state, wanted, Limits(windows=take.playback.windows)).of(ExportState).order
    at = SimpleNamespace(playback=take.playback, windows=take.playback.windows, contract=loaded().contract)
    job = ExportJob(order)
    assert job.request.playback == replayed.playback
    content = made(job, at).content
    with av.open(io.BytesIO(content)) as film:
        assert film.streams.video[0].frames == 2


def test_what_compare_shows_is_what_is_ordered_and_elsewhere_the_page_alone():
    runs = tuple(
        RunFrame(number, Run(), asked, None, 5, ModelFacts("n", source="etnet-half"), 20, trouble=trouble)
        for number, (asked, trouble) in enumerate([(request(), ""), (request(ByDuration(5)), ""), (None, "no frames")])
    )
    page = Page(replace(STATE, workspace="compare"), runs=runs)
    assert [run.request for run in ordered_runs(page)] == [request(), request(ByDuration(5))]
    apart = replace(page, runs=(runs[0], replace(runs[2], number=1), replace(runs[1], number=2)))
    assert [run.number for run in ordered_runs(apart)] == [0, 2]
    assert camera_error_of(CompareState(camera="C"), (0, 2)) == 1
    assert camera_error_of(CompareState(camera="B"), (0, 2)) is None
    assert ordered_runs(replace(page, runs=runs[:1])) == ()
    assert ordered_runs(replace(page, state=STATE)) == ()
    protocol = page.state.put(CompareState(replays=True))
    assert len(ordered_runs(replace(page, state=protocol, runs=runs[:1]))) == 1


def test_arrays_hold_the_frames_of_the_plain_run(tmp_path):
    taken = made(ordered(format="npz"))
    path = tmp_path / taken.name
    path.write_bytes(taken.content)
    with np.load(path) as arrays:
        assert not any(name.startswith("state/") for name in arrays)
        expected = np.stack([moment.frame for moment in made_up_take().moments()])
        assert np.array_equal(arrays["frames"], expected)
        assert len(arrays["window"]) == NUM_WINDOWS
        assert any(name.startswith("attention/") for name in arrays)


def test_arrays_hold_states_and_camera_frames_as_the_commands_do(tmp_path):
    names = ("frames", "camera", "states")
    taken = made(ordered(format="h5", arrays=names))
    path = tmp_path / taken.name
    write_arrays(made_up_take(), path, ArraysChoice(names, ((9, 7),)))
    assert taken.content == path.read_bytes()


def test_a_picture_is_of_the_window_that_was_on_show():
    a = made(ordered(format="png", first=0, last=0))
    assert a.content.startswith(b"\x89PNG")
    other = ExportJob(reduce(replace(STATE, index=0), StartExport("png"), Limits()).of(ExportState).order)
    assert made(other).content != a.content


def test_a_step_that_had_to_give_way_is_made_after_it_and_nothing_differs():
    turns = iter(range(10**6))
    plain, interrupted = ordered(format="csv"), ordered(format="csv")
    assert made(interrupted, cancelled=lambda: next(turns) % 3 == 0).content == made(plain).content


REMOVED = Intervention(removed_scales=frozenset({1}))
HELD = [
    (Change(REMOVED), session_file.Change(0, REMOVED)),
    (Change(REMOVED, since=2), session_file.Change(2, REMOVED)),
    (Change(Intervention(zeroed_levels=frozenset({2})), since=1),
     session_file.Change(1, Intervention(zeroed_levels=frozenset({2})))),
    (Change(Intervention(zeroed_levels=frozenset({2}))), None),
    (Change(REMOVED, EventEdit(drop=0.5), since=1), None),
    (Change(REMOVED, since=4), None),
    (Change(since=1), None),
]  # fmt: skip


@pytest.mark.parametrize(("change", "held"), HELD)
def test_a_session_holds_what_is_changed_if_a_run_can(change, held, tmp_path):
    state = STATE.put(InspectState(change=change))
    order = reduce(state, StartExport("session", 1, 3), Limits()).of(ExportState).order
    taken = made(ExportJob(order))
    path = tmp_path / taken.name
    write_session(record_session(Take(made_up_take().playback, 1, 4), BetweenFrames(), held), path)
    assert taken.content == path.read_bytes()


@pytest.mark.parametrize("changed", [{"path": Path("film-1.h5")}, {"growth": Growth(0.5)}])
def test_no_session_is_made_of_what_nobody_can_open_again(changed):
    job, at = ordered(format="session"), loaded()
    at.playback.recording = replace(at.playback.recording, **changed)
    with pytest.raises(EtnetError, match=r"simulated video is gone with its page|a part of it is indexed"):
        made(job, at)


@pytest.mark.parametrize("is_live", [True, False])
def test_no_session_is_made_of_a_live_recording_nor_of_windows_that_no_plan_gives_again(is_live):
    job, at = ordered(format="session"), loaded()
    extent = LiveBuffer(at.playback.recording.sensor, Keep()).extent if is_live else None
    at.playback.recording = with_cut(at.playback.recording, BetweenFrames(), at.playback.windows, extent)
    with pytest.raises(EtnetError, match=r"press Record, open the file" if is_live else r"--windows as-cut"):
        made(job, at)


def test_a_session_is_made_of_a_recorded_file_whose_windows_were_chosen_anew():
    job, at = ordered(format="session", first=1, last=3), loaded()
    at.playback.recording = with_cut(at.playback.recording, ByDuration(77), at.playback.windows)
    assert made(job, at).content == made(job).content


def test_who_cancels_leaves_no_thread_and_no_file(tmp_path, monkeypatch):
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    answers = ordered(format="mp4").run(loaded(), lambda: False)
    next(answers)
    next(answers)
    assert list(tmp_path.iterdir())
    answers.close()
    assert not list(tmp_path.iterdir())
    assert not [thread for thread in threading.enumerate() if thread.name == "taking away"]


def test_what_is_too_large_for_a_page_is_said_with_a_way_out(monkeypatch):
    monkeypatch.setattr("app.views.export.jobs.LARGEST", 1000)
    with pytest.raises(EtnetError, match=r"etnet export"):
        made(ordered(format="h5"))


def test_what_becomes_too_large_for_a_page_ends_before_all_of_it_is_made(monkeypatch):
    monkeypatch.setattr("app.views.export.jobs.LARGEST", 1000)
    at, steps = loaded(), []
    step = at.playback.at
    monkeypatch.setattr(at.playback, "at", lambda *given, **more: steps.append(given) or step(*given, **more))
    with pytest.raises(EtnetError, match=r"comes to more than 1 kB.*etnet export"):
        made(ordered(format="npz"), at)
    assert len(steps) < NUM_WINDOWS


@pytest.mark.parametrize(("first", "last"), [(1, NUM_WINDOWS), (NUM_WINDOWS, None), (NUM_WINDOWS + 2, NUM_WINDOWS + 4)])
def test_a_stretch_that_is_not_there_is_an_error_and_no_other_stretch(first, last):
    with pytest.raises(EtnetError, match=r"there are 0 – 4; set the marks"):
        made(ordered(format="csv", first=first, last=last))


@pytest.mark.parametrize(("change", "said"), [
    (Change(), None),
    (Change(since=2), None),
    (Change(Intervention(zeroed_levels=frozenset({2}))), "state of level 2 zeroed, in each window for itself"),
    (Change(edit=EventEdit(drop=0.5), since=1),
     "50 % of the events dropped, persistent from window 1 (voxels hold the events as they are)"),
])  # fmt: skip
def test_arrays_of_a_changed_network_say_what_is_changed(change, said):
    state = STATE.put(InspectState(change=change))
    order = reduce(state, StartExport("npz"), Limits()).of(ExportState).order
    playback = made_up_take().playback
    content = made(ExportJob(order), LoadedPlayback(playback, contract_of(playback.model), 4, Pace(), 1.0)).content
    with np.load(io.BytesIO(content)) as arrays:
        assert json.loads(str(arrays["facts"])).get("changed") == said


def test_what_a_recording_does_not_have_is_said():
    job, at = ordered(format="png", panels=("camera",)), loaded()
    object.__setattr__(at.playback.recording, "ground_truth", None)
    with pytest.raises(EtnetError, match="no camera frames"):
        made(job, at)


def test_an_order_stands_whatever_is_looked_at_afterwards_and_only_one_at_a_time():
    request = FrameRequest("a", "m", "fp32", BetweenFrames(), 3)
    assert export_jobs(STATE, request) == {}
    first = reduce(STATE, StartExport("mp4"), Limits())
    job = export_jobs(first, request)[EXPORT_SLOT]
    moved = replace(first, index=1, recording_id="b")
    assert export_jobs(moved, request)[EXPORT_SLOT] == job
    assert reduce(first, DropExport(), Limits()).of(ExportState).order is None


def visit(story):
    async def run():
        with served() as viewer:
            async with Browser.open(viewer.port, tab=3) as browser:
                await browser.until_shown("Reconstruction of window 0")
                await browser.use(browser.widget("channel"), "pick|tab:export|0|0|1")
                await browser.until(lambda: browser.is_open("Export"))
                await story(viewer, browser)

    asyncio.run(run())


def test_a_visitor_makes_a_file_cancels_it_makes_it_again_and_gets_it():
    async def story(viewer, browser):
        asked = lambda: [job for _, slot, job in viewer.engine.jobs if slot == EXPORT_SLOT]  # noqa: E731
        await browser.use(browser.widget("Format"), "Numbers of every window (CSV)")
        await browser.use(browser.widget("Export"), True)
        await browser.until(lambda: asked() and asked()[-1] is not None)
        assert asked()[-1].order.wanted.format == "csv"
        await browser.until_shown(", 0%")
        await browser.use(browser.widget("Cancel"), True)
        await browser.until(lambda: asked()[-1] is None)
        await browser.use(browser.widget("Export"), True)
        await browser.until(lambda: asked()[-1] is not None)
        job = asked()[-1]
        session = next(iter(viewer.sessions.values()))
        viewer.engine.tell(EXPORT_SLOT, JobResult(job, Download("a.csv", b"1,2\n" * 40), 1.0, is_whole=True))
        await browser.until(lambda: any(kind == "FileTransferPart" for _, kind, _ in browser.arrivals))
        part = next(message for _, kind, message in browser.arrivals if kind == "FileTransferPart")
        assert part["content"] == b"1,2\n" * 40
        await browser.until(lambda: session._state.of(ExportState).order is None)

    visit(story)


def test_the_form_follows_its_own_choices_while_the_page_rests():
    words = lambda browser: re.sub(r"<[^>]+>", "", browser.html())  # noqa: E731

    async def story(viewer, browser):
        is_shown = lambda label: browser.widgets[browser.widget(label)]["visible"]  # noqa: E731
        await asyncio.sleep(1.0)  # the page has come to rest: nothing but the form makes it draw
        await browser.until(lambda: is_shown("Scale") and is_shown("Frames a second"))
        await browser.use(browser.widget("Format"), "Numbers of every window (CSV)")
        await browser.until(lambda: not (is_shown("Speed") or is_shown("Burn in timestamps")))
        await browser.until(lambda: "etnet export csv" in words(browser))
        assert not is_shown("States (large)")
        await browser.use(browser.widget("Format"), "Picture of this window (PNG)")
        await browser.until(lambda: is_shown("Picture") and is_shown("Burn in timestamps"))
        await browser.use(browser.widget("Picture"), "the whole layout")
        await browser.until(lambda: not is_shown("Burn in timestamps"))
        await browser.use(browser.widget("Format"), "Arrays (NPZ)")
        await browser.until(lambda: is_shown("States (large)") and is_shown("Camera frames"))
        await browser.use(browser.widget("States (large)"), True)
        await browser.until(lambda: "--what frames voxels states" in words(browser))

    visit(story)


def test_a_kept_view_holds_no_order():
    from app.state.stored import to_text

    assert "order" not in json.dumps(json.loads(to_text(reduce(STATE, StartExport("mp4"), Limits()))))


def test_a_writer_that_fails_says_so_and_ends(monkeypatch):
    def broken(*_, **__):
        raise OSError("no space left on device")

    monkeypatch.setattr("etnet.export.table.write_table", broken)
    began = time.monotonic()
    with pytest.raises((OSError, Cancelled), match="no space"):
        made(ordered(format="csv"))
    assert time.monotonic() - began < 5

"""Scores of the viewer are those of the library, digit for digit, whoever asks, in whatever order."""

from dataclasses import dataclass, field, replace

import numpy as np
import pytest
import torch

from app.catalogue.models import ModelEntry
from app.catalogue.recordings import Catalogue
from app.config import ViewerConfig
from app.engine.engine import Engine
from app.engine.replayed import FIRST, replayed_windows
from app.engine.requests import FrameRequest, Ready
from app.html.moment import Moment
from app.html.provenance import ModelFacts
from app.state.run import Run
from app.state.view_state import ViewState
from app.views.compare.jobs import scores as looking
from app.views.compare.jobs.runs import run_jobs
from app.views.compare.jobs.scores import MomentScore, ProtocolRun, Strip
from app.views.page import RunFrame
from app.views.recording.jobs.fitness import FitnessJob
from etnet.evaluation.evaluate import FrameJudge, Judges, evaluate
from etnet.evaluation.metrics import sharpness
from etnet.evaluation.protocol import EVREAL, PAPER, PROTOCOLS, plan_protocol
from etnet.events.cleaning import Cleaning
from etnet.events.open import open_recording
from etnet.events.recording import recording_of_events
from etnet.nets.presets import build_model
from etnet.nets.weights import save_weights
from etnet.reconstruction import reconstruct
from etnet.windows import BetweenFrames, ByCount, ByDensity, ByDuration, from_window, plan_windows
from tests.app.fakes import Inbox, Notes, recording_of
from tests.evaluation.recordings import made_up
from tests.real_data import real_file


@dataclass
class Shelf:
    recordings: dict = field(default_factory=lambda: {"r": made_up(), "events alone": recording_of(20)})

    def open(self, recording_id):
        return self.recordings[recording_id]

    def model(self, model_id):
        return ModelEntry(model_id, model_id, "", False, None, None, model_id)


@pytest.fixture(scope="module")
def network():
    return build_model("tiny")


@pytest.fixture
def engine(network):
    threads = torch.get_num_threads()
    torch.set_num_threads(1)
    made = Engine(Shelf(), 64 << 20, threads=1, load=lambda *_: network, prefetches=False)
    yield made
    made.stop()
    torch.set_num_threads(threads)


def request(index=0, policy=None, recording="r", **more):
    return FrameRequest(recording, "tiny", "fp32", policy or BetweenFrames(), index, **more)


def answer(engine, job):
    notes = Notes()
    engine.job("ada", "slot", job, notes)
    _, result = notes.wait(lambda reply: reply[1].is_whole or reply[1].trouble, timeout=60)
    assert not result.trouble, result.trouble
    return result.value


@pytest.mark.parametrize("rule", ["paper", "evreal"])
def test_the_strip_holds_each_frame_against_its_camera_frame_as_the_protocols_judge_does(engine, network, rule):
    recording = made_up()
    strip = answer(engine, Strip(request(), rule))
    judge = FrameJudge(PROTOCOLS[rule], Judges.default())
    assert strip.indices.tolist() == list(range(7))
    assert not strip.lags.any()
    assert strip.frames.tolist() == list(range(1, 8))
    for index, (window, step) in enumerate(reconstruct(network, recording, BetweenFrames())):
        assert strip.stamps[index] == window.t_stop
        target = torch.from_numpy(recording.ground_truth.read_frame(index + 1))[None, None]
        wanted = judge.score(judge.prepare(step.frame), target, judge.features(target))
        for name in ("mse", "ssim", "lpips", "sharpness", "contrast"):
            assert strip.values[name][index] == wanted[name]
        assert strip.values["density"][index] == window.num_events / recording.sensor.num_pixels


@pytest.mark.parametrize("protocol", [PAPER, EVREAL])
def test_the_protocols_own_run_gives_the_numbers_of_an_evaluation_to_the_last_digit(engine, network, protocol):
    wanted = evaluate(network, made_up(), protocol)
    shown = answer(engine, ProtocolRun(request(), protocol.name))
    assert shown.to_json() == wanted.to_json()
    assert shown.mean("lpips") == wanted.mean("lpips")


@pytest.mark.real
def test_on_a_real_sequence_it_replays_the_cut_of_the_tables(tmp_path):
    torch.set_num_threads(1)
    save_weights(build_model("firenet"), tmp_path / "mine.safetensors", dtype=None)
    path = real_file("derived/slider_depth_0.4s_evreal.zip")
    catalogue = Catalogue(ViewerConfig(file=path, data=tmp_path))
    model = next(entry for entry in catalogue.models() if entry.subtitle.startswith("mine.safetensors"))
    made = Engine(catalogue, 64 << 20, threads=1, prefetches=False)
    try:
        shown = answer(
            made, ProtocolRun(FrameRequest(catalogue.entries()[0].id, model.id, "fp32", BetweenFrames(), 0), "paper")
        )
    finally:
        made.stop()
    from etnet.nets.weights import load_model

    with open_recording(path) as recording:
        wanted = evaluate(load_model(tmp_path / "mine.safetensors"), recording, PAPER)
    for row, columns in wanted.rows.items():
        for measure, column in columns.items():
            assert np.array_equal(shown.rows[row][measure], column, equal_nan=True), (row, measure)


def test_windows_that_end_beside_the_camera_frames_tell_how_far(engine):
    strip = answer(engine, Strip(request(policy=ByDuration(13_000)), "paper"))
    stamps = made_up().ground_truth.stamps
    for stamp, lag in zip(strip.stamps, strip.lags, strict=True):
        assert stamp + lag in stamps
    assert np.abs(strip.lags[1:]).max() <= 6_500  # the first frame was taken before the first event
    shifted = answer(engine, Strip(request(policy=ByDuration(13_000)), "paper", offset=2_000))
    for stamp, lag in zip(shifted.stamps, shifted.lags, strict=True):
        assert stamp + lag - 2_000 in stamps


def test_without_a_camera_only_what_needs_none_is_measured(engine, network):
    strip = answer(engine, Strip(request(policy=ByCount(50), recording="events alone"), "paper"))
    assert set(strip.values) == {"sharpness", "contrast", "rate", "density"}
    frames = [step.frame for _, step in reconstruct(network, recording_of(20), ByCount(50))]
    assert strip.values["sharpness"].tolist() == [sharpness(frame).item() for frame in frames]


def test_a_long_plan_is_scored_where_frames_exist_and_grows_with_them(engine, monkeypatch):
    monkeypatch.setattr(looking, "MOST_WINDOWS", 10)
    inbox = Inbox()
    for index in (3, 5):
        engine.request("ada", request(index, ByCount(50), "events alone"), inbox)
        inbox.ready(index)
    strip = answer(engine, Strip(request(policy=ByCount(50), recording="events alone"), "paper", num_seen=2))
    assert strip.is_sparse
    assert strip.indices.tolist() == [3, 5]
    engine.request("ada", request(11, ByCount(50), "events alone"), inbox)
    inbox.ready(11)
    again = answer(engine, Strip(request(policy=ByCount(50), recording="events alone"), "paper", num_seen=3))
    assert again.indices.tolist() == [3, 5, 11]


def test_a_strip_of_a_recording_that_grows_is_asked_again_and_holds_all_of_it(engine):
    """It kept the windows of the first moment, as the whole curve."""
    policy, page, now = ByCount(50), ViewState(recording_id="r", model_id="tiny", precision="fp32"), []

    def grow(num_windows):
        part = recording_of_events(recording_of(20).read(0, 50 * num_windows), "r")
        now[:] = [replace(part, latest=lambda: now[0])]

    def strip():
        windows = plan_windows(now[0], policy)
        run = RunFrame(0, Run(), request(policy=policy), windows[0], len(windows), ModelFacts("tiny"), 20)
        jobs = run_jobs(page, Moment("r", policy, 0, now[0], windows), [run], lambda _: 0)
        return next(job for job in jobs.values() if isinstance(job, Strip))

    grow(8)
    engine._playbacks._library.recordings["r"] = now[0]
    first = strip()
    assert answer(engine, first).indices.tolist() == list(range(8))
    grow(20)
    assert strip() != first
    assert answer(engine, strip()).indices.tolist() == list(range(20))


def test_a_frame_is_scored_once_for_strip_and_moment(engine, monkeypatch):
    strip = answer(engine, Strip(request(policy=ByDuration(17_000)), "paper"))
    monkeypatch.setattr("app.engine.frame_scores._judged", lambda *_: pytest.fail("scored once more"))
    index = int(strip.indices[2])
    frame = made_up().ground_truth.nearest(int(strip.stamps[2]))
    values = answer(engine, MomentScore(request(index, ByDuration(17_000)), "paper", frame))
    assert values["lpips"] == strip.values["lpips"][2]


def test_other_windows_and_back_is_the_identical_frame(engine):
    def frame(**more):
        inbox = Inbox()
        engine.request("ada", request(**more), inbox)
        return inbox.wait(lambda reply: isinstance(reply, Ready) and not reply.is_approximate, timeout=60).frame

    first = frame(index=5)
    others = [frame(index=3, policy=policy) for policy in (ByDensity(0.2), ByDuration(9_000), ByCount(300))]
    assert all(not np.array_equal(first, other) for other in others)
    assert np.array_equal(frame(index=5), first)


def test_a_cold_start_sees_nothing_of_what_was_before(engine, network):
    inbox = Inbox()
    engine.request("ada", request(2, cold_at=3), inbox)
    shown = inbox.ready(2, timeout=60)
    from etnet.playback.playback import Playback
    from etnet.windows import from_window, plan_windows

    recording = made_up()
    later = from_window(plan_windows(recording, BetweenFrames()), 3)
    assert [window.index for window in later] == [0, 1, 2, 3]
    assert np.array_equal(shown.frame, Playback(network, recording, later).at(2).frame[0, 0].numpy())
    assert shown.is_cold


def test_a_cleaned_run_shows_what_the_cleaned_recording_gives(engine, network):
    from etnet.events.denoise import cleaned

    cleaning = Cleaning(support_within=20_000)
    inbox = Inbox()
    engine.request("ada", request(4, cleaning=cleaning), inbox)
    steps = list(reconstruct(network, cleaned(made_up(), cleaning), BetweenFrames()))
    assert np.array_equal(inbox.ready(4, timeout=60).frame, steps[4][1].frame[0, 0].numpy())


def test_what_kind_of_recording_it_is_is_told_bit_by_bit(engine):
    found = answer(engine, FitnessJob(request()))
    assert found.activity.num_looked_at == made_up().num_events


@pytest.mark.parametrize("rule", ["paper", "evreal"])
def test_a_replayed_protocol_shows_the_very_frames_that_it_scores(engine, network, rule):
    recording = made_up()
    policy = replayed_windows(recording, rule)
    wanted = evaluate(network, recording, PROTOCOLS[rule])
    items = plan_protocol(recording, PROTOCOLS[rule]).items
    windows = from_window(plan_windows(recording, policy), FIRST)
    assert [window.t_stop for window in windows] == [item.window.t_stop for item in items]
    assert [window.num_events for window in windows][1:] == [item.window.num_events for item in items][1:]
    for index in (0, 3, len(items) - 1):
        inbox = Inbox()
        engine.request("ada", request(index, policy, cold_at=FIRST), inbox)
        inbox.ready(index, timeout=60)
        values = answer(engine, MomentScore(request(index, policy, cold_at=FIRST), rule, items[index].frame))
        assert values["lpips"] == wanted.rows["as it is"]["lpips"][index]

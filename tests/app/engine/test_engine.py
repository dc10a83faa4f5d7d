import gc
import logging
import threading
import time
import weakref
from dataclasses import replace

import numpy as np
import pytest
import torch

import app.engine.engine as engine_module
from app.engine import queue
from app.engine.playbacks import KEPT_PLAYBACKS
from app.engine.requests import Failed, Ready, Working
from etnet.events.events import Sensor
from etnet.events.recording import recording_of_events
from etnet.nets.intervention import Intervention
from etnet.reconstruction import window_voxel
from etnet.windows import ByDuration, plan_windows
from tests.app.fakes import POLICY, Inbox, hold, recording_of, request, sequential


def test_a_request_is_served_exactly(shelf, make_engine):
    inbox = Inbox()
    make_engine().request("ada", request(7), inbox)
    ready = inbox.ready(7)
    assert ready.is_exact
    assert not ready.is_approximate
    assert np.array_equal(ready.frame, sequential(shelf, 7))
    assert ready.frame.dtype == np.float32


def test_frames_are_read_only_because_visitors_share_them(make_engine):
    inbox = Inbox()
    make_engine().request("ada", request(0), inbox)
    with pytest.raises(ValueError):
        inbox.ready(0).frame[0, 0] = 1


@pytest.mark.parametrize("prefetches", [False, True])
def test_a_visitor_who_has_left_is_not_held(make_engine, prefetches):
    engine, inbox = make_engine(prefetches=prefetches), Inbox()
    engine.request("ada", request(7), inbox)
    inbox.ready(7)
    engine.drop("ada")
    gone = weakref.ref(inbox)
    del inbox
    ends = time.monotonic() + 5
    while gone() is not None and time.monotonic() < ends:
        time.sleep(0.01)
        gc.collect()
    assert gone() is None


def test_a_frame_that_is_held_costs_no_step(shelf, make_engine):
    engine, inbox = make_engine(), Inbox()
    engine.request("ada", request(5), inbox)
    inbox.ready(5)
    encodes, decodes = shelf.model_instance.encodes, shelf.model_instance.decodes
    other = Inbox()
    engine.request("bob", request(5), other)
    assert np.array_equal(other.ready(5).frame, inbox.ready(5).frame)
    assert (shelf.model_instance.encodes, shelf.model_instance.decodes) == (encodes, decodes)


def test_of_many_requests_only_the_newest_is_served(shelf, make_engine):
    engine, inbox = make_engine(), Inbox()
    gate = hold(shelf.model_instance)
    engine.request("ada", request(30), inbox)
    assert shelf.model_instance.entered.acquire(timeout=10)
    for index in range(20, 30):
        engine.request("ada", request(index), inbox)
    engine.request("ada", request(2), inbox)
    gate.release(1000)
    inbox.ready(2)
    time.sleep(0.05)
    assert [r.request.index for r in inbox.of(Ready)] == [2]


def test_an_abandoned_seek_runs_at_most_one_more_encode(shelf, make_engine):
    engine, inbox = make_engine(), Inbox()
    model = shelf.model_instance
    gate = hold(model)
    for abandoned in range(10):
        engine.request("ada", request(39, recording="r"), inbox)
        assert model.entered.acquire(timeout=10)
        begun = model.encodes
        engine.drop("ada")
        gate.release()
        deadline = time.monotonic() + 0.05
        while time.monotonic() < deadline:
            assert model.encodes <= begun, f"seek {abandoned} went on"
            time.sleep(0.01)
    assert model.encodes == 10  # one each, and each went on from where the last was left
    assert inbox.of(Ready) == []


def test_the_work_of_an_abandoned_seek_is_kept(shelf, make_engine):
    engine, inbox = make_engine(), Inbox()
    model = shelf.model_instance
    gate = hold(model)
    engine.request("ada", request(39), inbox)
    for _ in range(20):
        assert model.entered.acquire(timeout=10)
        gate.release()
    engine.request("ada", request(10), inbox)
    gate.release(1000)
    inbox.ready(10)
    assert model.encodes <= 21


def test_a_long_seek_does_not_starve_another_visitor(shelf, make_engine, monkeypatch):
    monkeypatch.setattr(engine_module, "QUANTUM", 0.02)
    shelf.recordings["long"] = recording_of(400, seed=1)
    engine, ada, bob = make_engine(), Inbox(), Inbox()
    model = shelf.model_instance
    slow = model.encode

    def encode(*given):
        time.sleep(0.005)
        return slow(*given)

    model.encode = encode
    engine.request("ada", request(399, recording="long"), ada)
    ada.wait(lambda r: isinstance(r, Working) and r.total > 1)
    engine.request("bob", request(1), bob)
    bob.ready(1)
    assert ada.of(Ready) == []
    ada.ready(399, timeout=30)
    assert model.encodes < 400 + 10  # nothing was done twice


def test_a_visitor_who_left_gets_nothing(shelf, make_engine):
    engine, inbox = make_engine(), Inbox()
    gate = hold(shelf.model_instance)
    engine.request("ada", request(3), inbox)
    assert shelf.model_instance.entered.acquire(timeout=10)
    engine.drop("ada")
    seen = len(inbox.replies)
    gate.release(1000)
    other = Inbox()
    engine.request("bob", request(1), other)
    other.ready(1)
    assert len(inbox.replies) == seen


@pytest.mark.parametrize(
    ("asked", "said"),
    [
        (request(0, recording="gone"), "no such recording"),
        (request(0, model="missing"), "no such model"),
        (request(40), "this plan has 40"),
        (request(-1), "does not exist"),
        (request(0, intervention=Intervention(zeroed_levels=frozenset({1})), since=3), "lies before window 3"),
    ],
)
def test_an_error_with_a_name_becomes_a_reply_and_the_engine_lives(asked, said, make_engine):
    engine, inbox = make_engine(), Inbox()
    engine.request("ada", asked, inbox)
    assert said in inbox.failed().message
    engine.request("ada", request(1), inbox)
    inbox.ready(1)


@pytest.mark.parametrize(
    ("slip", "said"), [(ZeroDivisionError("oh"), "ZeroDivisionError"), (MemoryError(), "--budget")]
)
def test_an_unexpected_error_becomes_a_reply_and_the_engine_lives(shelf, make_engine, slip, said, caplog):
    engine, inbox = make_engine(), Inbox()
    engine.request("bob", request(0), Inbox())
    shelf.model_instance.breaks_at_decode = None
    engine.request("ada", request(1), inbox)
    inbox.ready(1)
    shelf.model_instance.breaks_at_decode = slip
    with caplog.at_level(logging.CRITICAL):
        engine.request("ada", request(2), inbox)
        failed = inbox.failed()
    assert said in failed.message
    engine.request("ada", request(2), inbox)
    inbox.ready(2)


def test_a_visitor_whose_delivery_breaks_harms_nobody(make_engine, caplog):
    engine, inbox = make_engine(), Inbox()

    def broken(reply):
        raise ConnectionError("gone")

    engine.request("ada", request(1), broken)
    engine.request("bob", request(2), inbox)
    inbox.ready(2)


def test_a_held_frame_comes_first_and_its_attention_after(make_engine):
    engine, inbox = make_engine(), Inbox()
    engine.request("ada", request(4), inbox)
    inbox.ready(4)
    engine.request("ada", request(4, wants_attention=True), inbox)
    inbox.wait(lambda r: isinstance(r, Ready) and r.attention is not None)
    with_attention = [r.attention is not None for r in inbox.of(Ready)]
    assert with_attention == [False, False, True]


def test_attention_is_shared_between_visitors(shelf, make_engine):
    engine, ada, bob = make_engine(), Inbox(), Inbox()
    engine.request("ada", request(4, wants_attention=True), ada)
    held = ada.ready(4).attention
    decodes = shelf.model_instance.decodes
    engine.request("bob", request(4, wants_attention=True), bob)
    assert bob.wait(lambda r: isinstance(r, Ready) and r.attention is not None).attention is held
    assert shelf.model_instance.decodes == decodes


def test_a_far_seek_shows_a_preview_that_does_not_claim_to_be_exact(shelf, make_engine, monkeypatch):
    monkeypatch.setattr(engine_module, "PATIENCE", 0.0)
    shelf.warm_up = 3
    engine, inbox = make_engine(), Inbox()
    engine.request("ada", request(0), inbox)
    inbox.ready(0)
    engine.request("ada", request(35), inbox)
    exact = inbox.ready(35)
    preview = next(r for r in inbox.of(Ready) if r.request.index == 35)
    assert preview.is_approximate
    assert not preview.is_exact
    assert preview.num_warm == 3
    assert exact.is_exact
    assert preview.key != exact.key
    assert not np.array_equal(preview.frame, exact.frame)
    assert np.array_equal(exact.frame, sequential(shelf, 35))


def test_progress_is_told_while_a_seek_runs(make_engine):
    inbox = Inbox()
    make_engine().request("ada", request(9), inbox)
    inbox.ready(9)
    steps = [(r.done, r.total) for r in inbox.working if r.total]
    assert steps == [(i, 10) for i in range(1, 11)]


def test_the_first_windows_are_called_cold(shelf, make_engine):
    shelf.warm_up = 5
    engine, inbox = make_engine(), Inbox()
    for index in (4, 5):
        engine.request("ada", request(index), inbox)
        assert inbox.ready(index).is_cold == (index < 5)


def test_exact_goes_out_under_an_intervention(make_engine):
    inbox = Inbox()
    engine, changed = make_engine(), request(2, intervention=Intervention(uniform_attention=True))
    engine.request("ada", changed, inbox)
    assert not inbox.ready(2).is_exact
    assert not engine.cached(changed).is_exact


def test_exact_goes_out_when_the_threads_change(make_engine):
    engine, inbox = make_engine(), Inbox()
    engine.request("ada", request(2), inbox)
    assert inbox.ready(2).is_exact
    assert engine.cached(request(2)).is_exact
    before = torch.get_num_threads()

    def change(reply):
        torch.set_num_threads(before + 1)  # on the engine's own thread
        inbox(reply)

    engine.request("ada", request(3), change)
    inbox.ready(3)
    engine.request("ada", request(4), inbox)
    assert not inbox.ready(4).is_exact
    torch.set_num_threads(before)


def test_the_budget_is_shared_by_all_playbacks(shelf, make_engine):
    shelf.recordings |= {str(i): recording_of(30, seed=i) for i in range(KEPT_PLAYBACKS + 2)}
    engine, inbox = make_engine(budget=100_000), Inbox()
    for i in range(KEPT_PLAYBACKS + 2):
        engine.request("ada", request(29, recording=str(i)), inbox)
        inbox.wait(lambda r, i=i: isinstance(r, Ready) and r.request.recording_id == str(i))
    reports = [engine.cached(request(0, recording=str(i))) for i in range(KEPT_PLAYBACKS + 2)]
    held = [report for report in reports if report is not None]
    assert len(held) <= KEPT_PLAYBACKS
    assert sum(loaded.playback.cached().nbytes for loaded in engine._playbacks._stages.values()) <= 100_000


def test_another_plan_of_windows_is_another_playback(make_engine):
    engine, inbox = make_engine(), Inbox()
    engine.request("ada", request(1), inbox)
    inbox.ready(1)
    other = request(1).__class__("r", "m", "fp32", ByDuration(5_000), 1)
    engine.request("ada", other, inbox)
    ready = inbox.wait(lambda r: isinstance(r, Ready) and r.request.policy == ByDuration(5_000))
    assert ready.is_exact
    assert engine.cached(request(1)) is not None
    assert engine.cached(other) is not None


def test_status_tells_the_pace_once_a_step_was_measured(make_engine):
    engine, inbox = make_engine(), Inbox()
    assert engine.status(request(0)).step_milliseconds is None
    engine.request("ada", request(1), inbox)
    inbox.ready(1)
    status = engine.status(request(0))
    assert status.step_milliseconds is not None
    assert status.step_milliseconds > 0
    assert status.precision == "fp32"
    assert not status.is_loading


def test_a_slow_size_is_announced_before_the_first_step(make_engine, monkeypatch):
    monkeypatch.setattr(engine_module, "SLOW_STEP", 0.0)
    inbox = Inbox()
    make_engine().request("ada", request(0), inbox)
    inbox.ready(0)
    assert any("takes about" in r.message for r in inbox.working)


def test_stopping_joins_the_thread_amid_a_seek(shelf, make_engine):
    engine, inbox = make_engine(), Inbox()
    gate = hold(shelf.model_instance)
    engine.request("ada", request(39), inbox)
    assert shelf.model_instance.entered.acquire(timeout=10)
    gate.release(1)
    stopper = threading.Thread(target=engine.stop)
    stopper.start()
    gate.release(1000)
    stopper.join(10)
    assert not stopper.is_alive()
    assert not any(thread.name == "engine" and thread.is_alive() for thread in [engine._thread])
    assert shelf.model_instance.encodes < 39


def test_many_visitors_in_any_order_get_what_the_sequential_run_gives(shelf, make_engine):
    rng = np.random.default_rng(0)
    engine = make_engine(budget=200_000, prefetches=True)
    inboxes = {f"visitor {i}": Inbox() for i in range(5)}
    last = {}
    for _ in range(60):
        visitor = f"visitor {rng.integers(5)}"
        last[visitor] = int(rng.integers(40))
        engine.request(visitor, request(last[visitor]), inboxes[visitor])
        time.sleep(float(rng.random()) * 0.004)
    for visitor, index in last.items():
        assert np.array_equal(inboxes[visitor].ready(index).frame, sequential(shelf, index))
    assert not any(inbox.of(Failed) for inbox in inboxes.values())


def test_a_visitor_whose_requests_replace_each_other_is_shown_some_all_the_same(shelf, make_engine, monkeypatch):
    monkeypatch.setattr(queue, "GOES_WITHOUT", 0.0)
    engine, first, second = make_engine(), Inbox(), Inbox()
    engine.request("ada", request(0), begun := Inbox())
    begun.ready(0)
    gate = hold(shelf.model_instance)
    engine.request("ada", request(1), first)
    assert shelf.model_instance.entered.acquire(timeout=10)
    engine.request("ada", request(2), second)
    gate.release(100)
    assert np.array_equal(first.ready(1).frame, sequential(shelf, 1))
    second.ready(2)


def test_a_step_that_nobody_could_stop_is_not_begun_where_others_come_in(shelf, make_engine):
    shelf.recordings["vast"] = recording_of(3, sensor=Sensor(1280, 720))
    inbox, other = Inbox(), Inbox()
    engine = make_engine(longest_step=1e-6)
    engine.request("ada", request(2, recording="vast"), inbox)
    assert "would take about" in inbox.failed().message
    engine = make_engine(longest_step=None)
    engine.request("ada", request(2, recording="vast"), other)
    assert other.ready(2, timeout=60).is_exact


def test_a_run_from_a_cold_start_grows_with_its_recording(shelf, make_engine):
    whole = shelf.recordings["r"]
    now = [replace(recording_of_events(whole.read(0, 1_000)), latest=lambda: now[0])]
    shelf.recordings["r"] = now[0]
    engine, inbox = make_engine(), Inbox()
    engine.request("ada", request(3, cold_at=5), inbox)
    inbox.ready(3)
    now[0] = whole
    engine.request("ada", request(30, cold_at=5), inbox)
    frame = inbox.ready(30).frame
    windows = plan_windows(whole, POLICY)[5:36]
    seen = sum(window_voxel(shelf.model_instance, whole, window).sum(0) for window in windows)
    assert np.array_equal(frame, (seen / 100).numpy())

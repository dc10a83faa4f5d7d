"""Each way in which the exact badge must go out: whatever the contract holds, a change of it is seen."""

from dataclasses import fields, replace
from types import SimpleNamespace

import pytest
import torch

from app.engine.pace import Pace
from app.engine.playbacks import LoadedPlayback, PlaybackCache
from app.engine.replies import is_exact
from app.engine.requests import FrameRequest
from etnet.events.recording import recording_of_events
from etnet.nets import tuning
from etnet.nets.intervention import ORIGINAL, Intervention
from etnet.nets.kept_choices import keep_choice
from etnet.nets.presets import build_model
from etnet.nets.runtime import Contract, Runtime, apply_runtime, contract_of, default_runtime
from etnet.playback.playback import Playback
from etnet.windows import ByCount, plan_windows
from tests.app.fakes import Shelf, request
from tests.strategies import make_events

REQUEST = FrameRequest("recording", "model", "fp32", ByCount(10), 3, False)


def _load():
    model = build_model("tiny")
    return SimpleNamespace(playback=SimpleNamespace(model=model, first=0), contract=contract_of(model))


def test_a_frame_is_exact_under_its_own_contract():
    assert is_exact(_load(), REQUEST)
    assert REQUEST.intervention == ORIGINAL


def test_an_intervention_is_not_exact():
    assert not is_exact(_load(), replace(REQUEST, intervention=Intervention(uniform_attention=True)))


def test_a_playback_that_begins_later_is_not_exact():
    loaded = _load()
    loaded.playback.first = 1
    assert not is_exact(loaded, REQUEST)


@pytest.mark.parametrize(
    "runtime", [Runtime(precision="bf16"), Runtime(attention="plain"), Runtime(channels_last=True)], ids=str
)
def test_precision_attention_path_and_memory_format_count(runtime: Runtime):
    loaded = _load()
    apply_runtime(loaded.playback.model, runtime)
    assert not is_exact(loaded, REQUEST)


def test_threads_count():
    loaded, before = _load(), torch.get_num_threads()
    try:
        torch.set_num_threads(before + 1)
        assert not is_exact(loaded, REQUEST)
    finally:
        torch.set_num_threads(before)
    assert is_exact(loaded, REQUEST)


def test_the_device_counts():
    loaded = _load()
    loaded.playback.model.to("meta")
    assert not is_exact(loaded, REQUEST)


def test_the_version_of_torch_counts(monkeypatch: pytest.MonkeyPatch):
    loaded = _load()
    monkeypatch.setattr(torch, "__version__", "0.0")
    assert not is_exact(loaded, REQUEST)


def test_nothing_in_the_contract_is_left_out_above():
    assert {field.name for field in fields(Contract)} == {
        "runtime",
        "device",
        "threads",
        "torch_version",
        "machine",
        "isa",
    }
    assert {field.name for field in fields(Runtime)} == {"precision", "attention", "channels_last", "packed"}


def test_a_first_step_that_was_held_up_does_not_set_the_pace():
    halves, whole = Pace(), Pace()
    halves.note(50_000.0, 6_000.0)
    halves.note(20.0, 80.0)
    assert halves.step == 100.0
    whole.note(50_000.0, 6_000.0)
    whole.note_whole(90.0)
    assert whole.step == 90.0
    assert whole.seek(10) == 90.0


def test_the_pace_follows_what_steps_take():
    pace = Pace()
    for step in (100.0, 130.0, 130.0, 130.0):
        pace.note(None, step)
        pace.note(10.0, None)
    assert 110.0 + 10 < pace.step < 130.0 + 10


def test_kernels_that_were_found_while_frames_were_made_are_for_the_next_start(monkeypatch, tmp_path):
    monkeypatch.setenv("ETNET_CACHE", str(tmp_path))
    model = build_model("tiny")
    apply_runtime(model, default_runtime())
    shelf = Shelf(model_instance=model)
    playbacks = PlaybackCache(shelf, 64 << 20, "cpu", None, shelf.load, tunes=True)
    loaded = playbacks.loaded(request(0))
    if not playbacks.has_untried:
        pytest.skip("no oneDNN here: there is nothing to try")
    assert is_exact(loaded, request(0))
    sensor = loaded.playback.recording.sensor
    name = tuning._name(model, sensor.height, sensor.width)
    keep_choice(name, {"precision": "fp32", "attention": "fused", "channels_last": False, "packed": False})
    playbacks.try_kernels()
    assert is_exact(loaded, request(0))


def test_a_change_in_the_newest_window_of_a_growing_recording_stays_in_that_window():
    """Nothing came after it when it was made, so nothing brought the network back; later windows must not have it."""
    whole = make_events(100)
    now = [replace(recording_of_events(whole[:52]), latest=lambda: now[0])]
    playback = Playback(build_model("tiny"), now[0], plan_windows(now[0], ByCount(10)))
    loaded = LoadedPlayback(playback, contract_of(playback.model), 2, Pace(), 1.0)
    newest = len(playback) - 1
    zeroed = Intervention(zeroed_levels=frozenset({1, 2, 3}))
    asked = replace(REQUEST, index=newest, intervention=zeroed, since=newest, once=True)
    changed, _ = loaded.playing(asked)
    assert changed.intervention_at(newest) == zeroed
    budget = loaded.budget_bytes
    now[0] = replace(recording_of_events(whole), latest=lambda: now[0])
    later = replace(asked, index=newest + 1)
    loaded.grow(later)
    changed, _ = loaded.playing(later)
    assert loaded.budget_bytes == budget
    assert [changed.intervention_at(index) for index in (newest, newest + 1)] == [zeroed, ORIGINAL]
    assert not torch.equal(changed.at(newest + 1).frame, playback.at(newest + 1).frame)  # what its memory carries on


@pytest.mark.parametrize("is_measured", [True, False])
def test_a_playback_that_was_put_away_gives_its_bytes_back_and_a_job_goes_on_in_it_step_by_step(is_measured):
    shelf = Shelf()
    playbacks = PlaybackCache(shelf, 64 << 20, "cpu", None, shelf.load)
    loaded = playbacks.loaded(request(0))
    step = loaded.playback.at(30)
    loaded.state_bytes = step.state.nbytes if is_measured else 0
    former = loaded.budget_bytes
    assert playbacks.anew(request(0)) is not loaded
    assert loaded.playback.cached().nbytes <= loaded.budget_bytes < former / 100
    encodes = shelf.model_instance.encodes
    for index in range(31, 40):
        loaded.playback.at(index)
    assert shelf.model_instance.encodes == encodes + 9


def test_the_budget_of_a_playback_that_was_put_away_leaves_room_for_its_change():
    shelf = Shelf()
    playbacks = PlaybackCache(shelf, 64 << 20, "cpu", None, shelf.load)
    loaded, zeroed = playbacks.loaded(request(0)), Intervention(zeroed_levels=frozenset({1}))
    branch, _ = loaded.playing(replace(request(20), intervention=zeroed, since=10))
    loaded.state_bytes = branch.at(30).state.nbytes
    playbacks.anew(request(0))
    encodes = shelf.model_instance.encodes
    for index in range(31, 40):
        branch.at(index)
    assert shelf.model_instance.encodes == encodes + 9

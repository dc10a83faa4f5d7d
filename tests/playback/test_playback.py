"""Law 2: any frame, in any order, equals the sequential run bit for bit."""

import itertools
import random

import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from etnet.errors import Cancelled, WindowError
from etnet.events.edit import EventEdit
from etnet.events.recording import Recording, recording_of_events
from etnet.nets.attention import AttentionProbe
from etnet.nets.etnet import ETNet
from etnet.nets.intervention import ORIGINAL, Intervention
from etnet.nets.presets import build_model
from etnet.nets.runtime import apply_runtime
from etnet.nets.storage import kept_alive
from etnet.playback.playback import Playback
from etnet.reconstruction import window_voxel
from etnet.voxel import voxel_grid
from etnet.windows import ByCount, plan_windows
from tests.nets.test_packed import EVERY_PATH
from tests.strategies import make_events

NUM_WINDOWS = 12


class CountingModel:
    """Passes every call on to a network and counts them."""

    def __init__(self, model: ETNet) -> None:
        self.model, self.encoded, self.decoded = model, 0, 0

    def __getattr__(self, name: str):
        return getattr(self.model, name)

    def encode(self, *arguments):
        self.encoded += 1
        return self.model.encode(*arguments)

    def decode(self, *arguments):
        self.decoded += 1
        return self.model.decode(*arguments)


def _recording() -> Recording:
    return recording_of_events(make_events(NUM_WINDOWS * 100))


def _sequential(model: ETNet, recording: Recording):
    state, steps = None, []
    for window in plan_windows(recording, ByCount(100)):
        with torch.inference_mode():
            step = model(window_voxel(model, recording, window)[None], state)
        state = step.state
        steps.append(step)
    return steps


def _playback(model, budget_states: float, budget_frames: int = 4) -> Playback:
    recording = _recording()
    playback = Playback(model, recording, plan_windows(recording, ByCount(100)))
    step = playback.at(0)
    frame_bytes, state_bytes = kept_alive((step.frame,)), step.state.nbytes
    playback._states.set_budget(int(budget_states * state_bytes), 0)
    playback._frames.set_budget(budget_frames * frame_bytes)
    return playback


MODEL = build_model("tiny")
TRUTH = _sequential(MODEL, _recording())


@settings(deadline=None, max_examples=15)
@given(st.lists(st.integers(0, NUM_WINDOWS - 1), min_size=1, max_size=12), st.sampled_from([0, 1, 3, 100]), st.data())
def test_any_order_equals_the_sequential_run(indices: list[int], budget: float, data: st.DataObject):
    playback = _playback(MODEL, budget)
    for index in indices:
        probe = AttentionProbe() if data.draw(st.booleans()) else None
        step = playback.at(index, probe)
        assert torch.equal(step.frame, TRUTH[index].frame)
        assert all(torch.equal(a, b) for a, b in zip(step.state, TRUTH[index].state, strict=True))
        assert (step.attention is not None) == (probe is not None)


def test_a_held_state_gives_its_frame_with_no_replay():
    model = CountingModel(MODEL)
    playback = _playback(model, budget_states=100, budget_frames=0)
    playback.at(7)
    model.encoded = model.decoded = 0
    assert torch.equal(playback.at(5).frame, TRUTH[5].frame)
    assert (model.encoded, model.decoded) == (0, 1)


def test_a_seek_replays_encode_alone():
    model = CountingModel(MODEL)
    playback = _playback(model, budget_states=100)
    model.encoded = model.decoded = 0
    playback.at(9)
    assert (model.encoded, model.decoded) == (9, 1)
    playback.at(9)
    assert (model.encoded, model.decoded) == (9, 1)


def test_a_cancelled_seek_stops_before_the_next_step_and_keeps_its_work():
    model = CountingModel(MODEL)
    playback = _playback(model, budget_states=100)
    model.encoded = 0
    asked = iter([False] * 3 + [True] * 100)
    with pytest.raises(Cancelled):
        playback.at(11, cancelled=lambda: next(asked))
    assert model.encoded == 3
    assert playback.plan(11).from_index == 3
    assert torch.equal(playback.at(11).frame, TRUTH[11].frame)


def test_budgets_hold_and_states_are_dense_at_the_playhead():
    playback = _playback(MODEL, budget_states=4)
    playback.at(11)
    held = list(playback._states)
    assert len(held) == 4
    assert held[-1] == 11
    gaps = [b - a for a, b in itertools.pairwise(held)]
    assert gaps == sorted(gaps, reverse=True)
    assert playback.cached().nbytes <= playback.budget_bytes


def test_the_report_says_what_is_held():
    playback = _playback(MODEL, budget_states=100)
    playback.at(3)
    playback.at(8)
    report = playback.cached()
    assert report.states == (range(9),)
    assert set(report.frames) == {range(1), range(3, 4), range(8, 9)}
    assert playback.plan(3) == type(playback.plan(3))(3, 3, 0, True)


def test_a_branch_shares_what_lies_before_it_and_leaves_the_original_alone():
    playback = _playback(MODEL, budget_states=100)
    playback.at(11)
    branch = playback.branch(6, Intervention(zeroed_levels=frozenset({1, 2, 3})))
    assert torch.equal(branch.at(5).frame, TRUTH[5].frame)
    assert branch.plan(8).from_index == 5
    cold = _sequential_from(6, 8)
    assert torch.equal(branch.at(6).frame, cold[0])
    assert not torch.equal(branch.at(8).frame, TRUTH[8].frame)
    assert torch.equal(playback.at(8).frame, TRUTH[8].frame)


def _sequential_from(start: int, stop: int) -> list[torch.Tensor]:
    playback, state, frames = _playback(MODEL, 1), None, []
    for index in range(start, stop + 1):
        with torch.inference_mode():
            step = MODEL(playback.voxel(index)[None], state)
        state = step.state
        frames.append(step.frame)
    return frames


def test_an_approximate_frame_is_a_cold_start_and_is_never_kept():
    playback = _playback(MODEL, budget_states=100)
    before = playback.cached()
    preview = playback.approximate(9, warm_up=3)
    assert torch.equal(preview.frame, _sequential_from(6, 9)[-1])
    assert playback.cached() == before
    assert torch.equal(playback.approximate(2, warm_up=30).frame, TRUTH[2].frame)


def test_what_lies_before_a_playback_that_begins_later_is_refused_but_for_a_cold_start_of_its_own():
    playback = _playback(MODEL, budget_states=100)
    playback.first = 8
    assert torch.equal(playback.approximate(5, warm_up=3, first=2).frame, _sequential_from(2, 5)[-1])
    for ask in (playback.at, lambda index: playback.approximate(index, 3)):
        with pytest.raises(WindowError, match="empty at window 8, and window 5 lies before it"):
            ask(5)


def test_indices_outside_are_refused():
    with pytest.raises(IndexError, match="window 12 of 12"):
        _playback(MODEL, 1).at(NUM_WINDOWS)


@pytest.mark.parametrize("runtime", EVERY_PATH, ids=str)
@pytest.mark.parametrize("falls_back", [False, True])
def test_a_long_random_walk_in_little_memory_is_exact_in_every_path(runtime, falls_back, monkeypatch):
    if falls_back:
        monkeypatch.setattr("etnet.nets.packed.has_onednn", lambda: False)
        monkeypatch.setattr("etnet.nets.attention_kernels.has_onednn", lambda: False)
    model, walk = build_model("tiny", torch.Generator().manual_seed(3)), random.Random(0)
    apply_runtime(model, runtime)
    truth = _sequential(model, _recording())
    playback = _playback(model, budget_states=2, budget_frames=1)
    for _ in range(20):
        index = walk.randrange(NUM_WINDOWS)
        probe = AttentionProbe() if walk.random() < 0.3 else None
        assert torch.equal(playback.at(index, probe).frame, truth[index].frame)


def test_a_branch_that_edits_nothing_is_the_original_to_the_bit():
    playback = _playback(MODEL, budget_states=100)
    branch = playback.branch(3, edit=EventEdit(seed=5))
    for index in (7, 2, 5):
        assert torch.equal(branch.at(index).frame, TRUTH[index].frame)


def test_edited_events_reach_the_network_from_the_branch_on():
    playback = _playback(MODEL, budget_states=100)
    edit = EventEdit(drop=0.5, invert=0.2, jitter=0.5, seed=5)
    branch, again = playback.branch(3, edit=edit), playback.branch(3, edit=edit)
    assert torch.equal(branch.at(2).frame, TRUTH[2].frame)
    assert not torch.equal(branch.at(3).frame, TRUTH[3].frame)
    assert torch.equal(branch.at(6).frame, again.at(6).frame)
    assert torch.equal(playback.at(6).frame, TRUTH[6].frame)
    window = playback.windows[4]
    edited = edit.applied(playback.recording.read(window.start, window.stop), window.start)
    assert torch.equal(branch.voxel(4), voxel_grid(edited, MODEL.bins))
    assert torch.equal(branch.voxel(2), playback.voxel(2))


def test_a_branch_of_a_branch_keeps_what_its_parent_changed():
    """What lies before the second branch is the first branch's, whether its states were held or must be replayed."""
    zeroed = Intervention(zeroed_levels=frozenset({3}))
    for budget in (0, 100):
        first = _playback(MODEL, budget_states=budget).branch(2, zeroed, EventEdit(drop=0.3))
        first._states.set_budget(0, 0)
        second = first.branch(6)
        assert torch.equal(second.at(5).frame, first.at(5).frame)
        assert not torch.equal(second.at(5).frame, TRUTH[5].frame)
        assert (second.intervention_at(4), second.intervention_at(6)) == (zeroed, ORIGINAL)
        assert not torch.equal(second.at(8).frame, first.at(8).frame)


def test_a_state_is_given_without_decoding():
    model = CountingModel(MODEL)
    playback = _playback(model, budget_states=100)
    model.encoded = model.decoded = 0
    state = playback.state(6)
    assert (model.encoded, model.decoded) == (6, 0)
    assert all(torch.equal(a, b) for a, b in zip(state, TRUTH[6].state, strict=True))


def test_a_frame_weighs_its_margins_too_because_they_stay_with_it():
    playback = _playback(MODEL, budget_states=2)
    before = playback._frames.nbytes
    padded = torch.zeros(1, 1, 16, 24)
    playback._keep_frame((1, ORIGINAL), padded[..., 1:14, 2:21])
    assert playback._frames.nbytes == before + padded.nbytes

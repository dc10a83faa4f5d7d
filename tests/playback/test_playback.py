"""Law 2: any frame, in any order, equals the sequential run bit for bit."""

import itertools
import random

import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from etnet.errors import Cancelled
from etnet.events.recording import Recording, recording_of_events
from etnet.nets.attention import AttentionProbe
from etnet.nets.etnet import ETNet
from etnet.nets.intervention import Intervention
from etnet.nets.presets import build_model
from etnet.playback.playback import Playback
from etnet.reconstruction import window_voxel
from etnet.windows import ByCount, plan_windows
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
    frame_bytes, state_bytes = step.frame.nbytes, step.state.nbytes
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


def test_indices_outside_are_refused():
    with pytest.raises(IndexError, match="window 12 of 12"):
        _playback(MODEL, 1).at(NUM_WINDOWS)


def test_a_long_random_walk_in_little_memory():
    playback, walk = _playback(MODEL, budget_states=2, budget_frames=1), random.Random(0)
    for _ in range(60):
        index = walk.randrange(NUM_WINDOWS)
        assert torch.equal(playback.at(index).frame, TRUTH[index].frame)

"""Law 2 on a real recording with the default weights: a long run, so it is one of the slow tests."""

import random

import pytest
import torch

from etnet.errors import Cancelled
from etnet.events.open import open_recording
from etnet.nets.attention import AttentionProbe
from etnet.nets.weights import load_model
from etnet.playback.playback import Playback
from etnet.voxel import voxel_grid
from etnet.windows import BetweenFrames, plan_windows
from tests.real_data import real_file

NUM_SEEKS = 200


@pytest.mark.real
@pytest.mark.slow
def test_200_random_seeks_on_slider_depth_equal_the_plain_loop():
    recording = open_recording(real_file("ecd_slider_depth/slider_depth.zip"))
    model, windows = load_model("etnet-half"), plan_windows(recording, BetweenFrames())

    expected, state = [], None
    with torch.inference_mode():
        for window in windows:
            step = model(voxel_grid(recording.read(window.start, window.stop))[None], state)
            state = step.state
            expected.append(step.frame)
    assert state is not None

    playback, walk = Playback(model, recording, windows), random.Random(1)
    playback._states.set_budget(4 * state.nbytes, 0)
    playback._frames.set_budget(4 * expected[0].nbytes)
    num_cancelled = 0
    for seek in range(NUM_SEEKS):
        index = walk.randrange(len(windows)) if seek % 3 else min(playback._playhead + 1, len(windows) - 1)
        probe = AttentionProbe(frozenset({"scale1.encoder.2.self"})) if seek % 5 == 0 else None
        patience = walk.randrange(1, 6) if seek % 7 == 0 else None
        try:
            step = playback.at(index, probe, cancelled=_after(patience))
        except Cancelled:
            num_cancelled += 1
            continue
        assert torch.equal(step.frame, expected[index]), f"seek {seek} to window {index}"
        assert len(playback._states) <= 4
    assert num_cancelled > 0


def _after(patience: int | None):
    """A `cancelled` that says yes from its `patience`-th question on; never for `None`."""
    asked = 0

    def cancelled() -> bool:
        nonlocal asked
        asked += 1
        return patience is not None and asked > patience

    return cancelled

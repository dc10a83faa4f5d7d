"""A playback that begins at a later window is the one of the windows from there on; nothing is asked before them."""

from collections.abc import Callable

import numpy as np
import pytest
import torch

from etnet.inspection.attribution import attribute, occlude
from etnet.inspection.basis import sampled_maps
from etnet.inspection.causal_search import search_cause
from etnet.inspection.features import Feature
from etnet.inspection.gates import gates_at, memory_depth
from etnet.inspection.sources import pixel_sources
from etnet.inspection.uncertainty import dropout_spread
from etnet.playback.playback import Playback
from etnet.windows import from_window
from tests.inspection.small import small_playback

FIRST, PIXEL = 3, (20, 10)


def _searched(playback: Playback, index: int) -> tuple[object, ...]:
    *_, found = search_cause(playback, index, PIXEL, frozenset({1}), 1e-4)
    return found.value, found.is_done


QUESTIONS: dict[str, Callable[[Playback, int], object]] = {
    "gradient": lambda playback, index: attribute(playback, index, PIXEL, 4).value,
    "occlusion": lambda playback, index: occlude(playback, index, PIXEL, 4).change,
    "gates": lambda playback, index: gates_at(playback, index, 1).forget,
    "sources": lambda playback, index: list(pixel_sources(playback, index, PIXEL))[-1].value,
    "spread": lambda playback, index: list(dropout_spread(playback, index, num_seeds=2, num_back=4))[-1].frames,
    "depth": lambda playback, index: memory_depth(playback, index, (0, 1, 4)).frames,
    "search": _searched,
    "basis": lambda playback, index: [
        map_.values for map_ in sampled_maps(playback, Feature("hidden", level=1), 3, warm_up=2)
    ],
}


@pytest.mark.parametrize("steps", [0, 1, 3])
@pytest.mark.parametrize("name", QUESTIONS)
def test_what_is_asked_near_the_beginning_of_a_playback_is_what_a_shorter_plan_answers(name: str, steps: int):
    whole = small_playback()
    late = Playback(whole.model, whole.recording, whole.windows, first=FIRST)
    short = Playback(whole.model, whole.recording, from_window(whole.windows, FIRST))
    _assert_equal(QUESTIONS[name](late, FIRST + steps), QUESTIONS[name](short, steps))


def _assert_equal(found: object, expected: object) -> None:
    if isinstance(found, (list, tuple)):
        assert isinstance(expected, (list, tuple))
        assert len(found) == len(expected)
        for one, other in zip(found, expected, strict=True):
            _assert_equal(one, other)
    elif isinstance(found, torch.Tensor):
        assert isinstance(expected, torch.Tensor)
        torch.testing.assert_close(found, expected, rtol=0, atol=0)
    elif isinstance(found, np.ndarray):
        np.testing.assert_array_equal(found, expected)
    else:
        assert found == expected

"""The plug for a learned interpolator, in both of RIFE's layouts."""

import numpy as np
import pytest

from etnet.errors import EtnetError
from etnet.simulation.learned import LearnedInterpolator
from etnet.simulation.streaming import EventSimulator
from etnet.simulation.walk import Stepping
from tests.simulation.known_motion import FRAME_US, IDEAL
from tests.simulation.networks import mean_network


@pytest.mark.parametrize("has_three_inputs", [False, True])
def test_a_learned_interpolator_takes_the_place_of_flow(tmp_path, has_three_inputs):
    (tmp_path / "mean.onnx").write_bytes(mean_network(has_three_inputs=has_three_inputs))
    learned = LearnedInterpolator(tmp_path / "mean.onnx")
    first, second = np.full((30, 60), -2.0, np.float32), np.full((30, 60), -1.0, np.float32)
    first[5:10] = -3
    assert np.abs(learned(first, second, 0.5) - (first + second) / 2).max() < 1e-4
    with EventSimulator(IDEAL, Stepping(2, learned=learned)) as simulator:
        simulator.feed(np.exp(first), 0.0)
        assert len(simulator.feed(np.exp(second), FRAME_US)) > 1_000


def test_what_is_no_network_is_one_line(tmp_path):
    (tmp_path / "broken.onnx").write_bytes(b"nothing of the kind")
    for name, words in (("broken.onnx", "cannot read it as a network"), ("none.onnx", "no such interpolator")):
        with pytest.raises(EtnetError, match=words):
            LearnedInterpolator(tmp_path / name)

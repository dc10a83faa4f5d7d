"""The plug for a learned interpolator, with a network that is written here byte by byte: the mean of both pictures."""

import struct

import numpy as np
import pytest

from etnet.errors import EtnetError
from etnet.simulation.learned import LearnedInterpolator
from etnet.simulation.streaming import EventSimulator
from etnet.simulation.walk import Stepping
from tests.simulation.known_motion import FRAME_US, IDEAL


def number(field: int, value: int) -> bytes:
    out, key = b"", field << 3
    for part in (key, value):
        while part > 127:
            out, part = out + bytes([part & 127 | 128]), part >> 7
        out += bytes([part])
    return out


def part(field: int, content: bytes | str) -> bytes:
    content = content.encode() if isinstance(content, str) else content
    header = number(field, len(content))
    return bytes([header[0] | 2]) + header[1:] + content


def picture(name: str, channels: int) -> bytes:
    dimensions = b"".join(part(1, number(1, side)) for side in (1, channels, 32, 64))
    return part(1, name) + part(2, part(1, number(1, 1) + part(2, dimensions)))


def mean_network() -> bytes:
    """ONNX: one 1×1 convolution of 7 channels to 3, half of the first picture and half of the second."""
    weights = np.zeros((3, 7), np.float32)
    weights[[0, 1, 2], [0, 1, 2]] = weights[[0, 1, 2], [3, 4, 5]] = 0.5
    tensor = b"".join(number(1, side) for side in (3, 7, 1, 1)) + number(2, 1) + part(8, "w")
    tensor += part(9, struct.pack("<21f", *weights.ravel()))
    node = part(1, "x") + part(1, "w") + part(2, "y") + part(4, "Conv")
    graph = part(1, node) + part(2, "mean") + part(5, tensor) + part(11, picture("x", 7)) + part(12, picture("y", 3))
    return number(1, 8) + part(7, graph) + part(8, number(2, 13))


def test_a_learned_interpolator_takes_the_place_of_flow(tmp_path):
    (tmp_path / "mean.onnx").write_bytes(mean_network())
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

"""Networks in RIFE's layouts, written here byte by byte as ONNX: the mean of both pictures."""

import struct

import numpy as np


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


def picture(name: str, channels: int, size: tuple[int, int]) -> bytes:
    dimensions = b"".join(part(1, number(1, side)) for side in (1, channels, *size))
    return part(1, name) + part(2, part(1, number(1, 1) + part(2, dimensions)))


def mean_network(size: tuple[int, int] = (32, 64), has_three_inputs: bool = False) -> bytes:
    """One 1×1 convolution of 7 channels to 3, half of the first picture and half of the second; `size` is (h, w).

    The seven channels come stacked as one input, or as img0, img1 and timestep.
    """
    weights = np.zeros((3, 7), np.float32)
    weights[[0, 1, 2], [0, 1, 2]] = weights[[0, 1, 2], [3, 4, 5]] = 0.5
    tensor = b"".join(number(1, side) for side in (3, 7, 1, 1)) + number(2, 1) + part(8, "w")
    tensor += part(9, struct.pack("<21f", *weights.ravel()))
    nodes = part(1, part(1, "x") + part(1, "w") + part(2, "y") + part(4, "Conv"))
    inputs = part(11, picture("x", 7, size))
    if has_three_inputs:
        names = {"img0": 3, "img1": 3, "timestep": 1}
        axis = part(1, "axis") + number(3, 1) + number(20, 2)
        stacked = b"".join(part(1, name) for name in names) + part(2, "x") + part(4, "Concat") + part(5, axis)
        nodes = part(1, stacked) + nodes
        inputs = b"".join(part(11, picture(name, channels, size)) for name, channels in names.items())
    graph = nodes + part(2, "mean") + part(5, tensor) + inputs + part(12, picture("y", 3, size))
    return number(1, 8) + part(7, graph) + part(8, number(2, 13))

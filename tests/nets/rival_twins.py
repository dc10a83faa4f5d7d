"""FireNet and E2VID once more, slowly, from the papers' equations in numpy, on weights under the released names."""

import numpy as np

Weights = dict[str, np.ndarray]


def convolve(x: np.ndarray, weights: Weights, name: str, stride: int = 1) -> np.ndarray:
    """Same-size cross-correlation with zeros outside: x is c h w."""
    kernel, bias = weights[f"{name}.weight"], weights[f"{name}.bias"]
    margin = kernel.shape[-1] // 2
    padded = np.pad(x, ((0, 0), (margin, margin), (margin, margin)))
    patches = np.lib.stride_tricks.sliding_window_view(padded, kernel.shape[-2:], axis=(1, 2))[:, ::stride, ::stride]
    return np.einsum("chwij,ocij->ohw", patches, kernel, optimize=True) + bias[:, None, None]


def sigmoid(x: np.ndarray) -> np.ndarray:
    return 1 / (1 + np.exp(-x))


def relu(x: np.ndarray) -> np.ndarray:
    return np.maximum(x, 0)


def gru(x: np.ndarray, h: np.ndarray | None, weights: Weights, name: str) -> np.ndarray:
    """h' = h (1 − u) + tanh(out[x, h r]) u."""
    h = np.zeros_like(x) if h is None else h
    u = sigmoid(convolve(np.concatenate([x, h]), weights, f"{name}.update_gate"))
    r = sigmoid(convolve(np.concatenate([x, h]), weights, f"{name}.reset_gate"))
    return h * (1 - u) + np.tanh(convolve(np.concatenate([x, h * r]), weights, f"{name}.out_gate")) * u


def residual(x: np.ndarray, weights: Weights, name: str) -> np.ndarray:
    return relu(convolve(relu(convolve(x, weights, f"{name}.conv1")), weights, f"{name}.conv2") + x)


def firenet(voxels: list[np.ndarray], weights: Weights) -> list[np.ndarray]:
    """Frames of FireNet+ (names head, G1, R1, G2, R2, pred), one after the other from a cold start."""
    first = second = None
    frames = []
    for voxel in voxels:
        first = gru(relu(convolve(voxel, weights, "head.conv2d")), first, weights, "G1")
        second = gru(residual(first, weights, "R1"), second, weights, "G2")
        frames.append(convolve(residual(second, weights, "R2"), weights, "pred.conv2d"))
    return frames


def lstm(x: np.ndarray, memory: tuple[np.ndarray, np.ndarray] | None, weights: Weights, name: str):
    h, c = memory or (np.zeros_like(x), np.zeros_like(x))
    gates = convolve(np.concatenate([x, h]), weights, f"{name}.Gates")
    enter, forget, out, cell = np.split(gates, 4)
    c = sigmoid(forget) * c + sigmoid(enter) * np.tanh(cell)
    return sigmoid(out) * np.tanh(c), c


def double(x: np.ndarray) -> np.ndarray:
    """Bilinear × 2 where pixel centres keep their places (align_corners=False)."""

    def along(x: np.ndarray, axis: int) -> np.ndarray:
        size = x.shape[axis]
        places = np.clip((np.arange(2 * size) + 0.5) / 2 - 0.5, 0, size - 1)
        low = np.floor(places).astype(int)
        high = np.minimum(low + 1, size - 1)
        share = (places - low).reshape([-1 if a == axis else 1 for a in range(3)])
        return np.take(x, low, axis) * (1 - share) + np.take(x, high, axis) * share

    return along(along(x, 1), 2)


def e2vid(voxels: list[np.ndarray], weights: Weights, num_residuals: int, skips: bool) -> list[np.ndarray]:
    """The last layer's output of E2VID (names of the released U-Net), at sizes that are multiples of 8."""
    memories: list = [None, None, None]
    outputs = []
    for voxel in voxels:
        head = x = relu(convolve(voxel, weights, "head.conv2d"))
        levels = []
        for i in range(3):
            x = relu(convolve(x, weights, f"encoders.{i}.conv.conv2d", stride=2))
            memories[i] = lstm(x, memories[i], weights, f"encoders.{i}.recurrent_block")
            x = memories[i][0]
            levels.append(x)
        for i in range(num_residuals):
            x = residual(x, weights, f"resblocks.{i}")
        for i in range(3):
            x = x + levels[2 - i] if skips else x
            x = relu(convolve(double(x), weights, f"decoders.{i}.conv2d"))
        x = x + head if skips else x
        outputs.append(convolve(x, weights, "pred.conv2d"))
    return outputs

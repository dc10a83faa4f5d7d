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


def normalised(x: np.ndarray, weights: Weights, name: str, groups: int = 1) -> np.ndarray:
    """Mean 0 and variance 1 over each group of channels and the whole image, then gain and offset."""
    parts = x.reshape(groups, -1)
    parts = (parts - parts.mean(1, keepdims=True)) / np.sqrt(parts.var(1, keepdims=True) + 1e-5)
    return parts.reshape(x.shape) * weights[f"{name}.weight"][:, None, None] + weights[f"{name}.bias"][:, None, None]


def conv_norm(x: np.ndarray, weights: Weights, name: str, is_active: bool = True) -> np.ndarray:
    y = normalised(convolve(x, weights, f"{name}.convna.0"), weights, f"{name}.convna.1")
    return y * sigmoid(y) if is_active else y


def product(x: np.ndarray, kernel: np.ndarray) -> np.ndarray:
    return np.einsum("chw,oc->ohw", x, kernel[:, :, 0, 0])


def stretched(x: np.ndarray, size: tuple[int, int]) -> np.ndarray:
    """Bilinear, corners on corners."""
    for axis, count in zip((1, 2), size, strict=True):
        places = np.linspace(0, x.shape[axis] - 1, count) if count > 1 else np.zeros(1)
        low = np.minimum(places.astype(int), max(0, x.shape[axis] - 2))
        share = (places - low).reshape([-1 if a == axis else 1 for a in range(3)])
        high = np.minimum(low + 1, x.shape[axis] - 1)
        x = np.take(x, low, axis) * (1 - share) + np.take(x, high, axis) * share
    return x


def pie_net(voxels: list[np.ndarray], weights: Weights, pools: tuple[int, ...]) -> list[tuple[np.ndarray, np.ndarray]]:
    """Frames and variances from a cold start, on weights under the package's names; refining blocks run if present."""
    memories: list = [None] * len(pools)
    frame, variance, results = np.zeros((1, *voxels[0].shape[1:])), None, []
    for voxel in voxels:
        e = conv_norm(voxel, weights, "model.stem.event_branch.mbconv")
        f = conv_norm(frame, weights, "model.stem.frame_branch.mbconv")
        described = np.concatenate([e.mean((1, 2)), f.mean((1, 2))])[:, None, None]
        x, skips = e + f, []
        for i, pool in enumerate(pools):
            name = f"model.downs.{i}"
            size = len(weights[f"{name}.mbd.norm_h.weight"])
            empty = np.zeros((size, *x.shape[1:]))
            h, c = memories[i] or (empty, empty)
            wide = conv_norm(np.concatenate([x, h]), weights, f"{name}.mbd.Gates.mbconv.0")
            squeezed = relu(product(wide.mean((1, 2), keepdims=True), weights[f"{name}.mbd.Gates.mbconv.1.fc1.weight"]))
            wide = wide * sigmoid(product(squeezed, weights[f"{name}.mbd.Gates.mbconv.1.fc2.weight"]))
            enter, forget, out, cell = np.split(conv_norm(wide, weights, f"{name}.mbd.Gates.mbconv.2", False), 4)
            c = sigmoid(forget) * c + sigmoid(enter) * np.tanh(cell)
            c = normalised(c, weights, f"{name}.mbd.norm_c", 4)
            h = normalised(sigmoid(out) * np.tanh(c), weights, f"{name}.mbd.norm_h", 4)
            memories[i], x = (h, c), h
            if f"{name}.out.mbconv_0.mbconv.convna.0.weight" in weights:
                x = x + conv_norm(x, weights, f"{name}.out.mbconv_0.mbconv")
            scale, shift = np.split(convolve(described, weights, f"{name}.film.film"), 2)
            x = x * (1 + scale) + shift
            skips.append(x)
            rows, columns = x.shape[1] // pool, x.shape[2] // pool
            x = x[:, : rows * pool, : columns * pool].reshape(len(x), rows, pool, columns, pool).max((2, 4))
        for i, (pool, skip) in enumerate(zip(reversed(pools), reversed(skips), strict=True)):
            x = stretched(x, (x.shape[1] * pool, x.shape[2] * pool))
            down, across = skip.shape[1] - x.shape[1], skip.shape[2] - x.shape[2]
            x = np.pad(x, ((0, 0), (down // 2, down - down // 2), (across // 2, across - across // 2)))
            if variance is not None:
                seen = stretched(variance, skip.shape[1:])
                skip = skip * sigmoid(convolve(seen, weights, f"model.ups.{i}.ugate.gate_conv"))
            x = conv_norm(np.concatenate([skip, x]), weights, f"model.ups.{i}.fuse.0.mbconv")
        latent = convolve(x, weights, "model.outc")
        k = relu(conv_norm(latent, weights, "cal_k.mbconv"))
        mean, spread, reference = np.split(relu(latent), 3)
        frame = np.clip((reference + k) * mean - k, 0, 1)
        variance = (reference + k) ** 2 * spread
        results.append((frame, variance))
    return results

"""A slow twin of the released ET-Net, written from its description alone, over a state dict with the released names.

Nothing here shares a line with `etnet.nets`: every operation is spelled out, one sample at a time.
"""

import math

import torch
from torch import Tensor
from torch.nn import functional as f


def random_state(base: int = 4, feed_forward: int = 40, seed: int = 0) -> dict[str, Tensor]:
    """Random parameters under the released names (index 0 is the coarsest scale), D = 8·base."""
    generator, dim = torch.Generator().manual_seed(seed), 8 * base
    shapes: dict[str, tuple[int, ...]] = {"head.conv2d": (base, 5, 5, 5), "pred.conv2d": (1, base, 1, 1)}
    for level in range(3):
        width = base * 2 ** (level + 1)
        shapes[f"DownsampleConv.{level}.conv.conv2d"] = (width, width // 2, 5, 5)
        shapes[f"DownsampleConv.{level}.recurrent_block.Gates"] = (4 * width, 2 * width, 3, 3)
        shapes[f"UpsampleConv.{level}.conv2d"] = (dim // 2 ** (level + 1), dim // 2**level, 5, 5)
    shapes["split1"], shapes["split2"] = (dim, dim // 2, 2, 2), (dim, dim // 4, 4, 4)
    norms, attentions = [], []
    for scale in range(3):
        for kind, depth in (("encoder", 3), ("decoder", 2)):
            for i in range(depth):
                layer = f"trans_{kind}{scale}.{kind}.layers.{i}"
                shapes[f"{layer}.linear1"], shapes[f"{layer}.linear2"] = (feed_forward, dim), (dim, feed_forward)
                names = ("norm1", "norm2") if kind == "encoder" else ("norm1", "norm21", "norm22", "norm3")
                norms += [f"{layer}.{name}" for name in names]
                names = ("self_attn",) if kind == "encoder" else ("self_attn", "cross_attn")
                attentions += [f"{layer}.{name}" for name in names]
    state = {}
    for name, shape in shapes.items():
        spread = 1 / math.sqrt(math.prod(shape[1:]))
        state[f"{name}.weight"] = torch.randn(shape, generator=generator) * spread
        state[f"{name}.bias"] = torch.randn(shape[0], generator=generator) * 0.1
    for name in norms:
        state[f"{name}.weight"] = 1 + 0.2 * torch.randn(dim, generator=generator)
        state[f"{name}.bias"] = 0.2 * torch.randn(dim, generator=generator)
    for name in attentions:
        state[f"{name}.in_proj_weight"] = torch.randn(3 * dim, dim, generator=generator) * 0.4
        state[f"{name}.in_proj_bias"] = torch.randn(3 * dim, generator=generator) * 0.1
        state[f"{name}.out_proj.weight"] = torch.randn(dim, dim, generator=generator) * 0.3
        state[f"{name}.out_proj.bias"] = torch.randn(dim, generator=generator) * 0.1
    return state


def run(state: dict[str, Tensor], voxels: list[Tensor], heads: int = 8) -> list[Tensor]:
    """The frames of a sequence of voxel grids (5, h, w), from a cold start."""
    memory, frames = [None, None, None], []
    for voxel in voxels:
        frame, memory = _step(state, voxel, memory, heads)
        frames.append(frame)
    return frames


def _step(p: dict[str, Tensor], voxel: Tensor, memory: list, heads: int) -> tuple[Tensor, list]:
    height, width = voxel.shape[1:]
    more_rows, more_columns = -height % 8, -width % 8
    top, left = math.ceil(more_rows / 2), math.ceil(more_columns / 2)
    image = torch.zeros(1, 5, height + more_rows, width + more_columns)
    image[0, :, top : top + height, left : left + width] = voxel

    head = f.conv2d(image, p["head.conv2d.weight"], p["head.conv2d.bias"], padding=2).clamp_min(0)
    features, x, new_memory = [], head, []
    for level in range(3):
        name = f"DownsampleConv.{level}"
        x = f.conv2d(x, p[f"{name}.conv.conv2d.weight"], p[f"{name}.conv.conv2d.bias"], stride=2, padding=2).clamp_min(
            0
        )
        hidden, cell = memory[level] or (torch.zeros_like(x), torch.zeros_like(x))
        weight, bias = p[f"{name}.recurrent_block.Gates.weight"], p[f"{name}.recurrent_block.Gates.bias"]
        gates = f.conv2d(torch.cat([x, hidden], 1), weight, bias, padding=1)
        channels = x.shape[1]
        into, keep, out, new = (gates[:, i * channels : (i + 1) * channels] for i in range(4))
        cell = keep.sigmoid() * cell + into.sigmoid() * new.tanh()
        x = out.sigmoid() * cell.tanh()
        features.append(x)
        new_memory.append((x, cell))

    rows, columns = features[2].shape[2:]
    coarse, middle, fine = features[2], features[1], features[0]
    maps = [
        coarse,
        f.conv2d(middle, p["split1.weight"], p["split1.bias"], stride=2),
        f.conv2d(fine, p["split2.weight"], p["split2.bias"], stride=4),
    ]
    code = _sinusoid(rows * columns, coarse.shape[1])
    encoded = []
    for scale in range(3):
        z = maps[scale][0].flatten(1).T + code
        for i in range(3):
            z = _encoder_layer(p, f"trans_encoder{scale}.encoder.layers.{i}", z, heads)
        encoded.append(z)
    total = encoded[0] + encoded[1] + encoded[2]
    for scale in range(3):
        z = encoded[scale]
        for i in range(2):
            z = _decoder_layer(p, f"trans_decoder{scale}.decoder.layers.{i}", z, encoded[max(scale - 1, 0)], heads)
        total = total + z
    x = (total / 6).T.reshape(1, -1, rows, columns)

    for i, skip in enumerate((coarse, middle, fine)):
        x = f.interpolate(x + skip, scale_factor=2, mode="bilinear", align_corners=False)
        x = f.conv2d(x, p[f"UpsampleConv.{i}.conv2d.weight"], p[f"UpsampleConv.{i}.conv2d.bias"], padding=2).clamp_min(
            0
        )
    frame = f.conv2d(x + head, p["pred.conv2d.weight"], p["pred.conv2d.bias"]).sigmoid()
    return frame[0, 0, top : top + height, left : left + width], new_memory


def _sinusoid(num: int, dim: int) -> Tensor:
    table = torch.empty(num, dim)
    for pos in range(num):
        for j in range(dim):
            angle = pos / 10_000 ** (2 * (j // 2) / dim)
            table[pos, j] = math.sin(angle) if j % 2 == 0 else math.cos(angle)
    return table


def _norm(p: dict[str, Tensor], name: str, z: Tensor) -> Tensor:
    centred = z - z.mean(-1, keepdim=True)
    return centred / (centred.pow(2).mean(-1, keepdim=True) + 1e-5).sqrt() * p[f"{name}.weight"] + p[f"{name}.bias"]


def _attention(p: dict[str, Tensor], name: str, query: Tensor, memory: Tensor, heads: int) -> Tensor:
    dim = query.shape[1]
    w, b = p[f"{name}.in_proj_weight"], p[f"{name}.in_proj_bias"]
    q, k, v = (
        query @ w[:dim].T + b[:dim],
        memory @ w[dim : 2 * dim].T + b[dim : 2 * dim],
        memory @ w[2 * dim :].T + b[2 * dim :],
    )
    d, parts = dim // heads, []
    for h in range(heads):
        own = slice(h * d, (h + 1) * d)
        parts.append(torch.softmax(q[:, own] @ k[:, own].T / math.sqrt(d), dim=1) @ v[:, own])
    return torch.cat(parts, 1) @ p[f"{name}.out_proj.weight"].T + p[f"{name}.out_proj.bias"]


def _feed_forward(p: dict[str, Tensor], name: str, z: Tensor) -> Tensor:
    hidden = (z @ p[f"{name}.linear1.weight"].T + p[f"{name}.linear1.bias"]).clamp_min(0)
    return hidden @ p[f"{name}.linear2.weight"].T + p[f"{name}.linear2.bias"]


def _encoder_layer(p: dict[str, Tensor], name: str, z: Tensor, heads: int) -> Tensor:
    normed = _norm(p, f"{name}.norm1", z)
    z = z + _attention(p, f"{name}.self_attn", normed, normed, heads)
    return z + _feed_forward(p, name, _norm(p, f"{name}.norm2", z))


def _decoder_layer(p: dict[str, Tensor], name: str, z: Tensor, memory: Tensor, heads: int) -> Tensor:
    normed = _norm(p, f"{name}.norm1", z)
    z = z + _attention(p, f"{name}.self_attn", normed, normed, heads)
    query, keys = _norm(p, f"{name}.norm21", z), _norm(p, f"{name}.norm22", memory)
    z = z + _attention(p, f"{name}.cross_attn", query, keys, heads)
    return z + _feed_forward(p, name, _norm(p, f"{name}.norm3", z))

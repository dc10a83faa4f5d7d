"""A network as ONNX graphs: `encode` and `decode` apart for any size, and one whole step for a fixed size.

States are named inputs and outputs (`state_0` … → `new_state_0` …); zeros are a cold start.
"""

from __future__ import annotations

import copy
import json
import logging
import math
import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from importlib.util import find_spec
from inspect import unwrap
from pathlib import Path
from typing import Any

import torch
from torch import Tensor, nn

from etnet.errors import EtnetError, ModelError
from etnet.files import check_target, replacing
from etnet.nets.abilities import abilities_of
from etnet.nets.attention import TRAINED_TOKENS, MultiHeadAttention
from etnet.nets.base import Pyramid, State
from etnet.nets.etnet import Sequentialize
from etnet.nets.padding import PATCH
from etnet.nets.presets import Network
from etnet.nets.runtime import Runtime, apply_runtime

OPSET = 18
LARGEST = 512
"""Rows and columns of 8 pixels that the graphs without a fixed size accept: 4,096 pixels a side."""
_EXAMPLE = (6 * PATCH, 8 * PATCH)
"""Height and width of the grid that is traced; none of its sizes coincide, so that none are taken for each other."""


class ExportError(EtnetError):
    """A network cannot be written as ONNX."""


@dataclass(frozen=True, slots=True)
class Graph:
    """A module to trace, an example of what it is given, and the names of what goes in and comes out."""

    module: nn.Module
    example: tuple[Tensor, ...]
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]


class _Encode(nn.Module):
    def __init__(self, model: Network) -> None:
        super().__init__()
        self.model = model

    def forward(self, voxels: Tensor, *states: Tensor) -> tuple[Tensor, ...]:
        pyramid, state = self.model.encode(voxels, State(states))
        return *(level + 0 for level in pyramid.levels), *state.tensors


class _Decode(nn.Module):
    def __init__(self, model: Network) -> None:
        super().__init__()
        self.model = model

    def forward(self, *levels: Tensor) -> Tensor:
        return self.model.decode(Pyramid(levels, levels[0].shape[-2], levels[0].shape[-1]))[0]


class _Step(nn.Module):
    def __init__(self, model: Network) -> None:
        super().__init__()
        self.model = model

    def forward(self, voxels: Tensor, *states: Tensor) -> tuple[Tensor, ...]:
        pyramid, state = self.model.encode(voxels, State(states))
        return self.model.decode(pyramid)[0], *state.tensors


def write_graphs(model: Network, folder: Path, size: tuple[int, int] | None = None) -> list[Path]:
    """Write `encode.onnx` and `decode.onnx` into a folder and, for a `size` (h, w), `step_WxH.onnx`; their paths.

    Heights and widths of the first two are free multiples of 8 (`pad_to_grid`); the step pads and crops by itself.
    Raises ExportError for a network without memoryless decoding.
    """
    _require_exporter()
    traced = _prepared(model)
    folder.mkdir(parents=True, exist_ok=True)
    encode, decode, *step = graph_files(folder, size)
    _write(encode_graph(traced), encode, model, is_dynamic=True)
    _write(decode_graph(traced), decode, model, is_dynamic=True)
    if size is not None:
        _write(step_graph(traced, size), step[0], model, is_dynamic=False)
    return [encode, decode, *step]


def graph_files(folder: Path, size: tuple[int, int] | None = None) -> list[Path]:
    """What `write_graphs` writes, and replaces where it is there."""
    step = [] if size is None else [f"step_{size[1]}x{size[0]}.onnx"]
    return [folder / name for name in ("encode.onnx", "decode.onnx", *step)]


def encode_graph(model: Network) -> Graph:
    """`voxels`, `state_*` → `level_*` (what `decode` takes), `new_state_*`."""
    voxels, states, levels = _example(model, _EXAMPLE)
    return Graph(
        _Encode(model),
        (voxels, *states),
        ("voxels", *_numbered("state", states)),
        (*_numbered("level", levels), *_numbered("new_state", states)),
    )


def decode_graph(model: Network) -> Graph:
    """`level_*` → `image`."""
    _, _, levels = _example(model, _EXAMPLE)
    return Graph(_Decode(model), levels, _numbered("level", levels), ("image",))


def step_graph(model: Network, size: tuple[int, int]) -> Graph:
    """`voxels`, `state_*` → `image`, `new_state_*`, all of fixed shape."""
    voxels, states, _ = _example(model, size)
    return Graph(
        _Step(model),
        (voxels, *states),
        ("voxels", *_numbered("state", states)),
        ("image", *_numbered("new_state", states)),
    )


def _require_exporter() -> None:
    absent = next((name for name in ("onnx", "onnxscript") if find_spec(name) is None), None)
    if absent is not None:
        raise ExportError(f"the package {absent} is not installed; install it with: pip install onnx onnxscript")


def _prepared(model: Network) -> Network:
    if not abilities_of(model).split:
        raise ExportError(
            f"{model.name}: gives whole steps only, and zeros are no cold start of it; "
            "export one that encodes and decodes apart (etnet, e2vid, firenet)"
        )
    traced = copy.deepcopy(model).float().eval().to("cpu")
    # The fused kernel takes a number as scale, and the number of tokens is not known before the graph runs.
    apply_runtime(traced, Runtime(attention="plain"))
    for module in traced.modules():
        if isinstance(module, Sequentialize):
            # The cache would keep a tracer's tensors, and give them to the next real step.
            module.code = unwrap(module.code)
        if isinstance(module, MultiHeadAttention) and module.scales_by_tokens:
            module._scale = _traced_scale  # pyright: ignore[reportAttributeAccessIssue]  a tensor where a float was
    return traced


def _traced_scale(head_dim: int, num_tokens: int) -> Tensor:
    """`MultiHeadAttention._scale` in tensors: Python's logarithm would be that of the traced size for ever."""
    count = torch.full((), num_tokens, dtype=torch.float32)
    return torch.log(count) / (math.log(TRAINED_TOKENS) * math.sqrt(head_dim))


def _example(model: Network, size: tuple[int, int]) -> tuple[Tensor, tuple[Tensor, ...], tuple[Tensor, ...]]:
    voxels = torch.zeros(1, model.bins, *size)
    try:
        with torch.inference_mode():
            pyramid, state = model.encode(voxels)
    except (RuntimeError, ModelError) as error:
        raise ExportError(f"{model.name}: cannot step a grid of {size[1]}x{size[0]} ({error})") from None
    return voxels, tuple(t.clone() for t in state.tensors), tuple(t.clone() for t in pyramid.levels)


def _numbered(name: str, tensors: Sequence[Tensor]) -> tuple[str, ...]:
    return tuple(f"{name}_{i}" for i in range(len(tensors)))


def _write(graph: Graph, path: Path, model: Network, is_dynamic: bool) -> Path:
    check_target(path)
    free = tuple(_free(tensor) for tensor in graph.example)
    # As the modules' signatures have them: starred arguments are one tuple.
    shapes = (free[0], free[1:]) if "voxels" in graph.inputs else (free,)
    with _quiet(), torch.no_grad():
        program = torch.onnx.export(
            graph.module.eval(),
            graph.example,
            dynamo=True,
            opset_version=OPSET,
            input_names=list(graph.inputs),
            output_names=list(graph.outputs),
            dynamic_shapes=shapes if is_dynamic else None,
            verbose=False,
        )
    assert program is not None
    facts = {"name": model.name, "bins": model.bins, "normalise_voxels": model.normalise_voxels, "multiple_of": PATCH}
    program.model.metadata_props["etnet"] = json.dumps(facts)
    with replacing(path, suffix=path.suffix) as beside:
        program.save(beside, external_data=False)
    return path


def _free(tensor: Tensor) -> dict[int, Any]:
    """Height and width as multiples of the token grid's rows and columns."""
    rows = torch.export.Dim("rows", min=2, max=LARGEST)
    columns = torch.export.Dim("columns", min=2, max=LARGEST)
    step = PATCH * tensor.shape[-2] // _EXAMPLE[0]
    return {2: step * rows if step > 1 else rows, 3: step * columns if step > 1 else columns}


@contextmanager
def _quiet() -> Iterator[None]:
    """The exporter warns of its own deprecations and of packages that are not needed."""
    loggers = [logging.getLogger(name) for name in ("torch.onnx", "torch.export", "onnxscript")]
    levels = [logger.level for logger in loggers]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        for logger in loggers:
            logger.setLevel(logging.ERROR)
        try:
            yield
        finally:
            for logger, level in zip(loggers, levels, strict=True):
                logger.setLevel(level)

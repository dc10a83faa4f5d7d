"""Read a pickled torch checkpoint without running anything in it.

Released checkpoints pickle more than tensors (a `parse_config.ConfigParser` full of paths, optimisers, loggers).
Tensors and plain containers are rebuilt; every other class becomes an inert `Foreign` that only remembers its name
and state. No code of the file's choosing is ever imported or called.
"""

from __future__ import annotations

import pickle
from collections.abc import Mapping
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import torch
from torch import Tensor

from etnet.errors import WeightsError

_ALLOWED = {
    ("collections", "OrderedDict"),
    ("torch._utils", "_rebuild_tensor_v2"),
    ("torch._utils", "_rebuild_parameter"),
    ("torch", "Size"),
    ("torch.serialization", "_get_layout"),
}


class Foreign:
    """Stands for an object of a class that was not loaded. `state` is what the pickle wanted to set on it."""

    def __init__(self, *arguments: object, **named: object) -> None:
        self.arguments = arguments
        self.state: object = named

    def __setstate__(self, state: object) -> None:
        self.state = state

    def __setitem__(self, key: object, value: object) -> None:
        """Items of a foreign mapping are dropped."""

    def append(self, item: object) -> None:
        """Items of a foreign list are dropped."""

    def extend(self, items: object) -> None:
        """Items of a foreign list are dropped."""

    def __call__(self, *_: object, **__: object) -> Foreign:
        return self


class _RestrictedUnpickler(pickle.Unpickler):
    def find_class(self, module: str, name: str) -> Any:
        if (module, name) in _ALLOWED or (module == "torch" and name.endswith("Storage")):
            return super().find_class(module, name)
        return type(name.rpartition(".")[2], (Foreign,), {})


def _load(file: Any, **options: Any) -> Any:
    return _RestrictedUnpickler(file, **options).load()


_RESTRICTED_PICKLE = SimpleNamespace(Unpickler=_RestrictedUnpickler, load=_load, __name__="restricted_pickle")


def read_checkpoint(path: Path) -> dict[str, Any]:
    """What a checkpoint holds, as a dict; raises `WeightsError` for a file that is none."""
    try:
        content = torch.load(path, map_location="cpu", pickle_module=_RESTRICTED_PICKLE, weights_only=False)
    except FileNotFoundError:
        raise WeightsError(f"{path}: no such file") from None
    except Exception as error:
        reason = str(error).splitlines()[0] if str(error) else type(error).__name__
        raise WeightsError(f"{path.name}: not a torch checkpoint that can be read ({reason})") from None
    if not isinstance(content, dict):
        raise WeightsError(f"{path.name}: holds a {type(content).__name__}, wanted a dict with a `state_dict`")
    return content


def state_dict_of(content: Mapping[str, Any], name: str) -> dict[str, Tensor]:
    """The state dict in a checkpoint: under `state_dict`, or the checkpoint itself."""
    state = content.get("state_dict", content)
    tensors = {key: value.detach() for key, value in state.items() if isinstance(value, Tensor)}
    if not tensors:
        raise WeightsError(f"{name}: no tensors under `state_dict`; keys are {', '.join(map(str, content))[:200]}")
    return tensors

"""A device beside the processor's that every machine has, with a GPU's rules: nothing may be mixed, reading waits.

torch's "meta" device computes shapes alone. Under `OtherDevice` what is read from it is made up, so that a whole run
goes through; an operation that is given tensors of both devices is an error, as on a GPU.
"""

from __future__ import annotations

from typing import Any
from unittest.mock import patch

import torch
from torch import Tensor
from torch.utils._python_dispatch import TorchDispatchMode
from torch.utils._pytree import tree_leaves

OTHER = torch.device("meta")
COPIES = ("aten::_to_copy", "aten::copy_")


class OtherDevice(TorchDispatchMode):
    """`waits` names each operation that would have waited for the device."""

    def __init__(self) -> None:
        super().__init__()
        self.waits: list[str] = []
        self.num_computed = 0
        real = torch.autocast
        self._autocast = patch.object(
            torch, "autocast", lambda kind, **how: real("cpu" if kind == OTHER.type else kind, **how)
        )

    def __enter__(self) -> OtherDevice:
        self._autocast.start()  # torch knows no autocast for this device
        super().__enter__()
        return self

    def __exit__(self, *error: Any) -> None:
        super().__exit__(*error)
        self._autocast.stop()

    def __torch_dispatch__(self, func: Any, types: Any, args: Any = (), kwargs: Any = None) -> Any:
        kwargs = kwargs or {}
        name = func.name().partition(".")[0]
        tensors = [leaf for leaf in tree_leaves((args, kwargs)) if isinstance(leaf, Tensor)]
        is_there = [tensor.device == OTHER for tensor in tensors]
        self.num_computed += any(is_there)
        if name == "aten::_local_scalar_dense" and all(is_there):
            self.waits.append(name)
            return 0.5 if tensors[0].is_floating_point() else 0
        if name in COPIES:
            return self._copied(func, args, kwargs, name)
        # A number without dimensions may come from anywhere.
        assert len({there for there, tensor in zip(is_there, tensors, strict=True) if tensor.dim()}) <= 1, (
            f"{name} is given tensors of both devices"
        )
        return func(*args, **kwargs)

    def _copied(self, func: Any, args: Any, kwargs: Any, name: str) -> Any:
        source = args[1] if name == "aten::copy_" else args[0]
        target = args[0].device if name == "aten::copy_" else kwargs.get("device") or source.device
        is_waited_for = not (kwargs.get("non_blocking") or (name == "aten::copy_" and len(args) > 2 and args[2]))
        if (source.device == OTHER) != (torch.device(target) == OTHER) and is_waited_for:
            self.waits.append(f"{name} from {source.device} to {target}")
        if source.device == OTHER and torch.device(target) != OTHER:
            made_up = torch.zeros(source.shape, dtype=kwargs.get("dtype") or source.dtype)
            return args[0].copy_(made_up) if name == "aten::copy_" else made_up
        return func(*args, **kwargs)

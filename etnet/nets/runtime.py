"""How a network is run: what does not belong to its weights but decides the last bits of its frames."""

from __future__ import annotations

import platform
from collections.abc import Iterator
from contextlib import contextmanager
from functools import lru_cache

import torch
from torch import nn

from etnet.nets.attention import MultiHeadAttention
from etnet.nets.attention_kernels import has_onednn
from etnet.nets.contract import AttentionPath as AttentionPath
from etnet.nets.contract import Contract as Contract
from etnet.nets.contract import Precision as Precision
from etnet.nets.contract import Runtime as Runtime
from etnet.nets.packed import pack, unpack


def apply_runtime(model: nn.Module, runtime: Runtime) -> None:
    """Set a network up to run in this way."""
    for module in model.modules():
        if isinstance(module, MultiHeadAttention):
            module.path = runtime.attention
    layout = torch.channels_last if runtime.channels_last else torch.contiguous_format
    model.to(memory_format=layout)  # pyright: ignore[reportCallIssue]  torch's stub lacks this overload
    (pack if runtime.packed else unpack)(model)
    model.runtime = runtime  # pyright: ignore[reportArgumentType]


def device_of(model: object) -> torch.device:
    """Where a network's weights lie; the CPU for one of somebody's own that has none to ask."""
    parameter = next(iter(model.parameters()), None) if isinstance(model, nn.Module) else None
    return torch.device("cpu") if parameter is None else parameter.device


def contract_of(model: object) -> Contract:
    """The contract under which `model` runs now."""
    runtime, device = getattr(model, "runtime", Runtime()), device_of(model)
    isa = isa_of_machine() if device.type == "cpu" else isa_of_gpu(device)
    return Contract(runtime, str(device), torch.get_num_threads(), torch.__version__, platform.machine(), isa)


def wait_for(device: torch.device) -> None:
    """Wait until a GPU has computed what it was given, so that a clock that is read now tells how long it took."""
    if device.type == "cuda":
        torch.cuda.synchronize(device)


@lru_cache
def isa_of_gpu(device: torch.device) -> str:
    """What of a GPU decides the last bits: its model, its compute capability and the version of cuDNN."""
    if device.type != "cuda":
        return device.type
    major, minor = torch.cuda.get_device_capability(device)
    return f"{torch.cuda.get_device_name(device)} sm_{major}{minor} cuDNN {torch.backends.cudnn.version()}"


@lru_cache(maxsize=1)
def isa_of_machine() -> str:
    """The vector instructions that torch uses on this processor, with those for bf16 where it has them."""
    features = torch.cpu.get_capabilities() if hasattr(torch.cpu, "get_capabilities") else {}
    extra = [name for name in ("avx512_bf16", "amx_bf16") if features.get(name)]
    return " ".join((torch.backends.cpu.get_cpu_capability(), *extra))


def default_runtime(precision: Precision = "fp32", device: str = "cpu") -> Runtime:
    """The kernels that were fastest where they were measured (docs/performance.md), in this precision."""
    if torch.device(device).type == "cpu" and has_onednn():
        return Runtime(precision, "by_heads" if precision == "fp32" else "tiled", channels_last=True, packed=True)
    return Runtime(precision)


@contextmanager
def precision_of(runtime: Runtime, device_type: str) -> Iterator[None]:
    """Run what is inside in the runtime's precision; weights and states stay as they are."""
    if runtime.precision == "fp32":
        yield
        return
    with torch.autocast(device_type, dtype=torch.bfloat16):
        yield

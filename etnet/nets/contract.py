"""What decides the last bits of a frame beside the weights, as values; nothing here needs torch."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal

Precision = Literal["fp32", "bf16"]
AttentionPath = Literal["fused", "plain", "tiled", "by_heads"]


@dataclass(frozen=True, slots=True)
class Runtime:
    """Precision, attention kernel, memory format and packing of one network."""

    precision: Precision = "fp32"
    attention: AttentionPath = "fused"
    channels_last: bool = False
    packed: bool = False
    """Layers run in the form that is packed once for the processor's kernels, where there is one (`nets.packed`)."""


@dataclass(frozen=True, slots=True)
class Contract:
    """Two runs whose contracts are equal give the same bits; a frame is called exact only under its contract."""

    runtime: Runtime
    device: str
    threads: int
    torch_version: str
    machine: str
    isa: str = ""
    """The vector instructions that torch uses here ("AVX512"), or the GPU's model and kernels; empty where an older
    file does not say."""


def contract_of_plain(plain: Mapping[str, Any]) -> Contract:
    """The contract that `dataclasses.asdict` took apart. TypeError where it is none of ours."""
    return Contract(**{**plain, "runtime": Runtime(**plain["runtime"])})

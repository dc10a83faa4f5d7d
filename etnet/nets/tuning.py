"""Which kernels are fastest at a recording's size here: tried once in the background, kept, used from then on."""

from __future__ import annotations

import logging
import time
from collections.abc import Iterator
from dataclasses import asdict, replace
from threading import Thread
from typing import TYPE_CHECKING, Any, get_args

import torch

from etnet.nets.attention import MultiHeadAttention
from etnet.nets.attention_kernels import KERNELS, has_onednn
from etnet.nets.kept_choices import keep_choice, kept_choice
from etnet.nets.padding import TokenGrid
from etnet.nets.precision import best_of
from etnet.nets.runtime import AttentionPath, Precision, Runtime, apply_runtime, default_runtime, device_of

if TYPE_CHECKING:
    from etnet.nets.presets import Network

PATIENCE = 2.0
"""Seconds that a trial may take; what was not tried by then is not chosen."""
_LARGEST_MAP = 1 << 21
"""Entries of the attention map that are timed: cost goes with the number of queries, so a share of them will do."""
_LARGEST_IMAGE = 346 * 260

_log = logging.getLogger(__name__)


def tune(model: Network, height: int, width: int) -> Thread | None:
    """Run `model` with the kernels that were found fastest for this size here, or find them out (`begin_trial`)."""
    return None if apply_kept(model, height, width) else begin_trial(model, height, width)


def begin_trial(model: Network, height: int, width: int) -> Thread | None:
    """Find out in the background which kernels are fastest for this size here, for the next time.

    `model` runs as it does: a runtime never changes while frames are made. Gives the trial's thread; `None` if there
    is nothing to try, or somebody found it out meanwhile.
    """
    if not _can_choose(model) or _kept_runtime(model, height, width) is not None:
        return None
    name, precision = _name(model, height, width), model.runtime.precision
    heads = next(
        ((m.heads, m.out_proj.in_features) for m in model.modules() if isinstance(m, MultiHeadAttention)), None
    )
    arguments = (name, type(model), model.config, heads, precision, height, width)
    trial = Thread(target=_try_and_keep, args=arguments, name="kernel trial", daemon=True)
    trial.start()
    return trial


def apply_kept(model: Network, height: int, width: int) -> bool:
    """Run `model` with the kernels that were found fastest for this size here; whether nothing is left to try."""
    if not _can_choose(model):
        return True
    runtime = _kept_runtime(model, height, width)
    if runtime is not None:
        apply_runtime(model, runtime)
    return runtime is not None


def runs_as_loaded(model: Network, height: int, width: int) -> bool:
    """Whether `model` runs as it would for this size if it were loaded now.

    It does not where it was loaded for another size, or before a trial that has ended since.
    """
    kept = _kept_runtime(model, height, width) if _can_choose(model) else None
    return model.runtime == (kept or default_runtime(model.runtime.precision, str(device_of(model))))


def fastest_runtime(
    twin: Network, heads: tuple[int, int] | None, precision: Precision, height: int, width: int, patience: float
) -> Runtime:
    """The fastest of the kernels that could be tried within `patience` seconds. `twin` is a network of its own, whose
    weights do not matter; `heads` its (number of heads, token width)."""
    ends, chosen = time.monotonic() + patience, default_runtime(precision)
    with torch.inference_mode():
        if heads is not None:
            tokens = TokenGrid(height, width).num_tokens
            timed = dict(_time_attention(*heads, tokens, precision, ends - patience / 2))
            if len(timed) > 1:
                chosen = replace(chosen, attention=min(timed, key=lambda path: timed[path]))
        packed = dict(_time_encode(twin, chosen, height, width, ends))
        if len(packed) > 1:
            chosen = min(packed, key=lambda runtime: packed[runtime])
    return chosen


def _try_and_keep(
    name: str, kind: type[Network], config: Any, heads: Any, precision: Precision, height: int, width: int
) -> None:
    """The trial, with a network of its own. One that cannot be made from its configuration alone is not tried."""
    try:
        found = fastest_runtime(kind(config).eval(), heads, precision, height, width, PATIENCE)
    except Exception:
        _log.info("no kernels could be tried for %s; it runs with the usual ones", kind.__name__, exc_info=True)
    else:
        keep_choice(name, asdict(found))


def _time_attention(
    heads: int, dim: int, tokens: int, precision: Precision, ends: float
) -> Iterator[tuple[AttentionPath, float]]:
    dtype = torch.float32 if precision == "fp32" else torch.bfloat16
    num_queries = max(min(tokens, _LARGEST_MAP // tokens), 1)
    key, value = torch.randn(2, 1, heads, tokens, dim // heads).to(dtype)
    query = key[:, :, :num_queries]
    first: AttentionPath = default_runtime(precision).attention
    for path in (first, *(path for path in get_args(AttentionPath) if path not in (first, "plain"))):
        if time.monotonic() < ends:
            yield path, best_of(lambda path=path: KERNELS[path](query, key, value, 0.1))


def _time_encode(
    twin: Network, chosen: Runtime, height: int, width: int, ends: float
) -> Iterator[tuple[Runtime, float]]:
    while height * width > _LARGEST_IMAGE:
        height, width = height // 2, width // 2
    voxel = torch.zeros(1, twin.bins, max(height, 8), max(width, 8))
    for runtime in (chosen, replace(chosen, packed=False), replace(chosen, packed=False, channels_last=False)):
        if time.monotonic() < ends:
            apply_runtime(twin, runtime)
            yield runtime, best_of(lambda: twin.encode(voxel), runs=2)


def _name(model: Network, height: int, width: int) -> str:
    return f"kernels {type(model).__name__} {model.config!r} {model.runtime.precision} {height} {width}"


def _can_choose(model: Network) -> bool:
    return device_of(model).type == "cpu" and has_onednn()


def _kept_runtime(model: Network, height: int, width: int) -> Runtime | None:
    kept = kept_choice(_name(model, height, width))
    return None if kept is None else _runtime(kept, model.runtime.precision)


def _runtime(kept: dict[str, Any], precision: Precision) -> Runtime | None:
    try:
        runtime = Runtime(**kept)
    except TypeError:
        return None
    return runtime if runtime.precision == precision and runtime.attention in KERNELS else None

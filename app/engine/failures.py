"""What went wrong with a request or a job, in one sentence for a page; and frames that are no picture."""

from __future__ import annotations

import logging
from typing import Any

import numpy as np
from jaxtyping import Float32

from etnet.errors import EtnetError, ModelError
from etnet.files import printable
from etnet.without_paths import without_paths

_log = logging.getLogger(__name__)


def in_words(error: Exception, what: object) -> str:
    """The sentence; what nobody expected is logged too. No folder of this machine stands in it."""
    if isinstance(error, EtnetError):
        return printable(without_paths(str(error)))
    if isinstance(error, MemoryError):
        return "out of memory; start the viewer with a smaller --budget or with --downsample 2"
    _log.error("%s failed", type(what).__name__, exc_info=error)
    said = without_paths(str(error))[:300]
    return printable(f"something unexpected went wrong ({type(error).__name__}: {said})")


def check_finite(frame: Float32[np.ndarray, "h w"], model: Any, index: int) -> None:
    """An error for a frame with NaN or infinity in it, which would be shown as an exact one.

    It names the first weight that is not finite, or where the largest ones are.
    """
    if np.isfinite(frame).all():
        return
    name = getattr(model, "name", type(model).__name__)
    raise ModelError(
        f"{name}: the frame of window {index} is not finite ({_culprit(model)}); its weights are damaged or do not fit"
    )


def _culprit(model: Any) -> str:
    import torch

    if not isinstance(model, torch.nn.Module):
        return "it is no network of layers"
    for name, weight in model.named_parameters():
        if not bool(torch.isfinite(weight).all()):
            return f"the weight {name} is not"
    largest = max(model.named_parameters(), key=lambda entry: float(entry[1].abs().max()), default=None)
    return "no weight is" if largest is None else f"every weight is; the largest are those of {largest[0]}"

"""What the engine hands over: frames with what may be claimed of them."""

from __future__ import annotations

import logging
import time
from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from jaxtyping import Float32

from app.catalogue.cut import CutRecording
from app.engine.failures import check_finite
from app.engine.playbacks import LoadedPlayback
from app.engine.queue import PendingRequest
from app.engine.requests import FrameRequest, Ready, Reply
from etnet.errors import WindowError

if TYPE_CHECKING:
    from torch import Tensor

    from etnet.nets.attention import Attention

_log = logging.getLogger(__name__)


def ready_of(
    loaded: LoadedPlayback,
    request: FrameRequest,
    frame: Tensor,
    attention: Attention | None,
    began: float,
    is_approximate: bool = False,
    began_at: int | None = None,
) -> Ready:
    """A frame as it goes to visitors, with what may be claimed of it.

    `began_at`: the window at which the memory was empty, where the playback's own way does not begin there.
    """
    array = array_of(frame)
    check_finite(array, loaded.playback.model, request.index)
    first = loaded.playback.first if began_at is None else began_at
    num_replayed = request.index - first
    num_seen = loaded.num_seen(request.index, first)
    return Ready(
        request=request,
        frame=array,
        attention=attention,
        milliseconds=(time.perf_counter() - began) * 1000,
        is_exact=not is_approximate and is_exact(loaded, request),
        is_approximate=is_approximate,
        is_cold=num_seen < loaded.warm_up,
        contract=loaded.contract,
        num_warm=min(num_replayed, loaded.warm_up) if is_approximate else num_replayed,
        began_at=first,
        num_seen=num_seen,
        warm_up=loaded.warm_up,
    )


def cold_frame(loaded: LoadedPlayback, request: FrameRequest, began: float, cancelled: Callable[[], bool]) -> Ready:
    """A frame from a cold start of its own: events on the way to its window have left the buffer of a live recording,
    or were passed over by a network that began later."""
    from etnet.nets.attention import AttentionProbe

    recording = loaded.playback.recording
    assert isinstance(recording, CutRecording)
    if recording.is_gone(loaded.windows[request.index]):
        raise WindowError(f"gone: what came before {recording.gone_before:.1f} s has left the buffer")
    if not request.is_original:
        raise WindowError(
            "a change needs the way to its window, and events on it have left the buffer or were passed over to"
            " catch up; reset the change, or go to a newer moment"
        )
    # The newest window can be read for longer than its events are held.
    at = min(max(recording.first_held, request.index - loaded.warm_up), request.index)
    probe = AttentionProbe() if request.wants_attention else None
    step = loaded.playback.approximate(request.index, request.index - at, cancelled, probe, first=at)
    return replace(ready_of(loaded, request, step.frame, step.attention, began, began_at=at), is_exact=False)


def is_exact(loaded: LoadedPlayback, request: FrameRequest) -> bool:
    """Whether a frame of this playback may be called exact now: nothing changed it, it runs as when it began, and began
    with the recording's first window."""
    from etnet.nets.runtime import contract_of

    is_whole = request.is_original and loaded.playback.first == 0
    return is_whole and contract_of(loaded.playback.model) == loaded.contract


def array_of(frame: Tensor) -> Float32[np.ndarray, "h w"]:
    """A frame as a read-only array."""
    array = frame[0, 0].float().cpu().numpy()
    array.flags.writeable = False
    return array


def hand_over(turn: PendingRequest, reply: Reply) -> None:
    """Hand a reply over; a visitor who cannot take it is no concern of the engine's."""
    try:
        turn.deliver(reply)
    except Exception:
        _log.info("a reply could not be delivered to %s", turn.visitor, exc_info=True)

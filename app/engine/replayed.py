"""What a protocol of the evaluation feeds, as windows that a playback can show."""

from __future__ import annotations

from typing import Literal

from etnet.events.recording import Recording
from etnet.windows import ByStamps

FIRST = 1
"""The window of the policy at which the protocol's cold start is: the one before it ends where the cut begins."""


def replayed_windows(recording: Recording, rule: Literal["paper", "evreal"]) -> ByStamps:
    """The policy whose windows, from `FIRST` on, are those that the protocol feeds, frame by frame.

    Where a protocol begins with an empty window (EVREAL), that window is the last µs before the first frame.
    Raises RecordingError where the protocol can score nothing.
    """
    from etnet.evaluation.protocol import PROTOCOLS, plan_protocol

    windows = [item.window for item in plan_protocol(recording, PROTOCOLS[rule]).items]
    stops = [window.t_stop for window in windows]
    return ByStamps((min(windows[0].t_start, stops[0] - 1), *stops))

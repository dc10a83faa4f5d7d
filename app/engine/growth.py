"""The plan of a recording that may still be in the making."""

from __future__ import annotations

from collections.abc import Sequence

from etnet.events.recording import Recording
from etnet.windows import Policy, Window, grown_windows, plan_windows


def grown_plan(recording: Recording, policy: Policy, former: Sequence[Window] = ()) -> Sequence[Window]:
    """All windows of a whole recording; of one in the making those that are settled. `former`: the plan before."""
    if recording.latest is None:
        return plan_windows(recording, policy)
    truth = recording.ground_truth
    assert truth is not None
    return grown_windows(recording, policy, int(truth.stamps[-1]), former)

"""Window policies on the command line: `between-frames`, `count=10000`, `density=0.35`, `duration=20ms[/5ms]` …"""

from __future__ import annotations

import re

from etnet.errors import WindowError
from etnet.events.recording import Recording
from etnet.windows import BetweenFrames, ByActivity, ByCount, ByCountOrDuration, ByDensity, ByDuration, Policy

DEFAULT_DENSITY = 0.35
"""Events per pixel and window where a recording has no frames: the middle of what networks are trained on."""

_UNITS = {"us": 1, "µs": 1, "ms": 1_000, "s": 1_000_000}


def parse_policy(text: str) -> Policy:
    """The policy that `text` names; raises `WindowError` with the forms there are."""
    name, _, value = text.strip().partition("=")
    try:
        match name:
            case "between-frames" if not value:
                return BetweenFrames()
            case "count":
                count, is_either, duration = value.partition(",duration=")
                num_events = int(count.replace("_", ""))
                return ByCountOrDuration(num_events, _microseconds(duration)) if is_either else ByCount(num_events)
            case "active":
                return ByActivity(float(value.removesuffix("%")) / (100 if value.endswith("%") else 1))
            case "density":
                return ByDensity(float(value))
            case "duration":
                duration, _, stride = value.partition("/")
                return ByDuration(_microseconds(duration), _microseconds(stride) if stride else None)
    except ValueError:
        pass
    raise WindowError(
        f"windows {text!r} are not understood; "
        "use between-frames, count=10000, density=0.35, duration=20ms (duration=20ms/5ms overlaps), "
        "count=10000,duration=20ms (whichever comes first) or active=20% (of the pixels)"
    )


def default_policy(recording: Recording) -> Policy:
    """Between the camera's frames where there are some, else by density."""
    truth = recording.ground_truth
    return BetweenFrames() if truth is not None and len(truth) > 1 else ByDensity(DEFAULT_DENSITY)


def _microseconds(text: str) -> int:
    found = re.fullmatch(r"([0-9.]+)(us|µs|ms|s)", text.strip())
    if found is None:
        raise ValueError(text)
    return round(float(found[1]) * _UNITS[found[2]])

"""Numbers and names in plain words, the same everywhere on the page."""

from __future__ import annotations

import math

from app.html.moment import NUM_BINS
from etnet.windows import BetweenFrames, ByActivity, ByCount, ByCountOrDuration, ByDensity, ByDuration, ByStamps, Policy


def count(number: int) -> str:
    """12,345."""
    return f"{number:,}"


def short(value: float) -> str:
    """Three significant digits, two of what is below 0.001, and never an exponent: 0.035, 1.49, 12,300, 0.00023."""
    if abs(value) >= 1000:
        return f"{value:,.0f}"
    return significant(value, 3 if abs(value) >= 1e-3 else 2)


def significant(value: float, digits: int = 3) -> str:
    """So many significant digits and never an exponent; more of a number that has more before its point: 1234."""
    if value == 0 or not math.isfinite(value):
        return "0" if value == 0 else str(value)
    places = digits - 1 - math.floor(math.log10(abs(value)))
    text = f"{value:.{max(places, 0)}f}"
    return text.rstrip("0").rstrip(".") if places > 0 else text


def of_whole(share: float, digits: int = 0) -> str:
    """A share as 13 %."""
    return f"{100 * share:.{digits}f} %"


def seconds(value: float, digits: int = 3) -> str:
    """0.620 s, or 1 min 02.5 s for long ones; no minute has 60 s."""
    value = round(value, digits)
    if value < 60:
        return f"{value:.{digits}f} s".replace("-", "−")
    minutes, rest = divmod(value, 60)
    width = digits + 3 if digits else 2
    return f"{int(minutes)} min {rest:0{width}.{digits}f} s"


def milliseconds(value: float) -> str:
    """310 ms, 4.2 ms, 2.31 s."""
    if value >= 1000:
        return f"{value / 1000:.2f} s"
    return f"{value:.0f} ms" if value >= 10 else f"{value:.1f} ms"


def rate(events_per_second: float) -> str:
    """640 kev/s."""
    for size, name in ((1e9, "G"), (1e6, "M"), (1e3, "k")):
        if events_per_second >= size:
            return f"{significant(events_per_second / size)} {name}ev/s"
    return f"{events_per_second:.0f} ev/s"


def policy(chosen: Policy) -> str:
    """How the events are cut into windows."""
    match chosen:
        case BetweenFrames():
            return "between camera frames"
        case ByCount(num_events):
            return f"every {count(num_events)} events"
        case ByDensity(events_per_pixel):
            return f"every {short(events_per_pixel)} events per pixel"
        case ByDuration():
            overlap = "" if chosen.step == chosen.duration else f", one each {milliseconds(chosen.step / 1000)}"
            return f"every {milliseconds(chosen.duration / 1000)}{overlap}"
        case ByCountOrDuration(num_events, duration):
            return f"every {count(num_events)} events, at the latest after {milliseconds(duration / 1000)}"
        case ByActivity(active_pixels):
            return f"each time {significant(active_pixels)} of the pixels have had an event"
        case ByStamps(stamps):
            return f"up to {count(len(stamps))} given moments"


def resolution(scale: int) -> str:
    """The paper's scale index → what part of the sensor's resolution it has: 1 → "1/2"."""
    return f"1/{2**scale}"


def fraction(value: float) -> str:
    """Powers of two below one as fractions: 1/4, 1/2, 1, 8."""
    return f"1/{round(1 / value)}" if value < 1 else f"{value:g}"


def bin_words(index: int) -> str:
    """Around which part of the window's time a bin gathers: a bin's votes peak at index / (bins − 1)."""
    half = 50 / (NUM_BINS - 1)
    middle = 100 * index / (NUM_BINS - 1)
    return f"{max(middle - half, 0):.0f}–{min(middle + half, 100):.0f} %"

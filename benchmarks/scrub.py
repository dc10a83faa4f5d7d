"""What a visitor feels, server side: a slider drag over an unvisited recording, and frames that were visited.

A browser that is only a websocket drives the real server with the real engine and the default weights; its clock
starts when the slider's value is sent and stops when the view of that window has arrived.
"""

import asyncio
import os
import re
import statistics
import sys
import time
from pathlib import Path

from measure import report

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from app.config import ViewerConfig
from app.main import Viewer
from tests.app.stand_ins import Browser

DRAG = range(1, 41)
HERTZ = 30
AIM = {"drag": (45, 70), "visited": (50, None)}


async def _arrives(browser: Browser, pattern: str, patience: float) -> None:
    ends = time.monotonic() + patience
    while re.search(pattern, browser.html()) is None:
        if time.monotonic() > ends:
            raise TimeoutError(f"{pattern} did not arrive in {patience} s")
        await asyncio.sleep(0.002)


async def _drag(browser: Browser) -> list[float]:
    """Milliseconds from each slider value to its window on the page, at a finger's 30 values a second."""
    slider, took = browser.widget("Window"), []
    for index in DRAG:
        began = time.perf_counter()
        await browser.use(slider, index)
        await _arrives(browser, rf"events of window {index}\b", 5)
        took.append((time.perf_counter() - began) * 1e3)
        await asyncio.sleep(max(0.0, 1 / HERTZ - (time.perf_counter() - began)))
    return took


async def _visited(browser: Browser) -> list[float]:
    """Milliseconds until the image of a window that was computed before is shown again."""
    slider, took = browser.widget("Window"), []
    for index in (4, 5, 6):
        await browser.use(slider, index)
        await _arrives(browser, rf"Reconstruction of window {index}\b", 120)
    for index in (4, 6, 5, 4, 5, 6):
        began = time.perf_counter()
        await browser.use(slider, index)
        await _arrives(browser, rf"Reconstruction of window {index}\b", 5)
        took.append((time.perf_counter() - began) * 1e3)
    return took


async def _story(port: int) -> dict[str, list[float]]:
    async with Browser.open(port, tab=1) as browser:
        await browser.until_shown('data-testid="timeline"')
        return {"drag": await _drag(browser), "visited": await _visited(browser)}


def main() -> None:
    """Drive one visit and report the two delays."""
    viewer = Viewer(ViewerConfig(port=0, precision="fp32", cache="off"))
    try:
        took = asyncio.run(_story(int(viewer.url.rsplit(":", 1)[1].strip("/"))))
    finally:
        viewer.stop()
    report(
        "scrub",
        [
            {
                "what": what,
                "median_ms": statistics.median(values),
                "p90_ms": sorted(values)[int(0.9 * (len(values) - 1))],
                "worst_ms": max(values),
                "aim_ms": AIM[what][0],
                "aim_p90_ms": AIM[what][1],
                "load": os.getloadavg()[0] if hasattr(os, "getloadavg") else None,
            }
            for what, values in took.items()
        ],
    )


if __name__ == "__main__":
    main()

"""Whether playing starves: python benchmarks/play.py [--turns 2]

A browser that is only a websocket plays the bundled recording `rolling` from its start, frames not yet computed, on the
real server with the default weights: at the speed that is offered first, and at the next faster one. Told are the
images that came of the windows that were played, images a second, and the longest time without a new image beside the
time that a window lasts at that speed.
"""

import argparse
import asyncio
import itertools
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
from app.views.timeline.state import SPEEDS
from tests.app.stand_ins import Browser

PATIENCE = 240.0
_AXIS = re.compile(r"window (\d+) <i>of 0 – (\d+)")
_IMAGE = re.compile(r"Reconstruction of window (\d+)\b")
_CHOSEN = re.compile(r'data-k="timeline:speed ([^"]+)"[^>]*aria-pressed="true"')


async def _press(browser: Browser, key: str) -> None:
    await browser.use(browser.widget("channel"), f"pick|{key}|0|0|{time.monotonic_ns()}")


async def _play(port: int, speed: str | None) -> dict[str, object]:
    """Play to the end once; at the offered speed where none is named."""
    async with Browser.open(port, tab=1) as browser:
        await browser.until(lambda: 'data-k="open:bundled-rolling"' in browser.html(), PATIENCE)
        await _press(browser, "open:bundled-rolling")
        await browser.until(lambda: "<span>rolling</span></summary>" in browser.html(), PATIENCE)
        await browser.until(lambda: _rests(browser.html()), PATIENCE)
        if speed is not None:
            await _press(browser, f"timeline:speed {speed}")
            await asyncio.sleep(0.5)
        began, images, last = time.perf_counter(), {}, None
        await _press(browser, "timeline:play")
        while last is None or last[0] < last[1]:
            html, now = browser.html(), time.perf_counter() - began
            found, image = _AXIS.search(html), _IMAGE.search(html)
            last = (int(found[1]), int(found[2])) if found else last
            if image:
                images.setdefault(int(image[1]), now)
            if now > PATIENCE:
                break
            await asyncio.sleep(0.004)
        took, chosen = time.perf_counter() - began, _CHOSEN.search(browser.html())
        assert last is not None
        arrived = sorted(images.values())
        gaps = [after - before for before, after in itertools.pairwise(arrived)]
        name = chosen[1] if chosen else str(speed)
        return {
            "speed": name,
            "windows": last[1] + 1,
            "images": len(images),
            "images_per_second": (len(images) - 1) / took,
            "median_gap_ms": 1e3 * statistics.median(gaps),
            "longest_gap_ms": 1e3 * max(gaps),
            "window_ms": 1e3 * took / (last[1] + 1),
        }


def _rests(html: str) -> bool:
    """Whether the first window's own image is there, and none of what was open before."""
    return "Reconstruction of window 0" in html and 'data-testid="lag"' not in html and "former settings" not in html


def _row(which: str, speed: str | None) -> dict[str, object]:
    """A viewer of its own, so that no frame is kept."""
    viewer = Viewer(ViewerConfig(port=0, precision="fp32", cache="off"))
    try:
        return {"which": which, **asyncio.run(_play(viewer.port, speed)), "load": os.getloadavg()[0]}
    finally:
        viewer.stop()


def main() -> None:
    """Play at both speeds in turn."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--turns", type=int, default=2)
    given, rows = parser.parse_args(), []
    for _ in range(given.turns):
        names = [name for name, choice in SPEEDS.items() if not choice.waits_for_frames]
        offered = _row("offered first", None)
        rows.append(offered)
        faster = names[: names.index(str(offered["speed"]))]
        if faster:
            rows.append(_row("the next faster", faster[-1]))
    report("play", rows)


if __name__ == "__main__":
    main()

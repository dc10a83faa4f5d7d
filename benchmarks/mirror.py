"""The mirror: how many images of the visitor's own camera a second, and how far behind they are.

`python benchmarks/mirror.py [--seconds 20] [--browser] [--sizes 1600x900 390x844]`

Made-up pictures of 160×120 go to a demo as a browser sends them: the next one when the last was seen, 15 a second at
most. Every image of another window that the page draws counts once. With `--browser` Chromium looks through its fake
camera and draws the scene in software on the same machine, and what counts is each image that stands in its page.
Wanted are 5 a second on two cores; the exit code is 1 where one of the rows has fewer.
"""

from __future__ import annotations

import argparse
import asyncio
import json
import re
import statistics
import sys
import time
from pathlib import Path

import numpy as np
from measure import report

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from app.config import ViewerConfig
from app.main import Viewer
from tests.app.stand_ins import Browser

FEWEST = 5.0
"""Images a second."""
SETTLES = 3.0
"""Seconds that are not counted: the first windows come while the network is just being asked."""
LOOK = 0.005
PATIENCE = 120.0


async def without_a_browser(viewer: Viewer, seconds: float) -> dict[str, object]:
    """A page that draws nothing: the camera, the pixels, the network and the page's HTML."""
    from websockets.asyncio.client import connect

    async with Browser.open(viewer.port, tab=1) as browser:
        await browser.until_shown('data-testid="demo"', PATIENCE)
        await browser.use(browser.widget("channel"), "pick|demo:mirror|0|0|1")
        await browser.until(lambda: "data-etv-camera=" in browser.html(), PATIENCE)
        ticket = re.findall(r'data-etv-camera="([^"]+)"', browser.html())[-1]
        async with connect(f"ws://127.0.0.1:{viewer.port}/camera", compression=None) as socket:
            await socket.send(json.dumps({"ticket": ticket}))
            sending = asyncio.create_task(_send(socket, json.loads(await socket.recv())["go"]))
            await browser.until(lambda: 'data-testid="delay"' in browser.html(), PATIENCE)
            await asyncio.sleep(SETTLES)
            shown, delays, steps = await _watch(viewer, seconds)
            sending.cancel()
    return _row("no browser", shown, seconds, delays, steps)


async def _send(socket, size: list[int]) -> None:
    """Waves that drift, as fast as they are seen."""
    y, x = np.mgrid[: size[1], : size[0]]
    began = time.monotonic()
    while True:
        at = time.monotonic()
        grey = 128 + 90 * np.sin((x - 40 * (at - began)) / 9) * np.cos((y + 15 * (at - began)) / 11)
        await socket.send(grey.astype(np.uint8).tobytes())
        await socket.recv()
        await asyncio.sleep(max(1 / 15 - (time.monotonic() - at), 0))


async def _watch(viewer: Viewer, seconds: float) -> tuple[int, list[float], list[float]]:
    """Windows whose image was drawn, and how far behind each was and how long its step took (ms)."""
    until, seen, delays, steps = time.monotonic() + seconds, set[int](), list[float](), list[float]()
    while time.monotonic() < until:
        await asyncio.sleep(LOOK)
        page = viewer.newest_page()
        if page is None or page.ready is None or page.mirror is None or page.mirror.delay is None:
            continue
        if page.ready.request.index not in seen:
            seen.add(page.ready.request.index)
            delays.append(page.mirror.delay)
            steps.append(page.step_milliseconds or 0.0)
    return len(seen), delays, steps


def with_a_browser(viewer: Viewer, seconds: float, size: tuple[int, int]) -> dict[str, object]:
    """Chromium's fake camera, and its own drawing beside the network."""
    from tests.browser.booth import open_demo, press
    from tests.browser.chromium import chromium, require_browser

    with chromium(require_browser()) as browser:
        page = open_demo(browser, viewer, *size)
        press(page, "Your own face")
        page.locator("[data-etv-camera]").wait_for()
        press(page, "Use my camera")
        page.get_by_test_id("delay").wait_for()
        page.wait_for_timeout(1000 * SETTLES)
        before = viewer.newest_page()
        steps = [] if before is None else [before.step_milliseconds or 0.0]
        shown = page.evaluate(
            """async (seconds) => {
              const seen = new Set(), ends = performance.now() + 1000 * seconds;
              while (performance.now() < ends) {
                seen.add(document.querySelector('.etv-image img')?.alt);
                await new Promise((next) => setTimeout(next, 10));
              }
              return seen.size;
            }""",
            seconds,
        )
        delay = float(page.get_by_test_id("delay").inner_text().split()[0])
        page.context.close()
    return _row(f"Chromium, {size[0]}x{size[1]}, drawn in software", shown, seconds, [delay], steps)


def _row(what: str, shown: int, seconds: float, delays: list[float], steps: list[float]) -> dict[str, object]:
    return {
        "what": what,
        "images_per_s": shown / seconds,
        "delay_s_median": statistics.median(delays) if delays else None,
        "delay_s_most": max(delays, default=None),
        "step_ms": statistics.median(steps) if steps else None,
    }


def main() -> int:
    """Measure and keep."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seconds", type=float, default=20.0)
    parser.add_argument("--browser", action="store_true")
    parser.add_argument("--sizes", nargs="+", default=["1600x900", "390x844"])
    given = parser.parse_args()
    viewer = Viewer(ViewerConfig(demo=True, port=0, precision="fp32"))
    try:
        viewer.rehearse()
        rows = [asyncio.run(without_a_browser(viewer, given.seconds))]
        for size in given.sizes if given.browser else ():
            width, height = map(int, size.split("x"))
            rows.append(with_a_browser(viewer, given.seconds, (width, height)))
    finally:
        viewer.stop()
    report("mirror", rows)
    return 0 if all(float(str(row["images_per_s"])) >= FEWEST for row in rows) else 1


if __name__ == "__main__":
    sys.exit(main())

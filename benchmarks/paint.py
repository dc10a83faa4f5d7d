"""What a visitor sees, up to the paint: steps of a finger at 30 a second, in headless Chromium.

The clock starts with the key's own time stamp in the page and stops two animation frames after the card of the
window's events has changed, when it has been painted. The browser draws the scene in software on the same cores, so
an animation frame takes as long as is printed beside, and two of them are the floor of what is measured.

Run: python benchmarks/paint.py [--size 1600x900]
"""

import argparse
import os
import statistics
import sys
import time
from itertools import pairwise
from pathlib import Path

from measure import report

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from app.config import ViewerConfig
from app.main import Viewer
from tests.browser.chromium import chromium, executable, open_page

STEPS, HERTZ = 40, 30
CLOCK = """(first) => {
  const shown = () => {
    const found = [...document.querySelectorAll('img[alt*="events of window "]')].map((image) => image.alt);
    return found.length ? Number(found[0].match(/window (\\d+)/)[1]) : -1;
  };
  const state = (window.etnetPaint = { pressed: [], painted: [], frames: [] });
  let done = first;
  addEventListener("keydown", (event) => { if (event.key === ".") state.pressed.push(event.timeStamp); }, true);
  const count = (now) => { state.frames.push(now); requestAnimationFrame(count); };
  requestAnimationFrame(count);
  new MutationObserver(() => {
    const index = shown();
    if (index <= done) return;
    const from = done;
    done = index;
    requestAnimationFrame(() => requestAnimationFrame(() => {
      for (let i = from; i < index; i += 1) state.painted[i - first] = performance.now();
    }));
  }).observe(document.body, { subtree: true, childList: true, attributes: true, characterData: true });
}"""


def _interval(frames: list[float]) -> float:
    """Milliseconds from one animation frame to the next, in the median."""
    return statistics.median(after - before for before, after in pairwise(frames))


def _story(page) -> tuple[list[float], float, float]:
    """Milliseconds from each key to its paint, and from one animation frame to the next at rest and meanwhile."""
    page.get_by_alt_text("Reconstruction of window", exact=False).first.wait_for()
    page.wait_for_timeout(3000)  # what is prepared beside the page has its share of the cores before and after
    first = page.evaluate("""() => Number(document.querySelector('img[alt*="events of window "]')
        .alt.match(/window (\\d+)/)[1])""")
    page.mouse.move(5, 5)
    page.evaluate(CLOCK, first)
    page.wait_for_timeout(2000)
    at_rest = page.evaluate("() => window.etnetPaint.frames.splice(0)")
    for _ in range(STEPS):
        began = time.perf_counter()
        page.keyboard.press(".")
        time.sleep(max(0.0, 1 / HERTZ - (time.perf_counter() - began)))
    page.wait_for_function(f"() => window.etnetPaint.painted.length >= {STEPS}")
    told = page.evaluate("() => window.etnetPaint")
    took = [painted - pressed for pressed, painted in zip(told["pressed"], told["painted"], strict=True)]
    return took, _interval(at_rest), _interval(told["frames"])


def main() -> None:
    """Measure one visit and keep the figures."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--size", default="1600x900")
    parser.add_argument("--slow", type=float, default=1, help="a page whose script runs so many times slower")
    told = parser.parse_args()
    width, height = map(int, told.size.split("x"))
    path = executable()
    if path is None:
        sys.exit("no Chromium here: apt-get install chromium")
    load = os.getloadavg()[0]
    viewer = Viewer(ViewerConfig(port=0, precision="fp32", cache="off"))
    try:
        with chromium(path) as browser:
            page = open_page(browser, viewer.url, width, height)
            page.context.new_cdp_session(page).send("Emulation.setCPUThrottlingRate", {"rate": told.slow})
            took, at_rest, meanwhile = _story(page)
    finally:
        viewer.stop()
    row = {
        "what": f"key to paint, {width}×{height}",
        "slowed": told.slow,
        "median_ms": statistics.median(took),
        "p90_ms": sorted(took)[int(0.9 * (len(took) - 1))],
        "worst_ms": max(took),
        "frame_at_rest_ms": at_rest,
        "frame_meanwhile_ms": meanwhile,
        "load": load,
    }
    report("paint", [row])


if __name__ == "__main__":
    main()

"""What a visitor of the demo who comes cold waits for, from asking for the page to the first thing that moves.

Run: python benchmarks/first_motion.py [--runs N] [--phone]   (needs Chromium and a machine that does nothing else)

The first scene is rendered before, as `etnet-view --demo` does. Each run is a browser context of its own, so nothing is
cached. Milliseconds are told by the page itself, counted from when it was asked for; "moves" is the second picture that
Chromium painted which differs from the one before it, so a page that stands still has none. What was sent is what went
over the socket, packed. viser's page with nothing of ours in it, in the same run, is the floor.
"""

from __future__ import annotations

import argparse
import statistics
import sys
import time
from pathlib import Path

import cv2
import numpy as np
from measure import report

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from app.config import ViewerConfig
from app.main import Viewer
from app.web.server import free_port
from tests.browser.capture import Film, record
from tests.browser.chromium import chromium, require_browser

AIM = 2000.0
"""Milliseconds until something moves."""
PATIENCE = 120_000
MOVED = 0.4
"""Mean difference of two paints (grey levels of a picture 160 pixels wide) from which something moved."""
LOOKED_FOR = {
    "the page's first words": "h1, .etv-opening",
    "ours is laid out": "[data-etv-workspace]",
    "image": ".etv-image img",
}
CONNECTED = "() => window.__viserMutable && !document.body.innerText.includes('Connecting')"
NOTE = """(looked_for) => {
  window.noted = {};
  const note = (name) => (window.noted[name] ??= performance.now());
  document.addEventListener('DOMContentLoaded', () => note('page is parsed'));
  let first = null;
  const look = () => {
    for (const [name, what] of Object.entries(looked_for)) if (document.querySelector(what)) note(name);
    if (window.__viserMutable) note('viser runs');
    if (window.etnetHello && window.etnetChannel) note('the page hears');
    const now = document.querySelector('.etv-image img')?.alt;
    if (now && first && now !== first) note('another image');
    first ??= now;
  };
  new MutationObserver(look).observe(document, { childList: true, subtree: true, attributes: true });
}"""


def moments(film: Film) -> dict[str, float]:
    """Milliseconds of the first picture that is not of one colour, and of the next that differs from it."""
    small = [cv2.resize(frame, (160, 90), interpolation=cv2.INTER_AREA).astype(np.float32) for frame in film.frames]
    shown = next((i for i, frame in enumerate(small) if frame.std() > 1.0), None)
    if shown is None:
        return {}
    found = {"something to see": 1000 * float(film.times[shown])}
    for before, after in zip(range(shown, len(small)), range(shown + 1, len(small)), strict=False):
        if np.abs(small[after] - small[before]).mean() > MOVED:
            return found | {"moves": 1000 * float(film.times[after])}
    return found


def visit(browser, url: str, size: tuple[int, int]) -> tuple[dict[str, float], list[dict[str, object]]]:
    """One visitor: the moments of the page, in ms from asking for it, and what was sent to it."""
    phone = {"is_mobile": True, "has_touch": True, "device_scale_factor": 2} if size[0] < 500 else {}
    context = browser.new_context(viewport={"width": size[0], "height": size[1]}, **phone)
    context.add_init_script(f"({NOTE})({LOOKED_FOR!r})")
    page = context.new_page()
    page.set_default_timeout(PATIENCE)
    session = context.new_cdp_session(page)
    sent: dict[str, dict[str, object]] = {}
    session.on("Network.requestWillBeSent", lambda m: sent.update({m["requestId"]: {"what": m["request"]["url"]}}))
    session.on("Network.loadingFinished", lambda m: sent[m["requestId"]].update(bytes=m["encodedDataLength"]))
    session.send("Network.enable")

    def ask() -> None:
        page.goto(url, wait_until="commit")
        page.wait_for_function("() => window.noted['another image']")

    film = record(page, ask)
    noted = page.evaluate(
        "() => ({ ...window.noted, ...Object.fromEntries("
        "performance.getEntriesByType('paint').map((e) => [e.name, e.startTime])) })"
    )
    navigation = page.evaluate("() => performance.getEntriesByType('navigation')[0].toJSON()")
    noted["page has arrived"] = navigation["responseEnd"]
    context.close()
    files = [row for row in sent.values() if "bytes" in row and not str(row["what"]).startswith("data:")]
    return noted | moments(film), files


def floor(browser) -> float:
    """Milliseconds until viser's own page, with nothing in it, is connected."""
    import viser

    server = viser.ViserServer(host="127.0.0.1", port=free_port("127.0.0.1", 18_700), verbose=False)
    context = browser.new_context()
    context.add_init_script(f"({NOTE})({{}})")
    page = context.new_page()
    page.set_default_timeout(PATIENCE)
    page.goto(f"http://127.0.0.1:{server.get_port()}", wait_until="commit")
    page.wait_for_function(CONNECTED)
    took = page.evaluate("() => performance.now()")
    context.close()
    server.stop()
    return float(took)


def main() -> None:
    """Visits in turns with the floor."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--runs", type=int, default=5)
    parser.add_argument("--phone", action="store_true")
    given = parser.parse_args()
    size = (390, 844) if given.phone else (1600, 900)
    viewer = Viewer(ViewerConfig(demo=True, port=0))
    visits: list[dict[str, float]] = []
    floors: list[float] = []
    files: list[dict[str, object]] = []
    try:
        viewer.rehearse()
        with chromium(require_browser()) as browser:
            for _ in range(given.runs):
                floors.append(floor(browser))
                took, files = visit(browser, viewer.url, size)
                visits.append(took)
                time.sleep(1.0)
    finally:
        viewer.stop()
    names = sorted({name for took in visits for name in took}, key=lambda n: statistics.median(_of(visits, n)))
    rows: list[dict[str, object]] = [
        {"what": "viser alone: connected", "median_ms": statistics.median(floors), "best_ms": min(floors)}
    ]
    for name in names:
        values = _of(visits, name)
        rows.append(
            {"what": name, "median_ms": statistics.median(values), "best_ms": min(values), "seen_in": len(values)}
        )
    rows += [{"sent": str(row["what"]).removeprefix(viewer.url), "bytes": row["bytes"]} for row in files]
    rows.append({"aim": "moves", "aim_ms": AIM, "runs": given.runs, "size": f"{size[0]}x{size[1]}"})
    report("first_motion_phone" if given.phone else "first_motion", rows)


def _of(visits: list[dict[str, float]], name: str) -> list[float]:
    return [took[name] for took in visits if name in took]


if __name__ == "__main__":
    main()

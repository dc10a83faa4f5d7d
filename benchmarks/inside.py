"""What looking inside costs a visitor at 346×260, server side: a click on a pixel, and a drag with an inspector open.

A browser that is only a websocket drives the real server with the real engine and the default weights. Clicks: from
sending one, with q and k of the window held, until the maps of all sites have arrived, and what of it is drawing them;
the engine prepares frames ahead meanwhile, as it does in a visit. Drags: the median delay of a
window's view while nothing is open and while each inspector is, in turns, so that a busy moment hits them all.
"""

import asyncio
import statistics
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
from measure import report

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from app.views.attention.html.grid import attention_html

from app.config import ViewerConfig
from app.engine.requests import FrameRequest, Ready
from app.html.attention.maps import AttentionLook
from app.main import Viewer
from app.views.inspect.panel import INSPECTORS
from app.views.inspect.state import Inspector
from etnet.events.events import Events, Sensor
from etnet.events.open import open_recording
from etnet.events.recording import Recording, recording_of_events
from etnet.events.write import write_recording
from etnet.nets.attention import AttentionProbe
from etnet.nets.runtime import contract_of
from etnet.nets.weights import load_model
from etnet.playback.playback import Playback
from etnet.windows import ByDensity, plan_windows
from tests.app.stand_ins import Browser

SENSOR, WINDOWS = Sensor(346, 260), 60
CLICKS, ROUNDS, DRAG, HERTZ = 12, 3, range(2, 22), 20
OPENED: tuple[Inspector, ...] = ("none", "change", "input", "matters", "events")
AIMS = {"click": 100.0, "drag": 1.3}


def _recording(folder: Path) -> Path:
    """Random events, in windows of .35 events per pixel."""
    rng = np.random.default_rng(0)
    num_events = int(SENSOR.num_pixels * 0.35 * WINDOWS)
    events = Events(
        rng.integers(0, SENSOR.width, num_events).astype(np.uint16),
        rng.integers(0, SENSOR.height, num_events).astype(np.uint16),
        np.sort(rng.integers(0, WINDOWS * 30_000, num_events)),
        rng.choice([-1, 1], num_events).astype(np.int8),
        SENSOR,
    )
    path = folder / "random.h5"
    write_recording(recording_of_events(events), path)
    return path


def _drawings(recording: Recording) -> list[float]:
    """Milliseconds in which the maps of all sites are drawn for a query that is new."""
    policy = ByDensity(0.35)
    playback = Playback(load_model("etnet-half", "cpu", "fp32"), recording, plan_windows(recording, policy))
    step = playback.at(2, AttentionProbe())
    request = FrameRequest("r", "m", "fp32", policy, 2, True)
    contract = contract_of(playback.model)  # pyright: ignore[reportArgumentType]
    ready = Ready(request, step.frame[0, 0].numpy(), step.attention, 0.0, True, False, False, contract, 2)
    took = []
    for number in range(CLICKS + 1):
        began = time.perf_counter()
        attention_html(ready, AttentionLook((13 + 25 * number, 7 + 19 * number)))
        took.append((time.perf_counter() - began) * 1e3)
    return took[1:]


async def _until(browser: Browser, text: str, patience: float = 120) -> None:
    await browser.until(lambda: text in browser.html(), patience)


async def _clicks(browser: Browser) -> list[float]:
    """Milliseconds from each click to its maps."""
    channel, took = browser.widget("channel"), []
    rng = np.random.default_rng(1)
    for number in range(CLICKS + 1):
        u, v = rng.random(2)
        said = f"What pixel ({int(u * SENSOR.width)}, {int(v * SENSOR.height)}) reads"
        began, num_before = time.monotonic(), len(browser.arrivals)
        await browser.use(channel, f"pick|pixel|{u:.5f}|{v:.5f}|{number}")
        await browser.until(lambda said=said, start=num_before: _arrival(browser, said, start) is not None, 120)
        took.append(((_arrival(browser, said, num_before) or 0.0) - began) * 1e3)
        await asyncio.sleep(0.3)
    return took[1:]  # the first one waits for the decode that keeps q and k


def _arrival(browser: Browser, said: str, start: int) -> float | None:
    """When a text came, looked for among the messages from `start` on."""
    return next((at for at, _, message in browser.arrivals[start:] if said in str(message.get("updates", ""))), None)


async def _drag(browser: Browser) -> list[float]:
    slider, took = browser.widget("Window"), []
    for index in DRAG:
        began = time.perf_counter()
        await browser.use(slider, index)
        await _until(browser, f"window {index} of")
        took.append((time.perf_counter() - began) * 1e3)
        await asyncio.sleep(max(0.0, 1 / HERTZ - (time.perf_counter() - began)))
    return took


async def _story(port: int) -> tuple[list[float], dict[Inspector, list[float]]]:
    async with Browser.open(port, tab=1) as browser:
        await _until(browser, "Reconstruction of window 20")
        clicks = await _clicks(browser)
        await _drag(browser)  # not counted: the events and grids of these windows are read for the first time
        drags: dict[Inspector, list[float]] = {opened: [] for opened in OPENED}
        for _ in range(ROUNDS):
            for opened, took in drags.items():
                await browser.use(browser.widget("Look at"), INSPECTORS[opened])
                await asyncio.sleep(1.0)
                took += await _drag(browser)
        return clicks, drags


def main() -> None:
    """Drive one visit and report both delays."""
    with tempfile.TemporaryDirectory() as folder:
        viewer = Viewer(ViewerConfig(file=_recording(Path(folder)), port=0, precision="fp32"))
        try:
            clicks, drags = asyncio.run(_story(viewer.port))
        finally:
            viewer.stop()
        drawings = _drawings(open_recording(Path(folder) / "random.h5"))
    closed = statistics.median(drags["none"])
    rows: list[dict[str, object]] = [
        {
            "what": "click to maps, q and k held",
            "median_ms": statistics.median(clicks),
            "worst_ms": max(clicks),
            "aim_ms": AIMS["click"],
        }
    ]
    rows.insert(
        0,
        {
            "what": "drawing the maps of all 21 sites",
            "median_ms": statistics.median(drawings),
            "worst_ms": max(drawings),
            "aim_ms": AIMS["click"],
        },
    )
    for opened, took in drags.items():
        median = statistics.median(took)
        rows.append(
            {
                "what": f"drag, open: {INSPECTORS[opened]}",
                "median_ms": median,
                "times_closed": median / closed,
                "aim": AIMS["drag"],
            }
        )
    report("inside", rows)


if __name__ == "__main__":
    main()

"""What inspecting costs a visitor, server side: a click on a pixel, a drag with an inspector open, all heads' effects.

A browser that is only a websocket drives the real server with the real engine and the default weights at 240×180.
Clicks: from sending one, with q and k of the window held, until the large map of that pixel has arrived; beside it what
the server's own work on it takes alone, and the way there and back of a click that computes nothing. Drags: the
median delay of a window's view while each inspector is open, and right after it while none is, so that a busy moment
hits both. The atlas: from the first click in a window until all heads of all sites are measured, beside a plain decode.

Run: python benchmarks/inside.py [--large]    --large: clicks alone, at 1280×720 with every pixel (14,400 tokens)
"""

import asyncio
import os
import statistics
import sys
import tempfile
import time
from pathlib import Path
from typing import get_args

import numpy as np
from measure import leave, report

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from app.config import ViewerConfig
from app.engine.requests import FrameRequest, Ready
from app.html.moment import Moment
from app.main import Viewer
from app.state.view_state import ViewState
from app.views.attention.html.atlas import atlas_html
from app.views.attention.html.shelf import heads_html
from app.views.attention.html.side import side_html
from app.views.attention.html.stage import stage_html
from app.views.inspect.state import Inspector
from app.views.page import Page
from etnet.events.events import Events, Sensor
from etnet.events.open import open_recording
from etnet.events.recording import recording_of_events
from etnet.events.write import write_recording
from etnet.inspection.atlas import head_atlas
from etnet.nets.attention import AttentionProbe
from etnet.nets.runtime import contract_of
from etnet.nets.weights import load_model
from etnet.playback.playback import Playback
from etnet.windows import ByDensity, plan_windows
from tests.app.stand_ins import Browser

SENSOR, WINDOWS, POLICY = Sensor(240, 180), 60, ByDensity(0.35)
CLICKS, ROUNDS, DRAG, HERTZ = 24, 5, range(2, 14), 20
LARGE, LARGE_WINDOWS, LARGE_CLICKS = Sensor(1280, 720), 3, 12
AIMS = {"click": 60.0, "large click": 150.0, "atlas": 60.0}
PATIENCE = 300
CLOSED, MAPS = "closed", "attention workspace"
"""Closed against closed says how far two equal drags lie apart."""


def _recording(folder: Path, sensor: Sensor = SENSOR, num_windows: int = WINDOWS) -> Path:
    """Random events, in windows of .35 events per pixel."""
    rng = np.random.default_rng(0)
    num_events = int(sensor.num_pixels * 0.35 * num_windows)
    events = Events(
        rng.integers(0, sensor.width, num_events).astype(np.uint16),
        rng.integers(0, sensor.height, num_events).astype(np.uint16),
        np.sort(rng.integers(0, num_windows * 30_000, num_events)),
        rng.choice([-1, 1], num_events).astype(np.int8),
        sensor,
    )
    path = folder / "random.h5"
    write_recording(recording_of_events(events), path)
    return path


def _alone(path: Path) -> list[dict[str, object]]:
    """What the cards of a new query take to be drawn, and the atlas beside a decode; no server, nobody else."""
    recording = open_recording(path)
    windows = plan_windows(recording, POLICY)
    playback = Playback(load_model("etnet-half", "cpu", "fp32"), recording, windows)
    step = playback.at(2, AttentionProbe())
    request = FrameRequest("r", "m", "fp32", POLICY, 2, True)
    contract = contract_of(playback.model)  # pyright: ignore[reportArgumentType]
    ready = Ready(request, step.frame[0, 0].numpy(), step.attention, 0.0, True, False, False, contract, 2)
    moment = Moment("r", POLICY, 2, recording, windows)
    took, cpu = [], []
    for number in range(CLICKS + 1):
        state = ViewState("r", "m", policy=POLICY, index=2, query=(13 + 9 * number, 7 + 6 * number))
        page = Page(state, moment, ready)
        began, used = time.perf_counter(), time.thread_time()
        for draw in (stage_html, atlas_html, heads_html, side_html):
            draw(page)
        took.append((time.perf_counter() - began) * 1e3)
        cpu.append((time.thread_time() - used) * 1e3)
    began = time.perf_counter()
    *_, atlas = head_atlas(playback, 3)
    whole, done = time.perf_counter() - began, atlas.progress[1]
    decodes = []
    for index in range(4, 12):
        playback.state(index)
        began = time.perf_counter()
        playback.at(index)
        decodes.append(time.perf_counter() - began)
    return [
        {
            "what": "drawing the cards of a new query",
            "median_ms": statistics.median(took[1:]),
            "median_cpu_ms": statistics.median(cpu[1:]),
            "worst_ms": max(took[1:]),
        },
        {
            "what": f"atlas of {done} heads, library alone",
            "seconds": whole,
            "decodes": whole / statistics.median(decodes),
            "aim_s": AIMS["atlas"],
        },
    ]


class _Visit:
    """One page, and the keys that are pressed on it."""

    def __init__(self, browser: Browser) -> None:
        self.browser, self._number = browser, 0

    async def press(self, key: str, u: float = 0.0, v: float = 0.0) -> None:
        self._number += 1
        await self.browser.use(self.browser.widget("channel"), f"pick|{key}|{u:.5f}|{v:.5f}|{self._number}")

    async def until(self, text: str) -> None:
        await self.browser.until(lambda: text in self.browser.html(), PATIENCE)

    async def timed(self, text: str, key: str, u: float = 0.0, v: float = 0.0) -> float:
        """Milliseconds from a press to the first message with `text` after it."""
        began, start = time.monotonic(), len(self.browser.arrivals)
        await self.press(key, u, v)
        await self.browser.until(lambda: self._arrival(text, start) is not None, PATIENCE)
        return ((self._arrival(text, start) or 0.0) - began) * 1e3

    def _arrival(self, text: str, start: int) -> float | None:
        return next((at for at, _, said in self.browser.arrivals[start:] if text in str(said.get("updates", ""))), None)


async def _clicks(visit: _Visit, sensor: Sensor = SENSOR, num_clicks: int = CLICKS) -> list[float]:
    """Milliseconds from each click to the large map of its pixel."""
    took, rng = [], np.random.default_rng(1)
    for _ in range(num_clicks + 1):
        u, v = rng.random(2).round(5)
        asked = f'data-etv-query="{int(u * sensor.width)},{int(v * sensor.height)}"'
        took.append(await visit.timed(asked, "pixel", u, v))
        await asyncio.sleep(0.3)
    return took[1:]  # the first one waits for the decode that keeps q and k


async def _echoes(visit: _Visit) -> list[float]:
    """Milliseconds of a click that computes nothing: the floor of a click on this machine at this moment."""
    took = []
    for word, other in [("not", "none"), ("none", "not")] * (CLICKS // 2):
        took.append(await visit.timed(f"set:attention.over:{other}", f"set:attention.over:{word}"))
        await asyncio.sleep(0.3)
    return took


async def _drag(browser: Browser) -> list[float]:
    slider, took = browser.widget("Window"), []
    for index in DRAG:
        began = time.perf_counter()
        await browser.use(slider, index)
        await browser.until(lambda index=index: f"window {index} <" in browser.html(), PATIENCE)
        took.append((time.perf_counter() - began) * 1e3)
        await asyncio.sleep(max(0.0, 1 / HERTZ - (time.perf_counter() - began)))
    return took


async def _atlas(visit: _Visit) -> float:
    """Seconds from the workspace's opening to the last head, while everything else of it is computed, too."""
    began = time.monotonic()
    await visit.press("workspace:attention")
    await visit.until("atlas-progress")
    await visit.browser.until(lambda: "atlas-progress" not in visit.browser.html(), PATIENCE)
    return time.monotonic() - began


_Story = tuple[list[float], list[float], float, dict[str, list[float]], dict[str, list[float]]]


async def _story(port: int) -> _Story:
    async with Browser.open(port, tab=1) as browser:
        visit = _Visit(browser)
        await visit.until("Reconstruction of window")
        await visit.press("pixel", 0.5, 0.5)
        await browser.use(browser.widget("Window"), 12)
        await visit.until("Reconstruction of window 12")
        atlas = await _atlas(visit)
        clicks, echoes = await _clicks(visit), await _echoes(visit)
        await visit.press("workspace:inspect")
        await _drag(browser)  # not counted: the events and grids of these windows are read for the first time
        drags: dict[str, list[float]] = {name: [] for name in (*get_args(Inspector), MAPS, CLOSED)}
        floors: dict[str, list[float]] = {name: [] for name in drags}
        for _ in range(ROUNDS):
            for name, took in drags.items():
                await visit.press(f"workspace:{'attention' if name == MAPS else 'inspect'}")
                await visit.press("tab:inspect")
                await visit.press(f"set:inspect.opened:{name if name not in (MAPS, CLOSED) else 'none'}")
                if name in (MAPS, CLOSED):
                    await visit.press("tab:appearance" if name == CLOSED else "tab:attention")
                await asyncio.sleep(1.0)
                took += await _drag(browser)
                await visit.press("workspace:inspect")
                await visit.press("tab:appearance")
                await asyncio.sleep(0.5)
                floors[name] += await _drag(browser)
        return clicks, echoes, atlas, drags, floors


async def _large_story(port: int) -> tuple[list[float], list[float]]:
    """Clicks at 14,400 tokens, while the engine measures heads in between, and clicks that compute nothing."""
    async with Browser.open(port, tab=1) as browser:
        visit = _Visit(browser)
        await visit.until("Reconstruction of window")
        await visit.press("pixel", 0.5, 0.5)
        await visit.press("workspace:attention")
        await visit.until("data-etv-query=")
        return await _clicks(visit, LARGE, LARGE_CLICKS), await _echoes(visit)


def _large() -> None:
    with tempfile.TemporaryDirectory() as folder:
        path = _recording(Path(folder), LARGE, LARGE_WINDOWS)
        viewer = Viewer(ViewerConfig(file=path, port=0, precision="fp32", cache="off", downsample=1))
        try:
            clicks, echoes = asyncio.run(_large_story(viewer.port))
        finally:
            viewer.stop()
    rows: list[dict[str, object]] = [
        _of_clicks("click to map, 14,400 tokens", clicks, AIMS["large click"]),
        {"what": "click that computes nothing", "median_ms": statistics.median(echoes)},
    ]
    report("inside_large", rows)


def _of_clicks(what: str, took: list[float], aim: float) -> dict[str, object]:
    p90 = sorted(took)[int(0.9 * (len(took) - 1))]
    return {"what": what, "median_ms": statistics.median(took), "p90_ms": p90, "aim_ms": aim}


def main() -> None:
    """Drive one visit and report the delays."""
    if "--large" in sys.argv:
        _large()
        return
    with tempfile.TemporaryDirectory() as folder:
        path = _recording(Path(folder))
        viewer = Viewer(ViewerConfig(file=path, port=0, precision="fp32", cache="off"))
        try:
            clicks, echoes, atlas, drags, floors = asyncio.run(_story(viewer.port))
        finally:
            viewer.stop()
        alone = _alone(path)
    load = os.getloadavg()[0] if hasattr(os, "getloadavg") else None
    rows: list[dict[str, object]] = [
        *alone,
        {"what": "atlas in the viewer", "seconds": atlas, "aim_s": AIMS["atlas"], "load": load},
        _of_clicks("click to map, q and k held", clicks, AIMS["click"]),
        {"what": "click that computes nothing", "median_ms": statistics.median(echoes)},
    ]
    for name, took in drags.items():
        median, closed = statistics.median(took), statistics.median(floors[name])
        rows.append(
            {"what": f"drag, {name}", "median_ms": median, "closed_ms": closed, "times_closed": median / closed}
        )
    report("inside", rows)


if __name__ == "__main__":
    main()
    leave()

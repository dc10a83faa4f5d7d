"""The demo under visitors that never end: python benchmarks/soak.py [MINUTES]   (an hour is kept in the results)

The demo runs in a process of its own, with a step of the network that fails now and then. Visitors that are only
websockets come in rounds: they watch, drag, click, look inside, ask for help, send nonsense, go in mid-drag without a
word. After each round everybody has gone, and what the process holds is counted: resident memory, threads, open files,
viser's handles, sessions.
"""

import asyncio
import contextlib
import gc
import itertools
import json
import os
import random
import subprocess
import sys
import threading
import time
from pathlib import Path

from measure import report

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

VISITORS = 4
ROUND = 40.0
REST = 4.0
KEPT_FROM = 30.0
"""Minutes: what ran shorter is printed and not kept."""
WARM = 10.0
"""Minutes until the caches are as full as they get."""
EVERY = 25
"""One step in so many fails."""


# ---- the demo's own process ----


def serve() -> None:
    """Run the demo; answer each line on standard input with what the process holds."""
    from app.config import ViewerConfig
    from app.main import Viewer

    viewer = Viewer(ViewerConfig(demo=True, port=0, precision="fp32", budget=256, threads=1))
    faults = _break_now_and_then(viewer.engine)
    print(viewer.port, flush=True)
    for _ in sys.stdin:
        print(json.dumps({**_held(viewer.server), "faults": faults[0]}), flush=True)
    viewer.stop()


def _break_now_and_then(engine) -> list[int]:
    steps, faults, step = itertools.count(1), [0], engine._exact_step

    def broken(turn, stage):
        number = next(steps)
        if number % EVERY == 0:
            faults[0] += 1
            raise RuntimeError("this step was broken by the soak") if number % 2 else MemoryError()
        return step(turn, stage)

    engine._exact_step = broken
    return faults


def _held(server) -> dict[str, float]:
    import viser

    from app.session import Session

    gc.collect()
    kinds = (viser.GuiInputHandle, viser.GuiHtmlHandle, viser.GuiButtonHandle, viser.SceneNodeHandle)
    objects = gc.get_objects()
    return {
        "resident_mb": int(Path("/proc/self/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE") / 1e6,
        "threads": threading.active_count(),
        "files": len(os.listdir("/proc/self/fd")),
        "viser_handles": sum(isinstance(held, kinds) for held in objects),
        "sessions": sum(isinstance(held, Session) for held in objects),
        "visitors_now": len(server.get_clients()),
        "objects": len(objects),
    }


# ---- the visitors ----


async def _watch(browser, rng) -> None:
    await asyncio.sleep(rng.uniform(5, 30))


async def _drag(browser, rng) -> None:
    slider = browser.widget("Window")
    for index in range(rng.randrange(10, 45)):
        await browser.use(slider, index)
        await asyncio.sleep(1 / 25)


async def _click(browser, rng) -> None:
    for number in range(rng.randrange(1, 8)):
        key = rng.choice(["pixel", "pixel", "site:scale2.encoder.0.self", "head:2", "heads:close", "bin:1", "bin:"])
        await browser.use(browser.widget("channel"), f"pick|{key}|{rng.random():.4f}|{rng.random():.4f}|{number}")
        await asyncio.sleep(rng.uniform(0.1, 1.5))


async def _choose(browser, rng) -> None:
    recording = rng.choice(["bundled-astronaut", "bundled-prints", "bundled-rolling", "bundled-nothing"])
    await browser.use(browser.widget("channel"), f"pick|open:{recording}|0|0|1")
    await asyncio.sleep(rng.uniform(1, 4))


async def _look_inside(browser, rng) -> None:
    for workspace in ("attention", "inspect", "demo"):
        await browser.use(browser.widget("channel"), f"pick|workspace:{workspace}|0|0|1")
        await asyncio.sleep(rng.uniform(0.5, 3))


async def _play(browser, rng) -> None:
    labels = {props.get("label") for props in browser.widgets.values()}
    await browser.use(browser.widget("Play" if "Play" in labels else "Pause"), True)
    await asyncio.sleep(rng.uniform(2, 8))


async def _ask_help(browser, rng) -> None:
    for number in range(3):
        await browser.use(browser.widget("channel"), f"key|question|{number}")
        await asyncio.sleep(0.3)


async def _talk_nonsense(browser, rng) -> None:
    for number in range(400):
        await browser.use(browser.widget("channel"), f"pick|{rng.random()}|nan|{number}")
        await browser.use(browser.widget("Window"), rng.choice([-1, 10**12, None, "x", 3.5]))


STORIES = (_watch, _drag, _drag, _click, _click, _choose, _look_inside, _play, _ask_help, _talk_nonsense)


async def visit(port: int, rng: random.Random, ends: float) -> None:
    """One visitor: a few of the stories, then away, sometimes without a word."""
    import websockets

    from tests.app.stand_ins import Browser

    # On a machine that is busy with other things a handshake may time out: the visitor tries again.
    with contextlib.suppress(websockets.ConnectionClosed, TimeoutError):
        async with Browser.open(port, tab=rng.randrange(256), aspect=rng.choice([1.6, 1.6, 0.5])) as browser:
            await browser.until_shown('data-testid="timeline"', 60)
            for _ in range(rng.randrange(1, 6)):
                left = ends - time.monotonic()
                if left < 1:
                    break
                with contextlib.suppress(asyncio.TimeoutError):
                    await asyncio.wait_for(rng.choice(STORIES)(browser, rng), left)
            if rng.random() < 0.5:
                drag = asyncio.create_task(_drag(browser, rng))
                await asyncio.sleep(0.2)
                browser._socket.transport.abort()  # the cable is out
                drag.cancel()


async def round_of_visits(port: int, rng: random.Random) -> int:
    """`VISITORS` at once for `ROUND` seconds, each followed by another; how many came."""
    ends, came = time.monotonic() + ROUND, 0

    async def place() -> None:
        nonlocal came
        while time.monotonic() < ends - 3:
            came += 1
            await visit(port, rng, ends)

    await asyncio.gather(*(place() for _ in range(VISITORS)))
    return came


def main(minutes: float) -> None:
    """Rounds of visitors for so long, then the curve."""
    rng, began, came, rows = random.Random(7), time.monotonic(), 0, []
    server = subprocess.Popen(
        [sys.executable, __file__, "--serve"],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        text=True,
    )
    assert server.stdin is not None
    assert server.stdout is not None
    try:
        port = int(server.stdout.readline())
        while (passed := (time.monotonic() - began) / 60) < minutes:
            came += asyncio.run(round_of_visits(port, rng))
            time.sleep(REST)
            print("?", file=server.stdin, flush=True)
            held = json.loads(server.stdout.readline())
            rows.append({"minute": round(passed, 2), "visits": came, **held})
            print(rows[-1], flush=True)
    finally:
        server.stdin.close()
        server.wait(30)
    if minutes >= KEPT_FROM:
        report("soak", [growth(rows), *rows])


def growth(rows: list[dict]) -> dict[str, object]:
    """What grew after the warm-up: the slope of a line through the points, per hour, and the extremes of the counts."""
    import numpy as np

    late = [row for row in rows if row["minute"] >= WARM]
    hours = np.array([row["minute"] for row in late]) / 60
    memory = np.array([row["resident_mb"] for row in late])
    counts = {
        name: f"{min(row[name] for row in late):.0f} … {max(row[name] for row in late):.0f}"
        for name in ("threads", "files", "viser_handles", "sessions")
    }
    return {"what": "after ten minutes", "resident_mb_per_hour": float(np.polyfit(hours, memory, 1)[0]), **counts}


if __name__ == "__main__":
    if sys.argv[1:] == ["--serve"]:
        serve()
    else:
        main(float(sys.argv[1]) if len(sys.argv) > 1 else 1.0)

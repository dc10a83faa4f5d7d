"""Visitors who drag beside three who are hostile: how long drags take, whether frames stay exact, what is left behind.

    python benchmarks/hostile.py [--seconds 60] [--visitors 6] [--cold]

The viewer runs in this process, so that its frames can be compared with the sequential run, bit for bit; visitors run
in processes of their own, over loopback, and take their share of the same cores. Seconds depend on the machine; the
drags without the hostile ones, in the same run, are the floor. All windows are computed before anybody is measured:
caches that fill look like a leak. With --cold none is, and the caches hold few of them, so that frames are computed
while visitors drag and the hostile ones are at work; its figures are kept apart.
"""

from __future__ import annotations

import argparse
import asyncio
import contextlib
import gc
import hashlib
import json
import os
import random
import re
import subprocess
import sys
import threading
import time
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))
RESULTS = Path(__file__).parent / "results"
KEPT_FROM = 3600
"""Seconds: what ran shorter is printed and not kept."""
AT_HAND = 2.0
"""ms; what takes longer was computed."""
COLD_FRAMES = 1 << 20
"""Bytes of frames at hand with --cold: six of the recording's fifty."""


async def polite(port: int, tab: int, seconds: float) -> list[float]:
    """Drags to places of the recording, and measures until the last place is on the page."""
    from tests.app.stand_ins import Browser

    took, rng, ends = [], random.Random(tab), time.monotonic() + seconds
    async with Browser.open(port, tab=tab) as browser:
        await browser.until(lambda: any(w.get("label") == "Window" for w in browser.widgets.values()), 60)
        await browser.until_shown("events of window ", 60)
        slider = browser.widget("Window")
        while time.monotonic() < ends:
            target = rng.randrange(45)
            for step in range(4):
                await browser.use(slider, (target + 4 - step) % 50)
                await asyncio.sleep(0.04)
            began = time.monotonic()
            browser.arrivals = []
            await browser.use(slider, target)
            took.append(await arrival(browser, f"events of window {target}", 30) - began)
            await asyncio.sleep(rng.random())
    return took


async def arrival(browser, text: str, patience: float) -> float:
    """When an HTML element with this text came. Only what is new is read: who measures must not be the load."""
    ends = time.monotonic() + patience
    while time.monotonic() < ends:
        fresh, browser.arrivals = browser.arrivals, []
        for at, _, message in fresh:
            if re.search(rf"{text}\b", str(message.get("updates", {}).get("content", ""))):
                return at
        await asyncio.sleep(0.003)
    raise TimeoutError(f"{text} did not come in {patience} s")


async def crowd(port: int, num: int, first_tab: int, seconds: float) -> list[float]:
    """So many polite visitors."""
    took = await asyncio.gather(*(polite(port, first_tab + i, seconds) for i in range(num)), return_exceptions=True)
    for each in took:
        if not isinstance(each, list):
            print(f"a visitor failed: {each!r:.200}", file=sys.stderr)
    return [second for each in took if isinstance(each, list) for second in each]


async def flooding(port: int, seconds: float) -> None:
    """Moves a slider as fast as it can."""
    from tests.app.stand_ins import Browser

    ends = time.monotonic() + seconds
    while time.monotonic() < ends:
        with contextlib.suppress(Exception):
            async with Browser.open(port, tab=200) as browser:
                await browser.until(lambda: any(w.get("label") == "Window" for w in browser.widgets.values()), 20)
                slider = browser.widget("Window")
                while time.monotonic() < ends:
                    for i in range(200):
                        await browser.use(slider, i % 50)


async def babbling(port: int, seconds: float) -> None:
    """Sends frames that no page sends, and comes again when it is cut off."""
    from tests.app.stand_ins import Browser
    from tests.app.web.fuzz_messages import frames

    waiting, ends = frames(10**6, 5), time.monotonic() + seconds
    while time.monotonic() < ends:
        with contextlib.suppress(Exception):
            async with Browser.open(port, tab=None) as browser:
                for frame in waiting:
                    await browser._socket.send(frame)
                    await asyncio.sleep(0)


async def silent(port: int, seconds: float) -> None:
    """Opens sockets that say nothing, and asks for pages that are none."""
    import viser

    from tests.app import stand_ins

    ends = time.monotonic() + seconds
    async with contextlib.AsyncExitStack() as stack:
        while time.monotonic() < ends:
            with contextlib.suppress(Exception):
                await stack.enter_async_context(
                    stand_ins.connect(
                        f"ws://127.0.0.1:{port}", subprotocols=[f"viser-v{viser.__version__}"], open_timeout=2
                    )
                )
            with contextlib.suppress(Exception):
                reader, writer = await asyncio.open_connection("127.0.0.1", port)
                writer.write(b"GET /" + b"x" * 9000 + b" HTTP/1.1\r\n\r\n")
                await reader.read(100)
                writer.close()
            await asyncio.sleep(0.02)


CROWD = 9
"""Visitors that one process plays."""
ROLES = {"crowd": crowd, "flooding": flooding, "babbling": babbling, "silent": silent}


def play(role: str, *arguments: float) -> None:
    """What one process plays. Each hostile one has an address of its own, as it would have in a network."""
    from functools import partial

    from tests.app import stand_ins

    own = f"127.0.0.{2 + list(ROLES).index(role)}"
    stand_ins.connect = partial(stand_ins.connect, local_addr=(own, 0))
    *whole, seconds = arguments
    print(json.dumps(asyncio.run(ROLES[role](*map(int, whole), seconds))))


def started(role: str, *arguments: float) -> subprocess.Popen[str]:
    """A process that plays a visitor."""
    command = [sys.executable, __file__, "--role", role, *map(str, arguments)]
    return subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True)


def resident() -> float:
    """Megabytes of this process."""
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * 4096 / 1e6


def drags(port: int, visitors: int, seconds: float, hostile: tuple[str, ...], first_tab: int) -> list[float]:
    """Seconds of every drag of so many visitors beside these."""
    others = [started(role, port, seconds + 5) for role in hostile]
    parts = [range(visitors)[first : first + CROWD] for first in range(0, visitors, CROWD)]
    people = [started("crowd", port, len(part), first_tab + part.start, seconds) for part in parts]
    took = [second for person in people for second in json.loads(person.communicate()[0] or "[]")]
    for other in others:
        other.kill()
        other.communicate()
    return took


def main() -> None:
    """Measure and write the figures."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seconds", type=float, default=60)
    parser.add_argument("--visitors", type=int, default=6)
    parser.add_argument("--model", default="etnet-half")
    parser.add_argument("--cold", action="store_true", help="compute frames while visitors drag")
    parser.add_argument("--role", nargs="+")
    told = parser.parse_args()
    if told.role:
        play(told.role[0], *map(float, told.role[1:]))
        return

    from app.engine.published import RecentFrames
    from app.engine.requests import Ready
    from app.main import Viewer
    from app.web.bounded_log import bound_logs

    bound_logs()
    load = os.getloadavg()[0]
    viewer = Viewer(config_of(told.model, told.cold))
    if told.cold:
        viewer.engine._recent = RecentFrames(COLD_FRAMES)
    frames: dict[tuple[str, str, str, object, int], set[str]] = {}
    computed: list[bool] = []
    ask = viewer.engine.request

    def request(visitor, wanted, deliver):
        def heard(reply):
            if isinstance(reply, Ready) and reply.is_exact and reply.request.is_original:
                asked = reply.request
                key = asked.recording_id, asked.model_id, asked.precision, asked.policy, asked.index
                frames.setdefault(key, set()).add(hashlib.sha256(np.ascontiguousarray(reply.frame)).hexdigest())
                computed.append(reply.milliseconds > AT_HAND)
            deliver(reply)

        ask(visitor, wanted, heard)

    viewer.engine.request = request  # pyright: ignore[reportAttributeAccessIssue]
    if not told.cold:
        told_of("computing all windows")
        fill(viewer)
    drags(viewer.port, told.visitors, 5, ("flooding",), 1)
    told_of("drags without hostile visitors")
    alone = drags(viewer.port, told.visitors, min(told.seconds / 2, 120), (), 10)
    rest()
    before = resident(), threading.active_count()
    computed.clear()
    told_of("drags beside hostile visitors")
    beside = drags(viewer.port, told.visitors, told.seconds, ("flooding", "babbling", "silent"), 50)
    num_computed = sum(computed)
    rest()
    after = resident(), threading.active_count()
    told_of("the sequential run")
    viewer.stop()
    different = compared(viewer, frames)
    figures = {
        "visitors": told.visitors, "seconds": told.seconds,
        "drags alone": len(alone), "p90 alone, ms": p90(alone),
        "drags beside three hostile": len(beside), "median beside, ms": round(1e3 * float(np.median(beside))),
        "p90 beside, ms": p90(beside), "p90 beside ÷ alone": round(p90(beside) / max(p90(alone), 1), 2),
        "slowest, ms": round(1e3 * max(beside)),
        "MB before": round(before[0]), "MB after": round(after[0]),
        "threads before": before[1], "threads after": after[1],
        "exact frames compared": len(frames), "different": different,
        "exact frames computed beside the hostile": num_computed,
        "cores": os.cpu_count(),
        "others' load at the beginning": round(load, 1),
    }  # fmt: skip
    if told.seconds >= KEPT_FROM:
        RESULTS.mkdir(exist_ok=True)
        (RESULTS / ("hostile_cold.json" if told.cold else "hostile.json")).write_text(
            json.dumps(figures, indent=1) + "\n"
        )
    print(json.dumps(figures, indent=1))


def config_of(model: str, is_cold: bool):
    """The viewer's; a cold one finds nothing on the disk and holds few states."""
    from app.config import MIN_BUDGET, ViewerConfig

    if is_cold:
        return ViewerConfig(port=0, model=model, threads=1, cache="off", budget=MIN_BUDGET)
    return ViewerConfig(port=0, model=model, threads=1)


def told_of(what: str) -> None:
    """Where it is."""
    print(f"{time.strftime('%H:%M:%S')} {what}", file=sys.stderr, flush=True)


def p90(took: list[float]) -> int:
    """Milliseconds."""
    return round(1e3 * float(np.quantile(took, 0.9)))


def fill(viewer) -> None:
    """Compute every window of what a page shows first."""
    from app.catalogue.recordings import suited_policy
    from app.engine.requests import Failed, FrameRequest, Ready
    from etnet.windows import plan_windows

    answered = threading.Semaphore(0)

    def hear(reply) -> None:
        if isinstance(reply, Failed) or (isinstance(reply, Ready) and not reply.is_approximate):
            answered.release()

    shown = viewer.default
    recording = viewer.catalogue.open(shown.recording_id)
    policy = suited_policy(recording)
    for index in range(len(plan_windows(recording, policy))):
        asked = FrameRequest(shown.recording_id, shown.model_id, shown.precision, policy, index)
        viewer.engine.request("filling", asked, hear)
        answered.acquire()
    viewer.engine.drop("filling")


def rest() -> None:
    """Until everybody's threads have ended and memory was swept."""
    time.sleep(30)
    gc.collect()


def compared(viewer, frames) -> int:
    """How many exact frames are not, bit for bit, those of the sequential run of the same network and runtime."""
    from etnet.reconstruction import reconstruct

    different, runs = 0, {key[:4] for key in frames}
    for run in runs:
        recording_id, model_id, precision, policy = run
        model, _ = viewer.engine._playbacks.model(model_id, precision)
        print(f"{model_id}, {precision}: {getattr(model, 'runtime', None)}", file=sys.stderr)
        for window, step in reconstruct(model, viewer.catalogue.open(recording_id), policy):
            shown = frames.get((*run, window.index), set())
            truth = hashlib.sha256(np.ascontiguousarray(step.frame[0, 0].float().numpy())).hexdigest()
            different += len(shown - {truth})
    return different


if __name__ == "__main__":
    main()

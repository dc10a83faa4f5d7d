"""The demo under visitors that never end: python benchmarks/soak.py [MINUTES]   (20 and more are kept in the results)

The demo runs in a process of its own, with a step of the network that fails now and then. Visitors that are only
websockets come once a minute, a few at once and one after the other: they watch, drag, click, look inside, ask for
help, send nonsense, go in mid-drag without a word. Then everybody has gone and the server has swept up, and what the
process holds is counted: resident memory, threads, open files, viser's handles, sessions. The rest of the minute is
rest, so that it runs beside other work. The curve is written as it grows: a run that is ended leaves what it has.

Caches that fill look like a leak. Their caps are set low here and they are filled before anybody comes. Their bytes are
counted too, and so is what the allocator has handed out beyond them: that is where a leak would show.
"""

import asyncio
import contextlib
import ctypes
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

from measure import keep

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

VISITS = 12
"""In a round."""
AT_ONCE = 3
LONGEST = 12.0
"""Seconds of a visit."""
ROUND = 60.0
"""Seconds from one round to the next, where it was over by then."""
REST = 24.0
"""Seconds after which those who have left are gone for good, and their memory was given back."""
KEPT_FROM = 20.0
"""Minutes: what ran shorter is printed and not kept."""
WARM = 10.0
"""Minutes that are not counted: code is loaded and buffers find their size."""
FILLED = 26
"""Windows of each recording that are asked for before anybody comes: more than the caches hold."""
CACHES = {"states": 96, "pictures": 8, "arrays": 32, "frames": 4}
"""MB; the viewer's own caps are 1,024 (--budget), 64, 96 and 32."""
EVERY = 25
"""One step in so many fails."""


# ---- the demo's own process ----


def serve() -> None:
    """Run the demo; answer each line on standard input with what the process holds."""
    from app.config import ViewerConfig
    from app.main import Viewer

    viewer = Viewer(ViewerConfig(demo=True, port=0, precision="fp32", budget=CACHES["states"], threads=1))
    _lower_caps(viewer.engine)
    _fill(viewer)
    faults = _break_now_and_then(viewer.engine)
    print(viewer.port, flush=True)
    for _ in sys.stdin:
        print(json.dumps({**_held(viewer), "faults": faults[0]}), flush=True)
    viewer.stop()


def _lower_caps(engine) -> None:
    from app.html.moment import ARRAYS, PICTURES

    PICTURES._budget_bytes, ARRAYS._budget_bytes = CACHES["pictures"] << 20, CACHES["arrays"] << 20
    engine._recent._held.set_budget(CACHES["frames"] << 20)


def _fill(viewer) -> None:
    """Show so much of every recording that the playbacks hold as many states and frames as they may."""
    from app.catalogue.recordings import suited_policy
    from app.engine.requests import Failed, FrameRequest, Ready
    from etnet.windows import plan_windows

    answered = threading.Semaphore(0)

    def hear(reply) -> None:
        if isinstance(reply, Failed) or (isinstance(reply, Ready) and not reply.is_approximate):
            answered.release()

    model = viewer.catalogue.models()[0].id
    for entry in viewer.catalogue.entries():
        recording = viewer.catalogue.open(entry.id)
        policy = suited_policy(recording)
        for index in range(min(FILLED, len(plan_windows(recording, policy)))):
            viewer.engine.request("filling", FrameRequest(entry.id, model, "fp32", policy, index), hear)
            answered.acquire()
    viewer.engine.drop("filling")


def _break_now_and_then(engine) -> list[int]:
    steps, faults, step = itertools.count(1), [0], engine._exact_step

    def broken(turn, loaded):
        number = next(steps)
        if number % EVERY == 0:
            faults[0] += 1
            raise RuntimeError("this step was broken by the soak") if number % 2 else MemoryError()
        return step(turn, loaded)

    engine._exact_step = broken
    return faults


def _held(viewer) -> dict[str, float]:
    import viser

    from app.session.session import Session

    resident = int(Path("/proc/self/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE") / 1e6
    gc.collect()
    handed_out, caches = _handed_out(), _cached_bytes(viewer.engine) / 1e6
    # The type, not isinstance: asked for its class, a lazy object of some library would load what it stands for.
    kinds = (viser.GuiInputHandle, viser.GuiHtmlHandle, viser.GuiButtonHandle, viser.SceneNodeHandle)
    objects = [type(held) for held in gc.get_objects()]
    return {
        "resident_mb": resident,
        "caches_mb": caches,
        "beyond_caches_mb": handed_out - caches,
        "threads": len(os.listdir("/proc/self/task")),
        "files": len(os.listdir("/proc/self/fd")),
        "viser_handles": sum(issubclass(held, kinds) for held in objects),
        "sessions": sum(issubclass(held, Session) for held in objects),
        "visitors_now": len(viewer.server.get_clients()),
        "objects": len(objects),
        "cpu_seconds": round(time.process_time(), 1),
    }


def _handed_out() -> float:
    """MB that glibc has handed out and not got back, in all arenas and in mappings of their own."""

    class Mallinfo(ctypes.Structure):
        # arena, ordblks, smblks, hblks, hblkhd, usmblks, fsmblks, uordblks, fordblks, keepcost
        _fields_ = [(name, ctypes.c_size_t) for name in ("a", "b", "c", "d", "mapped", "e", "f", "used", "free", "g")]

    asked = ctypes.CDLL(None).mallinfo2
    asked.restype = Mallinfo
    told = asked()
    return (told.used + told.mapped) / 1e6


def _cached_bytes(engine) -> int:
    """Bytes of all caches. Frames at hand are mostly those of a playback, so each buffer is counted once."""
    from app.html.moment import ARRAYS, PICTURES

    loadeds = [loaded.playback for loaded in tuple(engine._playbacks._stages.values())]
    frames = {ready.frame.ctypes.data: ready.frame.nbytes for ready in engine._recent.all()}
    for playback in loadeds:
        frames |= {frame.data_ptr(): frame.nbytes for frame in playback._frames.values()}
    states = sum(playback._states.nbytes for playback in loadeds)
    held = PICTURES.nbytes + ARRAYS.nbytes + engine._playbacks._scores.nbytes + engine._jobs._kept.nbytes
    held += engine._thumbnails.nbytes
    return held + states + sum(frames.values()) + engine._playbacks._attention.nbytes


# ---- the visitors ----


async def _watch(browser, rng) -> None:
    await asyncio.sleep(rng.uniform(2, 8))


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
    await browser.use(browser.widget("channel"), f"pick|demo:play|0|0|{rng.random()}")
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


async def visit(port: int, rng: random.Random) -> bool:
    """One visitor: a few of the stories, then away, sometimes without a word. Whether he was shown anything."""
    import websockets

    from tests.app.stand_ins import Browser

    ends, was_shown = time.monotonic() + LONGEST, False
    # On a machine that is busy with other things a page may take too long.
    with contextlib.suppress(websockets.ConnectionClosed, TimeoutError, AssertionError):
        async with Browser.open(port, tab=rng.randrange(256), aspect=rng.choice([1.6, 1.6, 0.5])) as browser:
            await browser.until_shown('data-testid="timeline"', 60)
            was_shown = True
            for _ in range(rng.randrange(1, 5)):
                left = max(ends - time.monotonic(), 0.1)
                with contextlib.suppress(asyncio.TimeoutError):
                    await asyncio.wait_for(rng.choice(STORIES)(browser, rng), left)
            if rng.random() < 0.5:
                drag = asyncio.create_task(_drag(browser, rng))
                await asyncio.sleep(0.2)
                browser._socket.transport.abort()  # the cable is out
                drag.cancel()
    return was_shown


async def round_of_visits(port: int, rng: random.Random) -> int:
    """`VISITS` visitors, `AT_ONCE` at a time; how many of them were shown something."""
    waiting, shown = iter(range(VISITS)), []

    async def place() -> None:
        for _ in waiting:
            shown.append(await visit(port, rng))

    await asyncio.gather(*(place() for _ in range(AT_ONCE)))
    return sum(shown)


def main(minutes: float) -> None:
    """Rounds of visitors for so long; the curve is printed and kept as it grows."""
    rng, came, shown, rows = random.Random(7), 0, 0, []
    server = subprocess.Popen(
        [sys.executable, __file__, "--serve"],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        text=True,
        env={**os.environ, "OMP_NUM_THREADS": "1"},
    )
    assert server.stdin is not None
    assert server.stdout is not None
    try:
        port, began = int(server.stdout.readline()), time.monotonic()
        while (passed := (time.monotonic() - began) / 60) < minutes:
            came, shown = came + VISITS, shown + asyncio.run(round_of_visits(port, rng))
            time.sleep(max(REST, began + passed * 60 + ROUND - time.monotonic()))
            print("?", file=server.stdin, flush=True)
            held = json.loads(server.stdout.readline())
            rows.append({"minute": round((time.monotonic() - began) / 60, 2), "visits": came, "shown": shown, **held})
            print(rows[-1], flush=True)
            if minutes >= KEPT_FROM:
                keep("soak", [growth(rows), *rows])
    finally:
        server.stdin.close()
        server.wait(60)
    print(growth(rows))


def growth(rows: list[dict]) -> dict[str, object]:
    """What grew after the warm-up, per hour, and the extremes of the counts."""
    late = [row for row in rows if row["minute"] >= WARM]
    if len(late) < 3:
        return {"what": f"no line yet: {len(late)} countings after {WARM:.0f} minutes"}
    counts = {
        name: f"{min(row[name] for row in late):.0f} … {max(row[name] for row in late):.0f}"
        for name in ("resident_mb", "caches_mb", "beyond_caches_mb", "threads", "files", "viser_handles", "sessions")
    }
    grew = {
        f"{name}_per_hour": slope(late, name) for name in ("resident_mb", "caches_mb", "beyond_caches_mb", "objects")
    }
    visits = late[-1]["visits"] - late[0]["visits"]
    return {"what": f"after {WARM:.0f} minutes", "countings": len(late), "visits": visits, **grew, **counts}


def slope(rows: list[dict], name: str, at_equal: str | None = None) -> str:
    """The least-squares rise per hour, ± its standard error.

    `at_equal`: rows are compared with those alone in which this count is the same; each count has a height of its own.
    """
    import numpy as np

    hours = np.array([row["minute"] / 60 for row in rows])
    counts = np.array([0 if at_equal is None else row[at_equal] for row in rows])
    given = np.stack([hours, *(counts == count for count in np.unique(counts))], axis=1).astype(float)
    values = np.array([row[name] for row in rows])
    fitted = np.linalg.lstsq(given, values, rcond=None)[0]
    spread = ((values - given @ fitted) ** 2).sum() / max(len(rows) - given.shape[1], 1)
    error = np.sqrt(spread * np.linalg.inv(given.T @ given)[0, 0])
    return f"{fitted[0]:.1f} ± {error:.1f}"


if __name__ == "__main__":
    if sys.argv[1:] == ["--serve"]:
        serve()
    else:
        main(float(sys.argv[1]) if len(sys.argv) > 1 else 1.0)

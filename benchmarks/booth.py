"""An hour at a booth: python benchmarks/booth.py [--minutes 60] [--visitors 20]   (20 minutes and more are kept)

The demo runs in a process of its own with uploads allowed, the caches of `soak.py`, a network that fails now and then,
and pages that are reset after a few seconds without a touch. In every round so many visitors, who are only websockets,
come at once and do what a public does: turn the camera, drag, touch, open every menu and command, set every widget,
guess, take a page home and fetch it, of the mirror too, look into the mirror, hand over a recording or a video and
open it, break off in the middle of a file, talk nonsense, fall asleep, pull the cable. Then everybody has gone and the
server has swept up, and what is left is counted: memory beyond the caches' own bytes, threads, open files, sessions,
and everything that was a visitor's: files in the uploads' folder, private recordings, mirrors, jobs. In the end one
more visitor comes and must see images.

An open recording is a cache as well: up to six are kept open, and each has four megabytes of HDF5's chunks and more.
How many are open goes up and down with what visitors hand over, so memory is read at an equal number of open files.

Exit code 1 where something of a visitor is left, the show does not run, memory beyond the caches rises by more than
`MOST_GROWTH` an hour (told once there are enough countings after the warm-up), or, in a run that is kept, something
that visitors do never came to its end.
"""

from __future__ import annotations

import argparse
import asyncio
import contextlib
import functools
import http.client
import json
import os
import random
import re
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import soak
from booth_demo import IDLE, serve
from measure import keep

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

LONGEST = 90.0
"""Seconds of a visit: a page to take home is waited for, in which twenty visitors keep the network busy."""
SWEPT_WITHIN = 60.0
"""Seconds that a busy server may take after a rest to let go of visitors who have gone."""
MOST_GROWTH = 5.0
"""MB an hour beyond the caches."""
FEWEST_COUNTINGS = 10
"""A line at an equal number of open files has a height for each number."""
LEFT = ("upload_files", "upload_desks", "private_recordings", "mirrors", "films", "jobs", "sessions", "visitors_now")
"""Countings that must be 0 when everybody has gone."""
NUM_EVENTS = 20_000


# ---- what visitors do ----


async def _turn(browser, rng, port) -> None:
    for _ in range(rng.randrange(5, 40)):
        await browser.turn(rng.choice([0.5, 1.0, 1.6]), [rng.uniform(-6, 6) for _ in range(3)])
        await asyncio.sleep(0.05)


async def _open_menus(browser, rng, port) -> None:
    for uuid in {message["uuid"] for _, kind, message in list(browser.arrivals) if kind == "RegisterCommandMessage"}:
        await browser._send({"type": "CommandTriggerMessage", "uuid": uuid})
        await asyncio.sleep(0.1)


async def _set_widgets(browser, rng, port) -> None:
    for uuid, props in list(browser.widgets.items()):
        value = props.get("value")
        if isinstance(value, bool):
            await browser.use(uuid, rng.random() < 0.5)
        elif isinstance(value, int | float):
            await browser.use(uuid, rng.randrange(100))
        elif isinstance(value, str) and props.get("options"):
            await browser.use(uuid, rng.choice(props["options"]))
        await asyncio.sleep(0.05)


async def _press(browser, *keys: str, pause: float = 0.5) -> None:
    for key in keys:
        await browser.use(browser.widget("channel"), f"pick|{key}|0.5|0.5|{random.random()}")
        await asyncio.sleep(pause)


async def _guess(browser, rng, port) -> None:
    await _press(browser, "demo:guess", "demo:reveal", "demo:cloud", "demo:spot", "demo:play", pause=1.0)


async def _take_home(browser, rng, port) -> None:
    await browser.until(lambda: bool(_images(browser)), 30)
    await _press(browser, "demo:home")
    await _fetch_page(browser, port)


async def _fetch_page(browser, port: int) -> None:
    await browser.until(lambda: 'href="/home/' in browser.html(), 80)
    path = re.findall(r'href="(/home/[^"]+)"', browser.html())[-1]
    await asyncio.to_thread(_fetch, port, path)
    await _press(browser, "demo:close")


def _fetch(port: int, path: str) -> None:
    connection = http.client.HTTPConnection("127.0.0.1", port, timeout=15)
    connection.request("GET", path)
    connection.getresponse().read()
    connection.close()


async def _look_into_the_mirror(browser, rng, port) -> None:
    await _show_face(browser, rng, port, rng.randrange(20, 90))


async def _take_the_mirror_home(browser, rng, port) -> None:
    if await _show_face(browser, rng, port, 90, takes_home=True):
        await _fetch_page(browser, port)


async def _show_face(browser, rng, port: int, num_frames: int, takes_home: bool = False) -> bool:
    """Look into the mirror for so many pictures; whether it was free."""
    import numpy as np

    await _press(browser, "demo:mirror")
    await browser.until(lambda: "data-etv-camera=" in browser.html(), 10)
    ticket = re.findall(r'data-etv-camera="([^"]+)"', browser.html())[-1]
    async with _door(port, "/camera") as socket:
        await socket.send(json.dumps({"ticket": ticket}))
        size = json.loads(await socket.recv()).get("go")
        if size is None:
            return False  # others look into it
        y, x = np.mgrid[: size[1], : size[0]]
        for number in range(num_frames):
            grey = 128 + 90 * np.sin((x - 4 * number) / 9) * np.cos((y + number) / 11)
            await socket.send(grey.astype(np.uint8).tobytes())
            await socket.recv()
            if number % 20 == 0:
                await socket.send(json.dumps({"contrast": rng.random(), "noise": 3 * rng.random()}))
            if takes_home and number == num_frames - 10:
                await _press(browser, "demo:home", pause=0.0)
            await asyncio.sleep(1 / 15)
    return True


async def _hand_over(browser, rng, port) -> None:
    if await _upload(browser, rng, port, "mine.npz", _recording(rng.randrange(3))):
        await asyncio.sleep(rng.uniform(1, 6))  # it is opened, and watched
        await _press(browser, "demo:spot", "demo:play", pause=1.0)


async def _hand_over_video(browser, rng, port) -> None:
    before = _images(browser)
    if await _upload(browser, rng, port, "mine.mp4", _video(rng.randrange(3))):
        await browser.until(lambda: "The video becomes dots" in browser.html() or _images(browser) != before, 30)
        await asyncio.sleep(rng.uniform(1, 6))
        await _press(browser, "demo:spot", "demo:play", pause=1.0)


def _images(browser) -> list[str]:
    return re.findall(r"Reconstruction of window \d+", browser.html())


async def _upload(browser, rng, port: int, name: str, content: bytes) -> bool:
    """Hand a file over, or break off in the middle of it; whether all of it came."""
    await _press(browser, "demo:mirror")
    await browser.until(lambda: "data-etv-ticket=" in browser.html(), 10)
    ticket = re.findall(r'data-etv-ticket="([^"]+)"', browser.html())[-1]
    async with _door(port, "/upload") as socket:
        await socket.send(json.dumps({"ticket": ticket, "name": name, "size": len(content)}))
        piece = json.loads(await socket.recv()).get("go")
        if piece is None:
            return False
        stops = rng.random() < 0.3
        for start in range(0, len(content) // 2 if stops else len(content), piece):
            await socket.send(content[start : start + piece])
            await socket.recv()
        if stops:
            socket.transport.abort()
            return False
        await socket.send("")
        await socket.recv()
    return True


def _door(port: int, path: str):
    from websockets.asyncio.client import connect

    return connect(f"ws://127.0.0.1:{port}{path}", compression=None, max_size=None)


@functools.cache
def _recording(seed: int) -> bytes:
    """A visitor's own recording, as a file."""
    import io

    import numpy as np

    rng, content = np.random.default_rng(seed), io.BytesIO()
    at = np.sort(rng.integers(0, 1_000_000, NUM_EVENTS))
    x = (at // 9000 + rng.integers(0, 12, NUM_EVENTS)) % 120
    np.savez(content, x=x, y=rng.integers(0, 90, NUM_EVENTS), t=at, p=rng.integers(0, 2, NUM_EVENTS))
    return content.getvalue()


@functools.cache
def _video(seed: int) -> bytes:
    """A visitor's own video of a second and a half: waves that drift."""
    from tests.simulation.films import drifting, write_film

    with tempfile.TemporaryDirectory() as folder:
        film = drifting(45, 1.0 + 0.5 * seed, (160, 120))
        return write_film(Path(folder) / "mine.mp4", film).read_bytes()


async def _fall_asleep(browser, rng, port) -> None:
    await asyncio.sleep(IDLE + rng.uniform(1, 5))


async def _as_in_the_soak(browser, rng, port) -> None:
    await rng.choice(soak.STORIES)(browser, rng)


STORIES = (
    _turn, _open_menus, _set_widgets, _guess, _take_home, _take_home, _look_into_the_mirror, _take_the_mirror_home,
    _hand_over, _hand_over_video, _fall_asleep, _as_in_the_soak, _as_in_the_soak, _as_in_the_soak,
)  # fmt: skip


async def visit(port: int, rng: random.Random, done: dict[str, int]) -> bool:
    """One visitor; whether they were shown anything. What they did is counted in `done`."""
    import websockets

    from tests.app.stand_ins import Browser

    ends, was_shown = time.monotonic() + LONGEST, False
    # A server that is busy with twenty answers late, and may refuse a camera or a file: a visitor goes on.
    gone = (websockets.ConnectionClosed, TimeoutError, AssertionError, StopIteration, OSError)
    with contextlib.suppress(*gone):
        async with Browser.open(port, tab=rng.randrange(256), aspect=rng.choice([1.6, 1.6, 0.5])) as browser:
            await browser.until_shown('data-testid="demo"', 60)
            was_shown = True
            while time.monotonic() < ends:
                story = rng.choice(STORIES)
                with contextlib.suppress(*gone):
                    await asyncio.wait_for(story(browser, rng, port), max(ends - time.monotonic(), 0.1))
                    done[story.__name__.strip("_")] = done.get(story.__name__.strip("_"), 0) + 1
                if browser._socket.close_code is not None:
                    break
            if rng.random() < 0.5:
                browser._socket.transport.abort()  # the cable is out
    return was_shown


async def round_of_visits(port: int, num: int, rng: random.Random, done: dict[str, int]) -> int:
    """So many visitors at once; how many of them were shown something."""
    return sum(await asyncio.gather(*(visit(port, random.Random(rng.random()), done) for _ in range(num))))


async def show_runs(port: int) -> bool:
    """Whether one more visitor sees an image, and another one after it."""
    from tests.app.stand_ins import Browser

    def images(browser) -> set[str]:
        return set(re.findall(r"Reconstruction of window \d+", browser.html()))

    async with Browser.open(port, tab=1) as browser:
        with contextlib.suppress(AssertionError):
            await browser.until(lambda: bool(images(browser)), 60)
            first = images(browser)
            await browser.until(lambda: images(browser) != first, 60)
            return True
    return False


def main() -> int:
    """Rounds of visitors for so long; the curve is printed and kept as it grows."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--minutes", type=float, default=60.0)
    parser.add_argument("--visitors", type=int, default=20)
    parser.add_argument("--serve", action="store_true", help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.serve:
        serve()
        return 0
    rng, done, rows, came, shown = random.Random(7), {}, [], 0, 0
    with tempfile.TemporaryDirectory() as scratch, (Path(scratch) / "log").open("w") as log:
        environment = {**os.environ, "OMP_NUM_THREADS": "1", "ETNET_CACHE": f"{scratch}/cache", "TMPDIR": scratch}
        server = subprocess.Popen(
            [sys.executable, __file__, "--serve"],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=log,
            text=True,
            env=environment,
        )
        assert server.stdin is not None
        assert server.stdout is not None
        try:
            port, began = int(server.stdout.readline()), time.monotonic()
            while (time.monotonic() - began) / 60 < given.minutes:
                came += given.visitors
                shown += asyncio.run(round_of_visits(port, given.visitors, rng, done))
                time.sleep(soak.REST)
                held = _swept(server, Path(log.name))
                minute = round((time.monotonic() - began) / 60, 2)
                rows.append({"minute": minute, "visits": came, "shown": shown, **held})
                print(rows[-1], flush=True)
                if given.minutes >= soak.KEPT_FROM:
                    keep("booth", [verdict(rows, done), *rows])
            runs = asyncio.run(show_runs(port))
        finally:
            server.stdin.close()
            server.wait(60)
        files = sorted(str(path.relative_to(scratch)) for path in Path(scratch).glob("etnet-*"))
    said = {**verdict(rows, done), "show_runs": runs, "files_after_the_end": files}
    print(json.dumps(said, indent=1))
    if given.minutes >= soak.KEPT_FROM:
        keep("booth", [said, *rows])
    is_short = given.minutes < soak.KEPT_FROM  # then not every story has been told
    did_all = is_short or not said["never_done"]
    return 0 if runs and did_all and not files and not said["left_of_visitors"] and said["is_flat"] is not False else 1


def _swept(server: subprocess.Popen[str], log: Path) -> dict:
    """What the server holds once the visitors' sessions have ended, or have had long enough to."""
    assert server.stdin is not None
    ends = time.monotonic() + SWEPT_WITHIN
    while True:
        print("?", file=server.stdin, flush=True)
        held = _answer(server, log)
        if not held["sessions"] or time.monotonic() > ends:
            return held
        time.sleep(5)


def _answer(server: subprocess.Popen[str], log: Path) -> dict:
    """What the server holds; where it has ended, what it said last."""
    assert server.stdout is not None
    for line in server.stdout:
        if line.startswith("{"):  # libraries print, too
            return json.loads(line)
    sys.exit(f"the demo has ended:\n{log.read_text()[-3000:]}")


def verdict(rows: list[dict], done: dict[str, int]) -> dict:
    """What grew, what was left, what visitors had done, and which of the stories never came to its end."""
    late = [row for row in rows if row["minute"] >= soak.WARM]
    rise = soak.slope(late, "beyond_caches_mb", "files") if len(late) >= FEWEST_COUNTINGS else None
    return {
        **soak.growth(rows),
        "beyond_caches_mb_per_hour_at_equal_files": rise,
        "left_of_visitors": {name: [row[name] for row in rows] for name in LEFT if any(row[name] for row in rows)},
        "is_flat": None if rise is None else float(rise.split()[0]) <= MOST_GROWTH,
        "done": dict(sorted(done.items())),
        "never_done": sorted({story.__name__.strip("_") for story in STORIES} - done.keys()),
    }


if __name__ == "__main__":
    sys.exit(main())

"""What a person waits for after the command: page served, first events and first reconstruction on the page.

Each row is a process of its own: the viewer, and a browser that is only a websocket and comes as soon as the port
answers. "again" is a recording that was open before (the cache on disk is there), "without" has no cache. Beside them
stands what no start can be faster than here and now: an interpreter that does nothing, and one that imports torch.

Run: python benchmarks/start.py [--runs N]
"""

import argparse
import asyncio
import os
import re
import socket
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from measure import report

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from tests.app.stand_ins import Browser

AIM = {"served": None, "events": 1.2, "reconstruction": 3.0}
AIM_AGAIN = {"served": None, "events": 1.2, "reconstruction": 1.5}
PATIENCE = 120


def _seconds(program: str) -> float:
    began = time.perf_counter()
    subprocess.run([sys.executable, "-c", program], check=True)
    return time.perf_counter() - began


def _free_port() -> int:
    with socket.socket() as held:
        held.bind(("127.0.0.1", 0))
        return int(held.getsockname()[1])


async def _answers(port: int) -> None:
    while True:
        try:
            socket.create_connection(("127.0.0.1", port), 0.2).close()
            return
        except OSError:
            await asyncio.sleep(0.01)


async def _start(arguments: list[str], cache: str) -> dict[str, float]:
    """Seconds from the command to each of the three."""
    port, seen = _free_port(), {}
    command = [sys.executable, "-m", "app", "--port", str(port), *arguments]
    environment = {**os.environ, "ETNET_CACHE": cache}
    began = time.perf_counter()
    running = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, env=environment)
    try:
        await _answers(port)
        seen["served"] = time.perf_counter() - began
        async with Browser.open(port, tab=1) as browser:
            for what, pattern in (("events", r"\d events of window"), ("reconstruction", r"Reconstruction of window")):
                while re.search(pattern, browser.html()) is None:
                    if time.perf_counter() - began > PATIENCE:
                        raise TimeoutError(what)
                    await asyncio.sleep(0.005)
                seen[what] = time.perf_counter() - began
            await asyncio.sleep(2)  # what was computed is written
    finally:
        running.terminate()
        running.wait()
    return seen


def main() -> None:
    """Start again and again, in turns, so that a busy moment hits all rows."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--runs", type=int, default=5)
    runs = parser.parse_args().runs
    floors: dict[str, list[float]] = {"nothing": [], "import torch": []}
    seen: dict[str, list[dict[str, float]]] = {"without": [], "again": []}
    with tempfile.TemporaryDirectory() as cache:
        asyncio.run(_start([], cache))
        for _ in range(runs):
            floors["nothing"].append(_seconds("pass"))
            floors["import torch"].append(_seconds("import torch"))
            seen["without"].append(asyncio.run(_start(["--cache", "off"], cache)))
            seen["again"].append(asyncio.run(_start([], cache)))
    load = os.getloadavg()[0] if hasattr(os, "getloadavg") else None
    torch_seconds = statistics.median(floors["import torch"])
    rows: list[dict[str, object]] = [
        {"start": name, "median_s": statistics.median(values), "best_s": min(values), "load": load}
        for name, values in floors.items()
    ]
    for start, aims in (("without", AIM), ("again", AIM_AGAIN)):
        for what, aim in aims.items():
            values = [run[what] for run in seen[start]]
            median = statistics.median(values)
            rows.append(
                {
                    "start": start,
                    "what": what,
                    "median_s": median,
                    "best_s": min(values),
                    "aim_s": aim,
                    "to_import_torch": median / torch_seconds,
                }
            )
    report("start", rows)


if __name__ == "__main__":
    main()

"""What every benchmark shares: best-of timing, the machine, results as JSON beside the scripts."""

import json
import os
import platform
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import NoReturn

RESULTS = Path(__file__).resolve().parent / "results"


def best_of(call: Callable[[], object], runs: int = 5) -> float:
    """Seconds of the fastest of `runs` calls, after one that is not counted."""
    call()
    seconds = []
    for _ in range(runs):
        start = time.perf_counter()
        call()
        seconds.append(time.perf_counter() - start)
    return min(seconds)


def best_of_each(
    calls: dict[str, Callable[[], object]], runs: int = 9, clock: Callable[[], float] = time.perf_counter
) -> dict[str, float]:
    """Seconds of the fastest run of each call, taken in turn so that a busy moment hits them all.

    With `time.process_time` as the clock they are seconds of all of this process's threads.
    """
    seconds: dict[str, float] = {name: float("inf") for name in calls}
    for _ in range(runs + 1):
        for name, call in calls.items():
            start = clock()
            call()
            seconds[name] = min(seconds[name], clock() - start)
    return seconds


def machine() -> dict[str, object]:
    """The processor, the number of threads and the commit that was measured."""
    processor = platform.processor() or platform.machine()
    try:
        lines = Path("/proc/cpuinfo").read_text().splitlines()
        processor = next(line.split(":")[1].strip() for line in lines if line.startswith("model name"))
    except (OSError, StopIteration):
        pass
    commit = subprocess.run(
        ["git", "rev-parse", "--short", "HEAD"], capture_output=True, text=True, check=False, cwd=RESULTS.parent
    ).stdout.strip()
    return {"processor": processor, "commit": commit, "python": platform.python_version()}


def report(name: str, rows: list[dict[str, object]]) -> None:
    """Print the rows and keep them with the machine they were measured on."""
    for row in rows:
        print(
            "  ".join(
                f"{key}={value:.4g}" if isinstance(value, float) else f"{key}={value}" for key, value in row.items()
            )
        )
    keep(name, rows)


def leave() -> NoReturn:
    """End the process at once: where a step of the network is still computed, torch would end it with an abort."""
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(0)


def keep(name: str, rows: list[dict[str, object]]) -> None:
    """Keep the rows with the machine they were measured on; what was kept before under this name is replaced."""
    RESULTS.mkdir(exist_ok=True)
    content = {"machine": machine(), "rows": rows}
    (RESULTS / f"{name}.json").write_text(json.dumps(content, indent=1, default=str) + "\n")

"""Many recordings by two processes and by one: python benchmarks/many.py [--recordings 6] [--turns 2]

`etnet reconstruct` over copies of a bundled recording, started as in docs/many.md: one process as it comes (all cores),
one process of one thread, and two processes of one thread each. Wall time from the first start to the last end, in
turns; start and imports are in it, as in a user's. What two processes write is compared with what one of one thread
wrote, file by file.
"""

import argparse
import filecmp
import os
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from measure import report

from etnet.bundled import samples

REFERENCE, TWO = "one process, one thread", "two processes, one thread each"
WAYS = {"one process, all cores": (1, None), REFERENCE: (1, 1), TWO: (2, 1)}
"""Processes, and threads of each (`None`: as it comes)."""


def run(recordings: Path, out: Path, num_processes: int, num_threads: int | None) -> float:
    """Seconds for all recordings."""
    command = [sys.executable, "-m", "etnet", "reconstruct", str(recordings), "--out", str(out)]
    environment = {name: value for name, value in os.environ.items() if name != "OMP_NUM_THREADS"}
    if num_threads is not None:
        environment["OMP_NUM_THREADS"] = str(num_threads)
    began = time.perf_counter()
    running = [
        subprocess.Popen(
            command,
            env={**environment, "RANK": str(rank), "WORLD_SIZE": str(num_processes)},
            stdout=subprocess.DEVNULL,
            stderr=subprocess.PIPE,
        )
        for rank in range(num_processes)
    ]
    for process in running:
        _, said = process.communicate()
        if process.returncode:
            sys.exit(f"a process ended with {process.returncode}:\n{said.decode()[-2000:]}")
    return time.perf_counter() - began


def _compare(expected: Path, found: Path) -> None:
    """End where a picture or a table of stamps of the two differs."""
    names = [str(path.relative_to(expected)) for path in expected.rglob("*") if path.suffix in (".png", ".csv")]
    _, others, missing = filecmp.cmpfiles(expected, found, names, shallow=False)
    if not names or others or missing:
        sys.exit(
            f"of {len(names)} files {len(others)} differ and {len(missing)} are missing: {[*others, *missing][:5]}"
        )


def main() -> None:
    """Time each way in turn."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--recordings", type=int, default=6)
    parser.add_argument("--turns", type=int, default=2)
    given = parser.parse_args()
    seconds: dict[str, list[float]] = {way: [] for way in WAYS}
    with tempfile.TemporaryDirectory() as name:
        recordings = Path(name, "recordings")
        recordings.mkdir()
        for number in range(given.recordings):
            shutil.copy(next(path for path in samples() if path.stem == "rolling"), recordings / f"take{number}.h5")
        for _ in range(given.turns):
            for way, (num_processes, num_threads) in WAYS.items():
                out = Path(name, way)
                seconds[way].append(run(recordings, out, num_processes, num_threads))
            _compare(Path(name, REFERENCE), Path(name, TWO))
            for way in WAYS:
                shutil.rmtree(Path(name, way))
    best = {way: min(taken) for way, taken in seconds.items()}
    two = best[TWO]
    report("many", [{"way": way, "seconds": best[way], "of_two": best[way] / two, "aim": 1.7} for way in WAYS])


if __name__ == "__main__":
    main()

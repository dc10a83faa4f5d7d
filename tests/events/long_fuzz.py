"""Fuzz every format for as long as one likes: `python -m tests.events.long_fuzz --minutes 60 --out figures.json`.

Each batch of damaged files is read in a process of its own, so that one that ends the process is a finding and not the
end of the run. The figures are written after every batch; how many files it were, and how many findings, is added to
`benchmarks/results/fuzz.json`.
"""

from __future__ import annotations

import argparse
import json
import os
import resource
import signal
import sys
import tempfile
import time
import traceback
from collections.abc import Callable
from pathlib import Path
from typing import NoReturn

import numpy as np

from etnet.events.formats.prophesee import raw as prophesee
from tests import fuzz_figures
from tests.events.fuzz import damaged, try_to_read
from tests.events.test_fuzz import MADE, REAL, WRITTEN, seed_file
from tests.real_data import DATA

BATCH = 200
SHARE = 0.5
"""Seconds of a batch: every format gets as long as the others, not as many files. At least `FEWEST` files are read."""
FEWEST = 3
LONGEST = 60
"""Seconds of the process's own time that one damaged file may take; more is a finding."""
WAITS = 600
"""Seconds after which a file that is waited for is a finding, too: the fuzzer runs beside other work."""


def read_batch(seed: Path, entropy: int, folder: Path, num_files: int) -> dict[str, object]:
    """In the child: damage, read, count. What goes through is a finding with its file's number."""
    rng, began_at = np.random.default_rng(entropy), time.perf_counter()
    content, counts, findings, slowest = seed.read_bytes(), {"opened": 0, "refused": 0}, [], 0.0
    for number in range(num_files):
        if number >= FEWEST and time.perf_counter() - began_at > SHARE:
            break
        path = folder / f"{entropy}_{number}{seed.suffix}"
        path.write_bytes(damaged(content, rng))
        (folder / "number").write_text(str(number))
        began = time.perf_counter()
        signal.setitimer(signal.ITIMER_PROF, LONGEST)
        signal.alarm(WAITS)
        try:
            came = try_to_read(path)
            counts[came] = counts.get(came, 0) + 1
        except BaseException:
            findings.append({"file": number, "what": traceback.format_exc(limit=-4)})
        signal.setitimer(signal.ITIMER_PROF, 0)
        signal.alarm(0)
        slowest = max(slowest, time.perf_counter() - began)
        path.unlink()
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss >> 10
    return {"counts": counts, "findings": findings, "slowest": slowest, "peak_mb": peak}


def run_batch(seed: Path, entropy: int, num_files: int) -> dict[str, object]:
    """In the parent: a child reads the batch; how it ended is part of what came of it."""
    with tempfile.TemporaryDirectory(prefix="fuzz-") as name:
        folder = Path(name)
        child = os.fork()
        if child == 0:
            os.environ["TMPDIR"] = os.environ["ETNET_CACHE"] = tempfile.tempdir = name
            with (folder / "said").open("w") as said:
                os.dup2(said.fileno(), 2)
            run_and_end(
                lambda: (folder / "result").write_text(json.dumps(read_batch(seed, entropy, folder, num_files)))
            )
        status = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
        if status == 0:
            return json.loads((folder / "result").read_text())
        number = int((folder / "number").read_text()) if (folder / "number").exists() else -1
        last_words = (folder / "said").read_text()[-500:] if (folder / "said").exists() else ""
        ended = {"file": number, "what": f"the process ended with {status}", "said": last_words}
        return {"counts": {"ended": 1}, "findings": [ended], "slowest": 0.0, "peak_mb": 0}


def make_seed(name: str, folder: Path) -> Path | None:
    """The sound file, made in a child so that the parent stays without the libraries' threads; None if it is absent."""
    if name not in (*WRITTEN, *MADE):
        return DATA / name if (DATA / name).exists() else None
    child = os.fork()
    if child == 0:
        run_and_end(lambda: seed_file(name, folder))
    if os.waitpid(child, 0)[1] != 0:
        sys.exit(f"{name}: the sound file could not be made")
    return folder / name


def run_and_end(work: Callable[[], object]) -> NoReturn:
    """In a child: do it and end there, whatever happens; nothing of the parent's is unwound twice."""
    try:
        work()
    except BaseException:
        traceback.print_exc()
        os._exit(1)
    os._exit(0)


def main() -> None:
    """Go round the formats until the time is over."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--minutes", type=float, default=60)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--only", nargs="*", default=[], help="names of sound files, as test_fuzz has them")
    parser.add_argument("--indexed", action="store_true", help="read RAW files of any size by an index")
    options = parser.parse_args()
    if options.indexed:
        prophesee.INDEXED_BYTES = 0
    began, entropy, figures = time.monotonic(), int(time.time()) * 1000, {}
    with tempfile.TemporaryDirectory(prefix="fuzz-seeds-") as folder:
        names = options.only or [*WRITTEN, *MADE, *REAL]
        seeds = {name: seed for name in names if (seed := make_seed(name, Path(folder))) is not None}
        while time.monotonic() - began < 60 * options.minutes:
            for name, seed in seeds.items():
                entropy += 1
                came = run_batch(seed, entropy, BATCH)
                told = figures.setdefault(name, {"counts": {}, "findings": [], "slowest": 0.0, "peak_mb": 0})
                for what, count in came["counts"].items():
                    told["counts"][what] = told["counts"].get(what, 0) + count
                told["findings"] += [{"entropy": entropy, **finding} for finding in came["findings"]]
                fuzz_figures.add("files", sum(came["counts"].values()), len(came["findings"]))
                told["slowest"] = max(told["slowest"], came["slowest"])
                told["peak_mb"] = max(told["peak_mb"], came["peak_mb"])
                minutes = (time.monotonic() - began) / 60
                options.out.write_text(json.dumps({"minutes": minutes, "formats": figures}, indent=1))
    sys.exit(any(told["findings"] for told in figures.values()))


if __name__ == "__main__":
    main()

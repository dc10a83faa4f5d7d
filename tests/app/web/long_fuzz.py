"""Fuzz what pages say for as long as one likes: `python -m tests.app.web.long_fuzz links views channel --num 100000`.

Counts go to `benchmarks/results/fuzz.json`, to those of earlier runs. A fault is printed, and the run goes on.
"""

import argparse
import sys
import tempfile
import time
import traceback
from pathlib import Path

from tests import fuzz_figures
from tests.app.stand_ins import served
from tests.app.web.test_guarding import fuzz
from tests.app.web.test_messages import sound_for_viser
from tests.app.web.test_words import read_channel, read_links, read_sessions, read_stored

STEP = 1000
"""Tried between two looks at the clock."""


def at_the_server(count: int, seed: int) -> None:
    """Frames at a real server; what it says with a traceback is a fault."""
    with served() as viewer:
        records, num_sent = fuzz(viewer, count, seed)
    assert num_sent == count
    assert [record.getMessage() for record in records if record.exc_info] == []


STORIES = {
    "links": read_links,
    "views": read_stored,
    "channel": read_channel,
    "sessions": lambda count, seed: read_sessions(Path(tempfile.mkdtemp(prefix="fuzz-")), count, seed),
    "frames": sound_for_viser,
    "server": at_the_server,
}


def main() -> None:
    """Story by story."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("stories", nargs="+", choices=[*STORIES])
    parser.add_argument("--num", type=int, default=100_000)
    parser.add_argument("--minutes", type=float, default=60, help="of each story at most")
    options = parser.parse_args()
    num_faults = 0
    for story in options.stories:
        seed, ends, left = int(time.time()) * 1000, time.monotonic() + 60 * options.minutes, options.num
        while left > 0 and time.monotonic() < ends:
            seed, count, faults = seed + 1, min(STEP, left), 0
            try:
                STORIES[story](count, seed)
            except Exception:
                faults = 1
                print(f"{story}, seed {seed}, {count}:", file=sys.stderr)
                traceback.print_exc()
            left -= count
            num_faults += faults
            fuzz_figures.add(story, count, faults)
        print(f"{story}: {fuzz_figures.figures().get(story)}", flush=True)
    sys.exit(num_faults > 0)


if __name__ == "__main__":
    main()

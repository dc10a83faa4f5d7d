"""How much was fuzzed so far, kept by story: what was tried, and what came that should not."""

import fcntl
import json
import tempfile
from pathlib import Path

from etnet.files import write_atomically

KEPT = Path(__file__).resolve().parents[1] / "benchmarks" / "results" / "fuzz.json"
"""{story: {"tried": …, "faults": …}}, of all runs together."""


def figures(path: Path = KEPT) -> dict[str, dict[str, int]]:
    """What was tried so far."""
    return json.loads(path.read_text()) if path.exists() else {}


def add(story: str, tried: int, faults: int, path: Path = KEPT) -> None:
    """So much more was tried. Several processes may add at once."""
    with Path(tempfile.gettempdir(), f"etnet-{path.name}.lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        kept = figures(path)
        told = kept.setdefault(story, {"tried": 0, "faults": 0})
        told["tried"] += tried
        told["faults"] += faults
        write_atomically(path, (json.dumps(kept, indent=1, sort_keys=True) + "\n").encode())

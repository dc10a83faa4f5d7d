"""`etnet cache`: list or clear what is kept of earlier runs (frames, states, measurements)."""

from __future__ import annotations

import time
from dataclasses import dataclass

from etnet.errors import EtnetError

MEGABYTE = 1 << 20


@dataclass(frozen=True)
class Cache:
    """List what earlier runs have kept on disk; with --clear, remove it. Everything there can be computed again."""

    clear: bool = False
    """Remove instead of listing."""
    recording: str | None = None
    """Only the runs whose recording's name begins so."""


def run(config: Cache) -> int:
    """Do it; returns the exit code."""
    from etnet.nets.kept_choices import choices_file
    from etnet.playback.disk_cache import DiskCache

    cache = DiskCache()
    runs = [run for run in cache.runs() if run.title.startswith(config.recording or "")]
    if config.recording is not None and not runs:
        raise EtnetError(f"{cache.folder}: nothing is kept of a recording whose name begins with {config.recording!r}")
    for kept in runs:
        used = time.strftime("%Y-%m-%d %H:%M", time.localtime(kept.last_used))
        held = f"{kept.num_frames:6} frames  {kept.num_states:4} states"
        print(f"{kept.nbytes / MEGABYTE:8.1f} MB  {held}  {used}  {kept.title}")
        if config.clear:
            cache.clear(kept)
    if config.clear and config.recording is None:
        cache.clear()
        choices_file().unlink(missing_ok=True)
    nbytes = sum(kept.nbytes for kept in runs)
    done = "removed" if config.clear else f"of {cache.budget_bytes / MEGABYTE:,.0f} MB"
    print(f"{nbytes / MEGABYTE:,.1f} MB in {cache.folder} {done}")
    return 0

"""`etnet sample NAME`: fetch a real recording that may not be bundled, check it, and say where it is."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro

from etnet.cli.progress import console, fraction_callback
from etnet.events.samples import cached, fetch, find_sample


@dataclass(frozen=True)
class Sample:
    """Get a real recording into the user's cache, once; its terms are shown, its files are checked."""

    name: tyro.conf.Positional[str] = "slider_depth"
    """Which: slider_depth."""
    archive: Annotated[Path | None, tyro.conf.arg(name="from")] = None
    """A .zip, .tar.gz or folder at hand that holds it; no network is touched then."""
    out: Path | None = None
    """Folder to put it in instead of the cache."""


def run(config: Sample) -> int:
    """Fetch it; prints its folder alone on the standard output."""
    sample = find_sample(config.name)
    console.print(sample.terms)
    folder = cached(sample, config.out)
    if folder is None:
        with fraction_callback(f"fetching {sample.name}") as progress:
            folder = fetch(sample, config.out, config.archive, progress)
    print(folder)
    return 0

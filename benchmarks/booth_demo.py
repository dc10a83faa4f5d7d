"""The demo of `booth.py`, in a process of its own, and what it holds of visitors."""

import json
import os
import sys
from pathlib import Path

import soak

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

IDLE = 6.0
"""Seconds without a touch after which a page is the next visitor's; the demo's own is a minute."""
UPLOADS = 16
"""MB that a visitor may hand over."""


def serve() -> None:
    """Run the demo; answer each line on standard input with what the process holds and what is left of visitors."""
    from app.config import ViewerConfig
    from app.main import Viewer
    from app.session import demo

    demo.IDLE = IDLE
    config = ViewerConfig(demo=True, port=0, precision="fp32", budget=soak.CACHES["states"], threads=1, uploads=UPLOADS)
    viewer = Viewer(config)
    soak._lower_caps(viewer.engine)
    soak._fill(viewer)
    viewer.rehearse()
    faults = soak._break_now_and_then(viewer.engine)
    print(viewer.port, flush=True)
    for _ in sys.stdin:
        held = soak._held(viewer)
        homes = pages_of_their_own(viewer) / 1e6
        # Pages that were taken home live half an hour, within a cap of their own: a cache.
        held |= {"caches_mb": held["caches_mb"] + homes, "beyond_caches_mb": held["beyond_caches_mb"] - homes}
        print(json.dumps({**held, "homes_mb": homes, **left(viewer), "faults": faults[0]}), flush=True)
    viewer.stop()


def pages_of_their_own(viewer) -> int:
    """Bytes of pages that were taken home and are in no other cache: those of jobs hold the same ones."""
    if viewer.homes is None:
        return 0
    held = {id(page): len(page) for _, page in tuple(viewer.homes._held.values())}
    for result, _ in tuple(viewer.engine._jobs._kept._values.values()):
        held.pop(id(getattr(result.value, "content", None)), None)
    return sum(held.values())


def left(viewer) -> dict[str, int]:
    """What is here of visitors."""
    uploads, mirrors, jobs = viewer.uploads, viewer.mirrors, viewer.engine._jobs
    folder = uploads._folder
    names = [] if folder is None else [name for _, _, found in os.walk(folder.path) for name in found]
    return {
        "upload_files": sum(name != ".held" for name in names),
        "upload_desks": len(uploads._desks),
        "private_recordings": len(viewer.catalogue._private),
        "mirrors": len(mirrors._by_ticket) + len(mirrors._running),
        "films": len(viewer.catalogue.films._films) + len(viewer.catalogue.films._streams),
        "jobs": len(jobs._entries),
    }

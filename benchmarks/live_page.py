"""A live page: how many images a second, and how far events and images are behind a replayed 240×180 recording.

`python live_page.py --seconds 30`. A page without a screen follows `etnet-view --live FILE --loop`; after each fifth of
the time the bare network makes a few steps in the same process, as the floor. Of all fifths the best is told, too,
because the machine may be busy.
"""

from __future__ import annotations

import argparse
import asyncio
import statistics
import sys
import time
from pathlib import Path

from measure import report

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from app.config import LiveConfig, ViewerConfig
from app.main import Viewer
from app.views.page import Page
from etnet.bundled import samples
from tests.app.stand_ins import Browser

PATIENCE = 300.0
LOOK = 0.002
"""Seconds between two looks at what the page shows."""


def _pages(viewer: Viewer) -> list[tuple[float, Page]]:
    return [session.drawn for session in list(viewer._visits) if session.drawn is not None]


async def _followed(viewer: Viewer, seconds: float) -> dict[str, list[float]]:
    """For each page that is drawn: ms that its newest event and its image are behind, and each new image's window."""
    found: dict[str, list[float]] = {"events": [], "image": [], "windows": [], "steps": []}
    until, last, shown, busy = time.monotonic() + seconds, 0.0, -1, time.process_time()
    assert viewer.live is not None
    while time.monotonic() < until:
        await asyncio.sleep(LOOK)
        for drawn_at, page in _pages(viewer):
            if drawn_at == last or page.moment is None or page.ready is None or page.live is None:
                continue
            last, since = drawn_at, time.monotonic() - drawn_at
            events = viewer.live.live.behind(page.moment.recording.span.stop)
            if events is not None:
                found["events"].append(1000 * (events - since))
            if page.ready.request.index > shown and page.ready.request.index < len(viewer.live.windows.kept):
                shown = page.ready.request.index
                window = viewer.live.windows.kept[shown]
                image = viewer.live.live.behind(window.t_stop)
                if image is not None:
                    found["image"].append(1000 * (image - since))
                found["windows"].append((window.t_stop - window.t_start) / 1000)
                found["steps"].append(page.step_milliseconds or 0.0)
    found["cpu"] = [1000 * (time.process_time() - busy)]
    return found


def _bare_steps(viewer: Viewer) -> tuple[float, float]:
    """ms, and CPU ms, of the fastest of a few steps of the same network at the same size."""
    import torch

    model, _ = viewer.engine._playbacks.model(viewer.default.model_id, viewer.default.precision)
    seen = viewer.live.seen
    voxel, state, took, busy = torch.randn(1, model.bins, seen.height, seen.width), None, [], []
    with torch.inference_mode():
        for _ in range(4):
            began, at = time.perf_counter(), time.thread_time()
            state = model(voxel, state).state
            took.append(1000 * (time.perf_counter() - began))
            busy.append(1000 * (time.thread_time() - at))
    return min(took[1:]), min(busy[1:])


async def measured(config: ViewerConfig, seconds: float) -> list[dict[str, object]]:
    """One row for the whole time and one for the best fifth."""
    viewer = Viewer(config)
    try:
        async with Browser.open(viewer.port) as browser:
            await browser.until_shown('data-testid="is-live"', PATIENCE)
            await browser.until(lambda: any(page.ready is not None for _, page in _pages(viewer)), PATIENCE)
            await asyncio.sleep(2)
            fifths = []
            for _ in range(5):
                found = await _followed(viewer, seconds / 5)
                floor, cpu_floor = await asyncio.to_thread(_bare_steps, viewer)
                found["floor"], found["cpu_floor"] = [floor], [cpu_floor]
                await _followed(viewer, 1.0)  # what waited meanwhile is made up for
                fifths.append(found)
            windowing = viewer.live.shown(None, False).windowing
    finally:
        viewer.stop()
    best = max(fifths, key=lambda found: len(found["image"]))
    whole = {name: [value for found in fifths for value in found[name]] for name in best}
    what = f"etnet-half {config.precision}, {config.threads} threads, {viewer.live.seen}"
    return [
        {"what": f"{what}: all", "windowing": windowing, **_row(whole, seconds)},
        {"what": f"{what}: the best fifth", "windowing": windowing, **_row(best, seconds / 5)},
    ]


def _row(found: dict[str, list[float]], seconds: float) -> dict[str, object]:
    step = statistics.median(found["steps"])
    window = statistics.median(found["windows"])
    return {
        "images_per_s": len(found["image"]) / seconds,
        "window_ms": window,
        "step_ms": step,
        "bare_step_ms": min(found["floor"]),
        "cpu_ms_per_image": sum(found["cpu"]) / max(len(found["image"]), 1),
        "bare_step_cpu_ms_of_one_thread": min(found["cpu_floor"]),
        "events_behind_ms_median": statistics.median(found["events"]),
        "events_behind_ms_95": statistics.quantiles(found["events"], n=20)[-1],
        "image_behind_ms_median": statistics.median(found["image"]),
        "image_behind_ms_95": statistics.quantiles(found["image"], n=20)[-1],
        "allowed_ms": window + 2 * step,
    }


def main() -> None:
    """Measure and keep."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seconds", type=float, default=30)
    parser.add_argument("--threads", type=int, default=2)
    parser.add_argument("--precisions", nargs="+", default=["fp32", "bf16"])
    options = parser.parse_args()
    rows: list[dict[str, object]] = []
    for precision in options.precisions:
        source = LiveConfig(loop=True)
        config = ViewerConfig(
            port=0, precision=precision, threads=options.threads, live=str(samples()[0]), source=source
        )
        rows += asyncio.run(measured(config, options.seconds))
    report("live_page", rows)


if __name__ == "__main__":
    main()

"""What one moment costs the viewer before the model has done anything: event image, voxel tiles, event cloud.

240×180, the bundled recording `astronaut`, every window drawn once with nothing cached. Aim: ≤ 30 ms of one core;
"core" is the thread's own time, "wall" also counts waiting for a busy machine.
Run: python benchmarks/present.py
"""

import statistics
import time

import cv2
from measure import report

from app.catalogue.recordings import Catalogue, suited_policy
from app.config import ViewerConfig
from app.html.moment import Moment
from app.html.pictures import event_cloud, event_image_html
from app.views.timeline.html import timeline_html
from app.views.voxels.html import voxel_html
from etnet.windows import plan_windows

AIM_MILLISECONDS = 30.0
POINTS = 10_000


def main() -> None:
    cv2.setNumThreads(1)
    catalogue = Catalogue(ViewerConfig())
    entry = catalogue.entries()[0]
    recording = catalogue.open(entry.id)
    policy = suited_policy(recording)
    windows = plan_windows(recording, policy)
    parts = {
        "event image": lambda moment: event_image_html(moment, "polarity"),
        "voxel tiles": voxel_html,
        "event cloud": lambda moment: event_cloud(moment, POINTS),
        "timeline": timeline_html,
    }
    wall: dict[str, list[float]] = {name: [] for name in [*parts, "all"]}
    core: dict[str, list[float]] = {name: [] for name in [*parts, "all"]}
    for index in range(len(windows)):
        moment = Moment(entry.id, policy, index, recording, windows)
        for name, draw in parts.items():
            start, start_of_core = time.perf_counter(), time.thread_time()
            draw(moment)
            core[name].append(time.thread_time() - start_of_core)
            wall[name].append(time.perf_counter() - start)
        for taken in (wall, core):
            taken["all"].append(sum(taken[name][-1] for name in parts))
    report(
        "present",
        [
            {
                "part": name,
                "core_median_ms": statistics.median(core[name]) * 1000,
                "wall_median_ms": statistics.median(wall[name]) * 1000,
                "wall_best_ms": min(wall[name]) * 1000,
                "aim_ms": AIM_MILLISECONDS if name == "all" else None,
            }
            for name in wall
        ],
    )


if __name__ == "__main__":
    main()

"""Is memory flat? The largest resident size while films of 300, 3,000 and 6,000 frames are simulated into a file.

`python benchmarks/simulate_memory.py`. Each film is a process of its own: 80×60, 2 pixels a frame, the pixels of a
DAVIS346; the recording is written as `etnet simulate` writes it.
"""

import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

from measure import report

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

LENGTHS = (300, 3_000, 6_000)


class BackAndForth:
    """A scene's film, played forwards and backwards as often as it takes; each frame is made when it is asked for."""

    name, remarks, bits, is_fine = "back and forth", list[str](), 8, False

    def __init__(self, num_frames: int) -> None:
        from etnet.events.events import Sensor
        from etnet.simulation.tone import Tone
        from tests.simulation.known_motion import FRAME_US, KnownScene

        self._scene, self._num_frames, self.interval = KnownScene(2.0, size=(80, 60)), num_frames, FRAME_US
        self.sensor, self.tone, self.duration = Sensor(80, 60), Tone("srgb"), num_frames * FRAME_US / 1e6

    def __iter__(self) -> Iterator[object]:
        from etnet.simulation.footage import Frame

        lights = [frame.light for frame in self._scene.shown()]
        turn = len(lights) - 1
        for i in range(self._num_frames):
            yield Frame(i * self.interval, lights[abs((i + turn) % (2 * turn) - turn)].copy())

    def close(self) -> None:
        """Nothing to give back."""


def simulate(num_frames: int) -> None:
    """In the child: simulate, and print the largest resident size (MB), the events, and processor seconds."""
    from etnet.simulation.settings import CAMERAS
    from etnet.simulation.video import VideoConfig, simulate_footage

    config = VideoConfig(pixels=CAMERAS["DAVIS346"].pixels)
    with tempfile.TemporaryDirectory() as folder:
        written = simulate_footage(BackAndForth(num_frames), Path(folder) / "a.h5", config)  # pyright: ignore
    largest = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    print(largest, written.num_events, time.process_time())


def main() -> None:
    if len(sys.argv) > 1:
        simulate(int(sys.argv[1]))
        return
    rows: list[dict[str, object]] = []
    for num_frames in LENGTHS:
        said = subprocess.run([sys.executable, __file__, str(num_frames)], check=True, capture_output=True, text=True)
        largest, num_events, seconds = map(float, said.stdout.split())
        rows.append({"frames": num_frames, "largest_mb": largest, "events": int(num_events), "cpu_s": seconds})
    report("simulate_memory", rows)


if __name__ == "__main__":
    main()

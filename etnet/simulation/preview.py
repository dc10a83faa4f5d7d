"""The first seconds of a video, ready to be simulated again and again: what a slider needs.

Decoding and the search for motion do not depend on the sensor, so they are done once; another setting costs the
pixels' work alone.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import closing
from dataclasses import replace
from pathlib import Path

import numpy as np
from jaxtyping import Float32, Int64

from etnet.errors import Cancelled
from etnet.events.events import Events
from etnet.events.recording import GroundTruth, Recording, Remark, recording_of_events
from etnet.simulation.streaming import EventSimulator
from etnet.simulation.video import VideoConfig, footage_of
from etnet.simulation.walk import Passage, Walk

SECONDS = 2.0
MOST_BYTES = 256 << 20
"""Memory for levels; what comes after is left out, and said."""
SIDE = 240
"""Pixels of the longer side, at most."""


class VideoPreview:
    """Build it once for a video (decodes and looks for motion); `recording` gives it under any sensor.

    Its steps between frames keep motion at one pixel and do not follow the thresholds, so that its events differ a
    little from those of the whole.
    """

    def __init__(
        self,
        video: Path,
        config: VideoConfig,
        seconds: float = SECONDS,
        is_cancelled: Callable[[], bool] | None = None,
    ) -> None:
        seen = config.seen
        stop = seen.start + seconds * seen.speed
        framing = replace(seen, longest_side=min(seen.longest_side, SIDE), stop=min(seen.stop or stop, stop))
        self.config, self.remarks = replace(config, framing=framing), list[str]()
        self._passages, num_bytes = list[Passage](), 0
        self._dark = config.traits.dark
        walk = Walk(config.stepping, self._dark, np.inf)
        with closing(walk), closing(footage_of(video, self.config)) as footage:
            self.name, self.sensor = footage.name, footage.sensor
            for passage in walk.over(footage):
                if is_cancelled is not None and is_cancelled():
                    raise Cancelled("the preview was stopped")
                steps = list(passage.steps)
                self._passages.append(replace(passage, steps=steps, between=None))
                num_bytes += passage.frame.light.nbytes * (len(steps) + 1)
                if num_bytes > MOST_BYTES:
                    self.remarks.append(f"a preview of the first {passage.frame.t / 1e6:.1f} s: more takes much memory")
                    break
            self.remarks += footage.remarks

    def events(self, config: VideoConfig) -> Events:
        """Its events under another sensor: of `config` that and the seed count."""
        traits = replace(config.traits, dark=self._dark)
        with EventSimulator(traits, seed=config.seed, threads=1) as simulator:
            found = [simulator.expose(passage) for passage in self._passages]
            found.append(simulator.finish())
        return Events.concatenate(found, self.sensor)

    def recording(self, config: VideoConfig) -> Recording:
        """The preview as a recording, with the video's frames."""
        frames = [passage.frame for passage in self._passages]
        stamps: Int64[np.ndarray, " n"] = np.array([int(frame.t) for frame in frames], np.int64)

        def read_frame(index: int) -> Float32[np.ndarray, "h w"]:
            return np.clip(frames[index].light, 0, 1) ** np.float32(1 / 2.2)

        remarks = [Remark("assumed", said) for said in self.remarks]
        return recording_of_events(self.events(config), self.name, remarks, GroundTruth(stamps, read_frame))

"""A small network's playback as the engine holds it, and what is asked of it."""

from app.engine.playbacks import LoadedPlayback, Pace
from app.engine.requests import FrameRequest
from etnet.nets.runtime import contract_of
from etnet.windows import ByCount
from tests.inspection.small import EVENTS_A_WINDOW, small_playback

POLICY = ByCount(EVENTS_A_WINDOW)
SITE = "scale2.decoder.0.cross"
QUERY = (20, 9)
PARTS = ("tpa", "uniform", "decoders", "scale 3", "skip 0", "zero 1", "freeze 2", f"site {SITE}", f"alike {SITE}",
         f"head {SITE} 3")  # fmt: skip
NONSENSE = ("", "skip", "skip 9", "skip -1", "head x 1", f"head {SITE}", f"head {SITE} 99", "tpa 1", "scale 1 2")


def loaded_of(preset="tiny"):
    playback = small_playback(preset)
    return LoadedPlayback(playback, contract_of(playback.model), 4, Pace(), 1.0)


def request_of(index, **more):
    return FrameRequest("r", "m", "fp32", POLICY, index, **more)


def whole(job, loaded):
    return [answer for answer, _ in job.run(loaded, lambda: False)][-1]

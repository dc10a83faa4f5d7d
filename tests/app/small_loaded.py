"""A small network's playback as the engine holds it, and what is asked of it."""

from app.engine.pace import Pace
from app.engine.playbacks import LoadedPlayback
from app.engine.requests import FrameRequest
from etnet.events.open import open_recording
from etnet.nets.presets import build_model
from etnet.nets.runtime import contract_of
from etnet.nets.weights import load_model, save_weights
from etnet.playback.playback import Playback
from etnet.windows import ByCount, plan_windows
from tests.inspection.small import EVENTS_A_WINDOW, NUM_WINDOWS, SENSOR, small_playback
from tests.strategies import make_events

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


def opened_in(folder):
    """A file, weights, and their playback as the engine holds it: what lines of Python find by name."""
    events = make_events(NUM_WINDOWS * EVENTS_A_WINDOW, SENSOR)
    rows = [f"{t / 1e6:.6f} {x} {y} {int(p > 0)}"
            for t, x, y, p in zip(events.t, events.x, events.y, events.p, strict=True)]  # fmt: skip
    file, weights = folder / "made up.txt", folder / "tiny.safetensors"
    file.write_text(f"{SENSOR.width} {SENSOR.height}\n" + "\n".join(rows) + "\n")
    save_weights(build_model("tiny"), weights, dtype=None)
    recording, model = open_recording(file), load_model(weights)
    playback = Playback(model, recording, plan_windows(recording, POLICY))
    return LoadedPlayback(playback, contract_of(model), 4, Pace(), 1.0), str(file), str(weights)

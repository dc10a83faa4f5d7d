"""Stand-ins for the engine's tests: a library in memory, and a network whose steps a test can hold back and count."""

import threading
from dataclasses import dataclass, field

import numpy as np
import torch
from torch import nn

from app.catalogue.models import ModelEntry
from app.engine.requests import Failed, FrameRequest, Ready, Working
from etnet.errors import ModelError, RecordingError
from etnet.events.events import Events, Sensor
from etnet.events.recording import recording_of_events
from etnet.nets.attention import Attention
from etnet.nets.base import Pyramid, State
from etnet.reconstruction import window_voxel
from etnet.windows import ByCount, plan_windows

POLICY = ByCount(50)


SENSOR = Sensor(24, 16)


def recording_of(num_windows, sensor=SENSOR, seed=0):
    rng = np.random.default_rng(seed)
    n = num_windows * 50
    return recording_of_events(
        Events(
            rng.integers(0, sensor.width, n).astype(np.uint16),
            rng.integers(0, sensor.height, n).astype(np.uint16),
            np.sort(rng.integers(0, num_windows * 10_000, n)).astype(np.int64),
            rng.choice(np.array([-1, 1], np.int8), n),
            sensor,
        ),
        name=f"recording {seed}",
    )


class CountingModel(nn.Module):
    """Memory is the running sum of what was seen; the frame shows it. Counts calls, and waits where told to."""

    name, bins, normalise_voxels = "counting", 5, False

    def __init__(self):
        super().__init__()
        self.weight = nn.Parameter(torch.ones(1), requires_grad=False)
        self.encodes, self.decodes = 0, 0
        self.gate = None
        self.entered = threading.Semaphore(0)
        self.breaks_at_decode = None

    def encode(self, voxel, state=None, intervention=None):
        if voxel.shape[-2:] != (96, 128):
            self.encodes += 1
            if self.gate is not None:
                self.entered.release()
                assert self.gate.acquire(timeout=10)
        seen = voxel.sum(1, keepdim=True) + (0 if state is None else state.tensors[0])
        return self.pyramid(voxel, State((seen,))), State((seen,))

    def pyramid(self, voxel, state_after):
        return Pyramid((state_after.tensors[0],), voxel.shape[-2], voxel.shape[-1])

    def decode(self, pyramid, probe=None, intervention=None):
        self.decodes += 1
        if self.breaks_at_decode is not None:
            error, self.breaks_at_decode = self.breaks_at_decode, None
            raise error
        return pyramid.levels[0] / 100, (FakeAttention() if probe is not None else None)

    def forward(self, voxel, state=None):
        raise NotImplementedError("the engine encodes and decodes")


class FakeAttention(Attention):
    sites = ("scale1.encoder.0.self",)
    nbytes = 1000

    def __init__(self):
        """Nothing is in it."""


@dataclass
class Shelf:
    """Recordings and one model by id, as the catalogue offers them."""

    recordings: dict = field(default_factory=lambda: {"r": recording_of(40)})
    model_instance: nn.Module = field(default_factory=CountingModel)
    warm_up: int | None = None

    def open(self, recording_id):
        if recording_id not in self.recordings:
            raise RecordingError(f"{recording_id}: there is no such recording")
        return self.recordings[recording_id]

    def model(self, model_id):
        if model_id == "missing":
            raise ModelError("missing: there is no such model")
        return ModelEntry(model_id, model_id, "", True, None, self.warm_up, model_id)

    def load(self, entry, precision, device):
        return self.model_instance


class Inbox:
    """Collects replies and waits for them."""

    def __init__(self):
        self.replies = []
        self._changed = threading.Condition()

    def __call__(self, reply):
        with self._changed:
            self.replies.append(reply)
            self._changed.notify_all()

    def wait(self, condition, timeout=10):
        with self._changed:
            assert self._changed.wait_for(lambda: any(condition(r) for r in self.replies), timeout), self.replies
            return next(r for r in self.replies if condition(r))

    def ready(self, index, timeout=10):
        return self.wait(lambda r: isinstance(r, Ready) and r.request.index == index and not r.is_approximate, timeout)

    def failed(self):
        return self.wait(lambda r: isinstance(r, Failed))

    def of(self, kind):
        return [r for r in self.replies if isinstance(r, kind)]

    @property
    def working(self):
        return self.of(Working)


class Notes(Inbox):
    """Takes results of jobs."""

    def __call__(self, slot, result):
        super().__call__((slot, result))

    def whole(self):
        return self.wait(lambda reply: reply[1].is_whole)[1]

    @property
    def shares(self):
        return [result.share for _, result in self.replies]


def request(index, recording="r", model="m", **more):
    return FrameRequest(recording, model, "fp32", POLICY, index, **more)


def hold(model):
    """From now on each encode waits for a `release`; tells when one has begun through `model.entered`."""
    model.gate = threading.Semaphore(0)
    return model.gate


def sequential(shelf, index):
    """The frame that a plain loop over the windows comes to."""
    recording = shelf.recordings["r"]
    windows = plan_windows(recording, POLICY)
    seen = sum(window_voxel(shelf.model_instance, recording, windows[i]).sum(0) for i in range(index + 1))
    return (seen / 100).numpy()

"""A moment as panels draw it: a recording with camera frames, one window of it, the network's answer for it."""

import numpy as np
import pytest

from app.engine.requests import Ready
from app.html.attention.look import AttentionLook
from app.html.moment import ARRAYS, PICTURES, Moment
from app.html.pictures import Tones
from etnet.events.events import Sensor
from etnet.events.recording import GroundTruth, recording_of_events
from etnet.nets.attention import AttentionProbe
from etnet.nets.presets import build_model
from etnet.nets.runtime import contract_of
from etnet.playback.playback import Playback
from etnet.windows import plan_windows
from tests.app.fakes import POLICY, recording_of, request

EVIL = '<img src=x onerror="alert(1)">'
LOOK = AttentionLook((20, 30))
TONES = Tones()


@pytest.fixture(autouse=True)
def nothing_shared(monkeypatch):
    for store in (PICTURES, ARRAYS):
        store._values.clear()


@pytest.fixture(scope="module")
def recording():
    made = recording_of(12, Sensor(50, 37))
    frame = np.linspace(0, 0.5, 37 * 50, dtype=np.float32).reshape(37, 50)
    truth = GroundTruth(np.arange(1, 12) * 10_000, lambda index: frame)
    return recording_of_events(made.read(0, made.num_events), EVIL, ground_truth=truth)


@pytest.fixture
def moment(recording):
    return Moment("r", POLICY, 4, recording, plan_windows(recording, POLICY))


@pytest.fixture(scope="module")
def ready(recording):
    model = build_model("tiny")
    playback = Playback(model, recording, plan_windows(recording, POLICY))
    step = playback.at(4, AttentionProbe())
    frame = step.frame[0, 0].numpy()
    return Ready(request(4), frame, step.attention, 12.0, True, False, False, contract_of(model), 4)

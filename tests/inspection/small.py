"""A small network on a small recording, shared by the tests of inspection."""

import torch

from etnet.events.events import Sensor
from etnet.events.recording import recording_of_events
from etnet.nets.attention import Attention, AttentionProbe
from etnet.nets.presets import build_model
from etnet.playback.playback import Playback
from etnet.windows import ByCount, plan_windows
from tests.strategies import make_events

SENSOR = Sensor(38, 21)
NUM_WINDOWS = 8
EVENTS_A_WINDOW = 150


def small_playback(preset: str = "tiny") -> Playback:
    """Eight windows of random events on 38 × 21 pixels: 15 tokens, 5 a row."""
    recording = recording_of_events(make_events(NUM_WINDOWS * EVENTS_A_WINDOW, SENSOR))
    return Playback(build_model(preset), recording, plan_windows(recording, ByCount(EVENTS_A_WINDOW)))


def small_attention(preset: str = "tiny", values: bool = False, sites: frozenset[str] | None = None) -> Attention:
    """The attention of one step on noise."""
    voxel = torch.randn(1, 5, SENSOR.height, SENSOR.width, generator=torch.Generator().manual_seed(2))
    with torch.inference_mode():
        attention = build_model(preset)(3 * voxel, probe=AttentionProbe(sites, values)).attention
    assert attention is not None
    return attention

"""The engine with a real network on a real recording: what a visitor is shown is what the library gives."""

import numpy as np
import pytest
import torch

from app.catalogue.recordings import Catalogue, suited_policy
from app.config import ViewerConfig
from app.engine.engine import Engine
from app.engine.requests import FrameRequest, Ready
from etnet.nets.attention import AttentionProbe
from etnet.nets.presets import build_model
from etnet.reconstruction import window_voxel
from etnet.windows import plan_windows
from tests.app.fakes import Inbox
from tests.real_data import real_file

pytestmark = pytest.mark.real


@pytest.fixture
def catalogue():
    return Catalogue(ViewerConfig(file=real_file("derived/slider_depth_0.4s_evreal.zip")))


@pytest.fixture
def network():
    return build_model("tiny")


@pytest.fixture
def engine(catalogue, network):
    # Room for a few states only, so that seeks have to replay.
    made = Engine(catalogue, 8 << 20, threads=1, load=lambda *_: network)
    yield made
    made.stop()


def plain_loop(network, recording, policy, count, probe_at):
    state, steps = None, []
    with torch.inference_mode():
        for window in plan_windows(recording, policy)[:count]:
            voxel = window_voxel(network, recording, window)[None]
            step = network(voxel, state, AttentionProbe() if window.index == probe_at else None)
            steps.append(step)
            state = step.state
    return steps


def test_any_order_of_requests_gives_the_frames_and_rows_of_a_plain_loop(catalogue, network, engine):
    entry = catalogue.entries()[0]
    recording = catalogue.open(entry.id)
    policy = suited_policy(recording)
    num = len(plan_windows(recording, policy))
    order = [*np.random.default_rng(0).permutation(num), 0, num - 1]
    replies = []
    for place, index in enumerate(order):
        asks = place % 3 == 0
        inbox = Inbox()  # a new one each time: some windows are asked for twice
        engine.request(
            "ada", FrameRequest(entry.id, "etnet-half", "fp32", policy, int(index), wants_attention=asks), inbox
        )
        done = inbox.wait(lambda r, asks=asks: isinstance(r, Ready) and (r.attention is not None) >= asks, timeout=60)
        replies += [*inbox.of(Ready), done]
    threads = torch.get_num_threads()
    torch.set_num_threads(1)
    probe_at = int(order[0])
    steps = plain_loop(network, recording, policy, num, probe_at)
    torch.set_num_threads(threads)
    exact = [reply for reply in replies if reply.is_exact]
    assert {reply.request.index for reply in exact} == set(range(num))
    for reply in exact:
        assert np.array_equal(reply.frame, steps[reply.request.index].frame[0, 0].numpy())
    shown = next(r for r in exact if r.request.index == probe_at and r.attention is not None)
    for site in shown.attention.sites:
        for pixel in ((0, 0), (239, 179), (120, 90)):
            token = shown.attention.grid.token_at(*pixel)
            wanted = steps[probe_at].attention.rows(site, [token])
            assert torch.allclose(shown.attention.rows(site, [token]), wanted, atol=1e-6)


def test_two_visitors_scrub_one_recording_alone(catalogue, engine):
    entry = catalogue.entries()[0]
    policy = suited_policy(catalogue.open(entry.id))
    inboxes = {"ada": Inbox(), "bob": Inbox()}
    for index in range(4):
        for visitor, at in (("ada", index), ("bob", 5 - index)):
            engine.request(visitor, FrameRequest(entry.id, "etnet-half", "fp32", policy, at), inboxes[visitor])
    assert inboxes["ada"].ready(3, timeout=60).is_exact
    assert inboxes["bob"].ready(2, timeout=60).is_exact

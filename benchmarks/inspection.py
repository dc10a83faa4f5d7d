"""What looking inside costs: one query → the rows of all 21 sites at 346×260, and the long inspectors at 240×180.

The long ones are given as multiples of a decode of the same size, timed right after each, in seconds of this process.
"""

import time
from collections.abc import Callable

import numpy as np
import torch
from measure import best_of_each, report

from etnet.events.events import Events, Sensor
from etnet.events.recording import recording_of_events
from etnet.inspection.atlas import head_atlas, head_table
from etnet.inspection.basis import fit_basis_to_recording
from etnet.inspection.causal_search import search_cause
from etnet.inspection.entropy import map_numbers
from etnet.inspection.features import Feature, feature_map
from etnet.inspection.follow import follow
from etnet.inspection.gates import gates_at
from etnet.inspection.links import strongest_links
from etnet.inspection.mass import received, value_weighted
from etnet.inspection.pyramid import hold
from etnet.inspection.rollout import rollout
from etnet.inspection.sources import pixel_sources
from etnet.inspection.uncertainty import dropout_spread
from etnet.nets.attention import AttentionProbe
from etnet.nets.weights import load_model
from etnet.playback.playback import Playback
from etnet.windows import ByDensity, plan_windows

SENSOR, SMALL, QUERY, RUNS = Sensor(346, 260), Sensor(240, 180), (173, 130), 5
SITE = "scale1.encoder.2.self"


def _playback(sensor: Sensor, events_per_pixel: int) -> Playback:
    rng = np.random.default_rng(0)
    num_events = events_per_pixel * sensor.num_pixels
    events = Events(
        rng.integers(0, sensor.width, num_events).astype(np.uint16),
        rng.integers(0, sensor.height, num_events).astype(np.uint16),
        np.sort(rng.integers(0, 150_000, num_events)),
        rng.choice([-1, 1], num_events).astype(np.int8),
        sensor,
    )
    recording = recording_of_events(events)
    return Playback(load_model("etnet-half"), recording, plan_windows(recording, ByDensity(0.35)))


def main() -> None:
    """Time each quantity, and count the bytes of what a query gets and of what is held for it."""
    playback = _playback(SENSOR, 1)
    model, voxel = playback.model, playback.voxel(1)[None]
    pyramid = model.pyramid(voxel, playback.state(1))
    attention = playback.at(1, AttentionProbe()).attention
    valued = playback.at(1, AttentionProbe(values=True)).attention
    assert attention is not None
    assert valued is not None
    token = attention.grid.token_at(*QUERY)
    rows = {site: attention.rows(site, [token]) for site in attention.sites}
    frame = model.decode(pyramid)[0]
    assert torch.equal(frame, model.decode(pyramid, AttentionProbe(values=True))[0])

    calls: dict[str, Callable[[], object]] = {
        "decode, nothing probed": lambda: model.decode(pyramid),
        "decode, q and k kept": lambda: model.decode(pyramid, AttentionProbe()),
        "decode, q, k and v kept": lambda: model.decode(pyramid, AttentionProbe(values=True)),
        "query: rows of all 21 sites": lambda: [attention.rows(site, [token]) for site in attention.sites],
        "peak, entropy, distance of 21 sites": lambda: [
            map_numbers(row, attention.grid, [token]) for row in rows.values()
        ],
        "12 links at each scale": lambda: strongest_links(attention, token),
        "value-weighted row of one site": lambda: value_weighted(valued, SITE, [token]),
        "reverse row of one site": lambda: attention.columns(SITE, [token]),
        "sinks of one site": lambda: received(attention, SITE),
        "rollout": lambda: rollout(attention, token),
        "gates of level 1": lambda: gates_at(playback, 1, 1),
    }
    with torch.inference_mode():
        seconds = best_of_each(calls, RUNS)
    nbytes = {
        "decode, q and k kept": attention.nbytes,
        "decode, q, k and v kept": valued.nbytes,
        "query: rows of all 21 sites": sum(row.nbytes for row in rows.values()),
    }
    short = [
        {"what": name, "milliseconds": took * 1e3, "bytes": nbytes.get(name, 0), "threads": torch.get_num_threads()}
        for name, took in seconds.items()
    ]
    report("inspection", [*short, *_long_ones()])


def _long_ones() -> list[dict[str, object]]:
    """Each once, whole, and how many decodes of the same size it amounts to."""
    playback = _playback(SMALL, 4)
    index, pixel = 9, (120, 90)
    attention = playback.at(index, AttentionProbe()).attention
    assert attention is not None
    held = hold(playback, index)
    calls: dict[str, Callable[[], object]] = {
        "atlas of 84 heads": lambda: list(head_atlas(playback, index)),
        "entropy and distance of 84 heads, all queries": lambda: head_table(attention),
        "tokens of one site": lambda: feature_map(playback, index, Feature("tokens", SITE)),
        "basis from 8 windows after 8 each": lambda: fit_basis_to_recording(playback, Feature("context")),
        "where the pixel comes from": lambda: list(pixel_sources(playback, index, pixel)),
        "spread over 8 draws, 4 windows back": lambda: list(dropout_spread(playback, index, num_back=4)),
        "search for a cause": lambda: list(search_cause(playback, index, pixel)),
        "a patch followed over 5 windows": lambda: list(
            follow(playback.recording, playback.windows, index, pixel, index - 5)
        ),
    }
    rows: list[dict[str, object]] = []
    for name, call in calls.items():
        start, start_of_process = time.perf_counter(), time.process_time()
        call()
        took, worked = time.perf_counter() - start, time.process_time() - start_of_process
        decode = best_of_each({"decode": held.frame}, 2, time.process_time)["decode"]
        rows.append({"what": name, "milliseconds": took * 1e3, "decodes": worked / decode,
                     "threads": torch.get_num_threads()})  # fmt: skip
    return rows


if __name__ == "__main__":
    main()

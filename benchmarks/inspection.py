"""What looking inside costs at 346×260: one query → the rows of all 21 sites, and the rest beside one decode."""

from collections.abc import Callable

import numpy as np
import torch
from measure import best_of_each, report

from etnet.events.events import Events, Sensor
from etnet.events.recording import recording_of_events
from etnet.inspection.entropy import map_numbers
from etnet.inspection.gates import gates_at
from etnet.inspection.links import strongest_links
from etnet.inspection.mass import received, value_weighted
from etnet.inspection.rollout import rollout
from etnet.nets.attention import AttentionProbe
from etnet.nets.weights import load_model
from etnet.playback.playback import Playback
from etnet.windows import ByDensity, plan_windows

SENSOR, QUERY, RUNS = Sensor(346, 260), (173, 130), 5
SITE = "scale1.encoder.2.self"


def _playback() -> Playback:
    rng = np.random.default_rng(0)
    num_events = SENSOR.num_pixels
    events = Events(
        rng.integers(0, SENSOR.width, num_events).astype(np.uint16),
        rng.integers(0, SENSOR.height, num_events).astype(np.uint16),
        np.sort(rng.integers(0, 150_000, num_events)),
        rng.choice([-1, 1], num_events).astype(np.int8),
        SENSOR,
    )
    recording = recording_of_events(events)
    return Playback(load_model("etnet-half"), recording, plan_windows(recording, ByDensity(0.35)))


def main() -> None:
    """Time each quantity, and count the bytes of what a query gets and of what is held for it."""
    playback = _playback()
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
    report(
        "inspection",
        [
            {"what": name, "milliseconds": took * 1e3, "bytes": nbytes.get(name, 0), "threads": torch.get_num_threads()}
            for name, took in seconds.items()
        ],
    )


if __name__ == "__main__":
    main()

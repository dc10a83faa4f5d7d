"""A process that records until it is killed. It imports little, so that it starts fast."""

from contextlib import closing

import numpy as np

from etnet.live.aedat4_writer import Aedat4Writer
from etnet.live.hdf5_writer import Hdf5Writer
from etnet.live.source import CameraFrame
from tests.live.sources import edges_at, make_events
from tests.strategies import SMALL


def write_for_ever(path):
    """Record made-up events, and print how many are flushed."""
    writer = (Hdf5Writer if path.suffix == ".h5" else Aedat4Writer)(path, SMALL, "killed")
    events = make_events(200_000, duration=200_000)
    with closing(writer):
        for number in range(0, 200_000, 500):
            writer.add_events(events[number : number + 500])
            stamp = int(events.t[number])
            writer.add_frame(CameraFrame(stamp, np.full((12, 20), number % 256, np.uint8)), writer.num_events)
            writer.add_triggers(edges_at([stamp]))
            writer.flush()
            print(number + 500, flush=True)

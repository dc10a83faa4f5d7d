"""`etnet record SOURCE OUT`: record a camera, a stream or a replayed recording as AEDAT4 or event_utils HDF5."""

from __future__ import annotations

from contextlib import ExitStack
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated

import tyro

from etnet.cli.live import LiveOptions, Teller, opened, stopping
from etnet.cli.progress import console
from etnet.live.record import Recorder, check_recordable


@dataclass(frozen=True)
class Record:
    """Record live events with the camera's frames and triggers. A file that is cut short opens up to its last flush."""

    source: tyro.conf.Positional[str]
    """camera, davis346, evk4 …, stdin, tcp:PORT, udp:PORT, webcam, or a recording to replay."""
    out: tyro.conf.Positional[Path]
    """The file: .aedat4 or .h5."""
    overwrite: bool = False
    """Replace it if it is there."""
    options: Annotated[LiveOptions, tyro.conf.arg(name="")] = field(default_factory=LiveOptions)


def run(config: Record) -> int:
    """Do it; returns the exit code."""
    check_recordable(config.out, config.overwrite, config.source)
    with ExitStack() as stack:
        is_stopped = stack.enter_context(stopping(config.options.seconds))
        live = stack.enter_context(opened(config.source, config.options, is_stopped))
        console.print(
            f"recording {live.source.name}, {live.sensor}; press Ctrl+C to stop", markup=False, soft_wrap=True
        )
        teller = Teller(live)
        recorder = Recorder(live, config.out, first=0, overwrite=config.overwrite)
        live.start()
        try:
            while not (is_stopped.is_set() or live.is_over or recorder.is_over):
                is_stopped.wait(0.2)
                teller.tell(f"{recorder.num_events:,} written")
        finally:
            recorder.stop()
        teller.tell(f"{recorder.num_events:,} written", is_last=True)
    if recorder.num_missing:
        console.print(f"{recorder.num_missing:,} events are missing: the disk was too slow", markup=False)
    if recorder.num_events == 0:
        console.print(f"{config.out}: nothing came", markup=False, soft_wrap=True)
        return 1
    console.print(f"{config.out}: {recorder.num_events:,} events of {live.sensor}", markup=False, soft_wrap=True)
    return 1 if recorder.num_missing else 0

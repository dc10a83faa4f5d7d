"""Frames a second of simulation and of training (`half` recipe), by precision, kernel and layout, beside the floor.

The floor is the counted FLOPs of one update (forward and backward) divided by the best matrix product of this machine.
"""

import argparse
import time
from dataclasses import replace
from itertools import product
from pathlib import Path

import torch
from measure import report
from step import matmul_peak
from torch.utils.flop_counter import FlopCounterMode

from etnet.nets.precision import bf16_is_worth_trying
from etnet.training.config import DataConfig, Stage, TrainConfig
from etnet.training.data import ClipSource, stretches
from etnet.training.distributed import World
from etnet.training.recipes import HALF
from etnet.training.run import Run, begin


def simulation(config: TrainConfig, size: tuple[int, int], clips: int) -> dict[str, object]:
    """Fresh augmented clips of one size in one process."""
    source = ClipSource(replace(config, stages=(Stage(1, size=size),)))
    source[0, 0, 0]
    start = time.perf_counter()
    for number in range(1, clips + 1):
        source[0, 0, number]
    seconds = (time.perf_counter() - start) / clips
    windows = config.data.windows
    return {
        "what": "simulate",
        "size": f"{size[1]}x{size[0]}",
        "s_per_clip": seconds,
        "frames_per_s": windows / seconds,
    }


def prepared(config: TrainConfig) -> tuple[Run, list]:
    """A run and the stretches that it is timed on."""
    config = replace(config, start=None, data=replace(config.data, workers=0))
    return begin(config, World()), list(stretches(config, 0, [range(config.stages[0].clips)]))


def counted_flops(config: TrainConfig) -> int:
    """FLOPs of one update, attention spelled out."""
    run, (stretch, *_) = prepared(replace(config, attention="plain", channels_last=False, precision="fp32"))
    with FlopCounterMode(display=False) as counter:
        run.step(stretch)
    return counter.get_total_flops()


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--photos", type=Path)
    parser.add_argument("--cutouts", type=Path)
    parser.add_argument("--updates", type=int, default=4)
    parser.add_argument("--threads", type=int, default=1)
    options = parser.parse_args()
    torch.set_num_threads(options.threads)
    data = replace(DataConfig(), photos=options.photos, cutouts=options.cutouts)
    config = replace(HALF, data=data, stages=(Stage(options.updates),), threads=options.threads)
    rows = [simulation(config, size, clips=6) for size in ((112, 112), (180, 240))]

    flops = counted_flops(config)
    precisions = ("fp32", "bf16") if bf16_is_worth_trying() else ("fp32",)
    for precision, attention, channels_last in product(precisions, ("plain", "fused"), (False, True)):
        run, material = prepared(replace(config, precision=precision, attention=attention, channels_last=channels_last))
        seconds = float("inf")
        for stretch in material:
            start = time.perf_counter()
            run.step(stretch)
            seconds = min(seconds, time.perf_counter() - start)
        floor = flops / matmul_peak(precision)
        assert seconds >= floor, "faster than the machine's peak: the FLOPs are miscounted"
        frames = config.stages[0].clips * config.truncate
        rows.append(
            {
                "what": "update",
                "size": "112x112",
                "precision": precision,
                "attention": attention,
                "channels_last": channels_last,
                "s_per_update": seconds,
                "frames_per_s": frames / seconds,
                "floor_s": floor,
            }
        )
    if precisions == ("fp32",):
        rows.append({"what": "update", "precision": "bf16", "note": "slower than fp32 on this machine, not timed"})
    report("train", rows)


if __name__ == "__main__":
    main()

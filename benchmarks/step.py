"""One step of `etnet` and `etnet-half` at 240×180 and 346×260, beside the machine's own matrix-product peak.

A result above the peak would be a mistake in the counting and fails the benchmark.
"""

import argparse
from functools import partial

import torch
from measure import best_of, best_of_each, report
from torch.utils.flop_counter import FlopCounterMode

from etnet.nets.etnet import ETNet
from etnet.nets.precision import bf16_is_worth_trying
from etnet.nets.presets import build_model
from etnet.nets.runtime import Runtime, apply_runtime

SIZES = {"240x180": (180, 240), "346x260": (260, 346)}
DTYPES = {"fp32": torch.float32, "bf16": torch.bfloat16}
PEAK_SIZES = (256, 384, 512, 640, 768, 1024, 1280, 1536, 1792, 2048)


def matmul_peak(precision: str) -> float:
    """FLOP/s of the best of ten sizes × five runs of a square matrix product."""
    best = 0.0
    for size in PEAK_SIZES:
        matrix = torch.ones(size, size, dtype=DTYPES[precision])
        best = max(best, 2 * size**3 / best_of(lambda matrix=matrix: matrix @ matrix))
    return best


def count_flops(model: ETNet, voxel: torch.Tensor) -> int:
    """Multiplications and additions of one step, attention spelled out."""
    apply_runtime(model, Runtime(attention="plain"))
    with FlopCounterMode(display=False) as counter:
        model(voxel)
    return counter.get_total_flops()


def measure(preset: str, size: str, precision: str, peak: float) -> list[dict[str, object]]:
    """Encode, decode and whole step under each attention kernel and memory format."""
    model, voxel = build_model(preset), torch.randn(1, 5, *SIZES[size], generator=torch.Generator().manual_seed(0))
    flops, rows = count_flops(model, voxel), []
    for attention in ("fused", "plain"):
        for channels_last in (False, True):
            runtime = Runtime(precision, attention, channels_last)  # type: ignore[arg-type]
            apply_runtime(model, runtime)
            pyramid, state = model.encode(voxel)
            seconds = best_of_each(
                {"encode": partial(model.encode, voxel, state), "decode": partial(model.decode, pyramid)}, runs=2
            )
            step = seconds["encode"] + seconds["decode"]
            assert flops / step <= peak, f"{preset} {size} {precision}: faster than the machine's peak, miscounted"
            rows.append(
                {
                    "model": preset,
                    "size": size,
                    "precision": precision,
                    "attention": attention,
                    "channels_last": channels_last,
                    "encode_s": seconds["encode"],
                    "decode_s": seconds["decode"],
                    "gflop": flops / 1e9,
                    "gflop_per_s": flops / step / 1e9,
                    "times_floor": step * peak / flops,
                }
            )
    return rows


@torch.inference_mode()
def main() -> None:
    """Measure every model, size and precision that runs at a useful speed here."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--threads", type=int, default=torch.get_num_threads())
    torch.set_num_threads(parser.parse_args().threads)
    precisions = ["fp32", *(["bf16"] if bf16_is_worth_trying() else [])]
    if len(precisions) == 1:
        print("bf16 is left out: a small product is slower in it than in fp32 on this processor")
    rows: list[dict[str, object]] = []
    for precision in precisions:
        peak = matmul_peak(precision)
        rows.append({"matmul_peak": precision, "gflop_per_s": peak / 1e9, "threads": torch.get_num_threads()})
        for preset in ("etnet-half", "etnet"):
            for size in SIZES:
                rows += measure(preset, size, precision, peak)
    report("step", rows)


if __name__ == "__main__":
    main()

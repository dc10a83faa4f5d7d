"""One step of `etnet-half` and `etnet` at four sensor sizes, before and after packing, beside the machine's own peaks.

Before: torch's own layers and attention, contiguous, autocast in bf16. After: `default_runtime`. The stages between
show what each part of the work gained. With one thread the clock is the process's own time, so that what else runs on
the machine matters less; with more it is the wall's. Two floors: FLOPs ÷ the best square matrix product (the library
that torch calls for it), and ÷ the best product or convolution of oneDNN, which no step can beat: a result above that
would be a mistake in the counting and fails the benchmark.
"""

import argparse
import time
from collections.abc import Callable
from functools import partial

import torch
from measure import best_of_each, report
from torch.utils.flop_counter import FlopCounterMode

from etnet.nets.attention_kernels import has_onednn
from etnet.nets.base import Reconstructor
from etnet.nets.padding import TokenGrid
from etnet.nets.precision import bf16_is_worth_trying
from etnet.nets.presets import build_model
from etnet.nets.runtime import Runtime, apply_runtime, default_runtime, device_of, isa_of_machine

SIZES = {"240x180": (180, 240), "346x260": (260, 346), "640x480": (480, 640), "1280x720": (720, 1280)}
DTYPES = {"fp32": torch.float32, "bf16": torch.bfloat16}
PEAK_SIZES = (256, 384, 512, 768, 1024, 1536)


def stages(precision: str, device: str) -> dict[str, Runtime]:
    """The ways to run, in the order of the work."""
    before = Runtime(precision)  # type: ignore[arg-type]
    if device != "cpu" or not has_onednn():
        return {"before": before, "after": default_runtime(precision, device)}  # type: ignore[arg-type]
    return {
        "before": before,
        "channels-last": Runtime(precision, channels_last=True),  # type: ignore[arg-type]
        "packed": Runtime(precision, channels_last=True, packed=True),  # type: ignore[arg-type]
        "after": default_runtime(precision),  # type: ignore[arg-type]
    }


def peaks(precision: str, device: str, clock: Callable[[], float]) -> tuple[float, float]:
    """FLOP/s of the best square matrix product, and of the best product of any library."""
    matrix_peak = best = 0.0
    for size in PEAK_SIZES:
        matrix = torch.ones(size, size, dtype=DTYPES[precision], device=device)
        calls = {"matrix": lambda matrix=matrix: matrix @ matrix}
        if device == "cpu" and has_onednn():
            product = torch.ops.mkldnn._linear_pointwise
            calls["onednn"] = lambda matrix=matrix, product=product: product(matrix, matrix, None, "none", [], "")
        seconds = best_of_each({name: _synchronised(call, device) for name, call in calls.items()}, 5, clock)
        matrix_peak = max(matrix_peak, 2 * size**3 / seconds["matrix"])
        best = max(best, 2 * size**3 / min(seconds.values()))
    return matrix_peak, best


def count_flops(model: Reconstructor, size: tuple[int, int]) -> int:
    """Multiplications and additions of one step, attention spelled out.

    All layers cost a·N and all maps b·N² of N tokens, so two small grids tell both and nothing large is run.
    """
    apply_runtime(model, Runtime(attention="plain"))  # type: ignore[arg-type]
    counted = []
    for side in (64, 128):
        with FlopCounterMode(display=False) as counter:
            model(torch.zeros(1, model.bins, side, side, device=device_of(model)))
        counted.append(counter.get_total_flops())
    small, large = 8 * 8, 16 * 16
    square = (counted[1] / large - counted[0] / small) / (large - small)
    tokens = TokenGrid(*size).num_tokens
    return round((counted[0] / small - square * small) * tokens + square * tokens**2)


def measure(
    preset: str, size: str, precision: str, which: list[str], runs: int, options: argparse.Namespace
) -> list[dict[str, object]]:
    """Encode, decode and whole step in each of the ways."""
    clock = time.process_time if options.threads == 1 and options.device == "cpu" else time.perf_counter
    matrix_peak, peak = peaks(precision, options.device, clock)
    model = build_model(preset).to(options.device)
    generator = torch.Generator().manual_seed(0)
    voxel = torch.randn(1, 5, *SIZES[size], generator=generator).to(options.device)
    flops, rows = count_flops(model, SIZES[size]), []
    for name in which:
        runtime = stages(precision, options.device)[name]
        apply_runtime(model, runtime)
        pyramid, state = model.encode(voxel)
        calls = {"encode": partial(model.encode, voxel, state), "decode": partial(model.decode, pyramid)}
        seconds = best_of_each({each: _synchronised(call, options.device) for each, call in calls.items()}, runs, clock)
        step = seconds["encode"] + seconds["decode"]
        assert flops / step <= peak * 1.02, f"{preset} {size} {precision}: faster than the machine's peak, miscounted"
        rows.append(
            {
                "model": preset,
                "size": size,
                "precision": precision,
                "stage": name,
                "attention": runtime.attention,
                "encode_ms": seconds["encode"] * 1e3,
                "decode_ms": seconds["decode"] * 1e3,
                "step_ms": step * 1e3,
                "gflop": flops / 1e9,
                "times_matrix_floor": step * matrix_peak / flops,
                "times_best_floor": step * peak / flops,
            }
        )
        print(rows[-1], flush=True)
    return rows


def _synchronised(call: Callable[[], object], device: str) -> Callable[[], object]:
    def whole() -> None:
        call()
        if device != "cpu":
            torch.cuda.synchronize()

    return whole


@torch.inference_mode()
def main() -> None:
    """Measure every model, size and precision that runs at a useful speed here."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--threads", type=int, default=torch.get_num_threads())
    parser.add_argument("--device", default="cpu")
    parser.add_argument("--sizes", nargs="+", default=list(SIZES))
    parser.add_argument("--models", nargs="+", default=["etnet-half", "etnet"])
    parser.add_argument("--runs", type=int, default=3)
    parser.add_argument("--stages", nargs="*", default=[], help="only these of: before, channels-last, packed, after")
    parser.add_argument("--name", default="step")
    options = parser.parse_args()
    torch.set_num_threads(options.threads)
    precisions = ["fp32", *(["bf16"] if bf16_is_worth_trying(options.device) else [])]
    if len(precisions) == 1:
        print("bf16 is left out: a small product is slower in it than in fp32 on this processor")
    about: dict[str, object] = {"threads": options.threads, "device": options.device, "isa": isa_of_machine()}
    rows = [about]
    for preset in options.models:
        for size in options.sizes:
            is_large = SIZES[size][0] > 300 and options.device == "cpu"
            for precision in precisions:
                which = ["before", "after"] if is_large else list(stages(precision, options.device))
                which = [name for name in which if not options.stages or name in options.stages]
                rows += measure(preset, size, precision, which, 0 if is_large else options.runs, options)
    report(options.name, rows)


if __name__ == "__main__":
    main()

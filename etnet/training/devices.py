"""Where a run computes: the processor, or a GPU, which is given work ahead and is waited for as rarely as possible."""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterator, Mapping, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from typing import Any, TypeVar

import torch
from torch import Tensor

from etnet.training.config import TrainDevice, TrainingError

Item = TypeVar("Item")


def decided_device(wanted: TrainDevice) -> TrainDevice:
    """ "auto" is the GPU where there is one, else the processor."""
    if wanted == "cpu" or torch.cuda.is_available():
        return "cpu" if wanted == "cpu" else "cuda"
    if wanted == "auto":
        return "cpu"
    raise TrainingError(
        "device is cuda, but torch finds no GPU here; train with --device cpu, or auto for what there is"
    )


def finish(device: torch.device) -> None:
    """Until everything that a device was given is done."""
    if device.type == "cuda":
        torch.cuda.synchronize(device)


def on_host(value: Any) -> Any:
    """The same mappings, lists and tuples with every tensor in the processor's memory."""
    if isinstance(value, Tensor):
        return value.cpu()
    if isinstance(value, Mapping):
        return {name: on_host(item) for name, item in value.items()}
    return type(value)(on_host(item) for item in value) if isinstance(value, (list, tuple)) else value


def numbers_of(lines: Sequence[Mapping[str, Tensor | float]]) -> list[dict[str, float]]:
    """Lines of scalars as numbers; what lies on a device is read at once."""
    if not lines:
        return []
    names = [name for name, value in lines[0].items() if isinstance(value, Tensor)]
    read = torch.stack([torch.stack([torch.as_tensor(line[name]) for name in names]) for line in lines]).tolist()
    told = (dict(zip(names, row, strict=True)) for row in read)
    return [
        {name: float(value) for name, value in {**line, **row}.items()} for line, row in zip(lines, told, strict=True)
    ]


def ahead(items: Iterator[Item], make: Callable[[Item], Item]) -> Generator[Item]:
    """Every item as `make` makes it. A thread makes the first at once, and each next one while one is used."""
    thread = ThreadPoolExecutor(1, thread_name_prefix="ahead")

    def one() -> Item | None:
        item = next(items, None)
        return None if item is None else make(item)

    def in_order(coming: Future[Item | None]) -> Generator[Item]:
        with thread:
            while (item := coming.result()) is not None:
                coming = thread.submit(one)
                yield item

    return in_order(thread.submit(one))

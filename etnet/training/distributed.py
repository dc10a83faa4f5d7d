"""Several processes that train one network (torchrun; gloo or nccl): each has its own clips, all the same weights."""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass

import torch
from torch import Tensor, distributed, nn

from etnet.training.config import TrainDevice, TrainingError
from etnet.training.devices import decided_device


@dataclass(frozen=True, slots=True)
class World:
    """This process among all."""

    rank: int = 0
    size: int = 1

    @property
    def leads(self) -> bool:
        """Whether this process writes logs and checkpoints."""
        return self.rank == 0

    def lanes(self, clips: int) -> range:
        """Which of an update's clips are this process's."""
        if clips % self.size:
            raise TrainingError(f"a stage has {clips} clips an update; that does not divide by {self.size} processes")
        share = clips // self.size
        return range(self.rank * share, (self.rank + 1) * share)

    def average_gradients(self, parameters: Iterable[nn.Parameter]) -> None:
        """The mean of every gradient over all processes, in one message. All must have the same ones."""
        if self.size == 1:
            return
        gradients = [parameter.grad for parameter in parameters if parameter.grad is not None]
        flat = torch.cat([gradient.flatten() for gradient in gradients])
        distributed.all_reduce(flat)
        flat /= self.size
        start = 0
        for gradient in gradients:
            gradient.copy_(flat[start : start + gradient.numel()].view_as(gradient))
            start += gradient.numel()

    def share_of(self, count: int, device: torch.device) -> Tensor | float:
        """What a mean over `count` things of this process counts, so that the mean over all processes is one over all
        their things. All have to ask."""
        if self.size == 1:
            return 1.0
        total = torch.full((), float(count), device=device)
        distributed.all_reduce(total)
        return count * self.size / total.clamp_min(1.0)

    def gathered(self, own: Tensor) -> Tensor:
        """Every process's rows, in the order of ranks."""
        if self.size == 1:
            return own
        parts = [torch.empty_like(own) for _ in range(self.size)]
        distributed.all_gather(parts, own.contiguous())
        return torch.cat(parts)

    def any_says(self, holds: bool, device: torch.device) -> bool:
        """Whether it holds for any process. All have to ask."""
        if self.size == 1:
            return holds
        told = torch.tensor(float(holds), device=device)
        distributed.all_reduce(told, distributed.ReduceOp.MAX)
        return bool(told)

    def wait(self) -> None:
        """Until every process is here."""
        if self.size > 1:
            distributed.barrier()


@contextmanager
def joined(device: TrainDevice = "cpu") -> Iterator[World]:
    """The world that torchrun's environment describes; one process alone without it. On GPUs each process has one."""
    size = int(os.environ.get("WORLD_SIZE", "1"))
    if size == 1:
        yield World()
        return
    uses_gpu = decided_device(device) == "cuda"
    if uses_gpu:
        torch.cuda.set_device(int(os.environ.get("LOCAL_RANK", "0")))
    distributed.init_process_group("nccl" if uses_gpu else "gloo")
    try:
        yield World(distributed.get_rank(), size)
    finally:
        distributed.destroy_process_group()

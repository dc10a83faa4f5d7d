"""What a run tells: one JSON object a line, TensorBoard where it is installed, previews as pictures."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from torch import Tensor

from etnet.files import write_atomically

LOG = "log.jsonl"


class RunLog:
    """Appends to `log.jsonl`; lines of updates after `update` belong to an interrupted run and are dropped."""

    def __init__(self, folder: Path, update: int) -> None:
        folder.mkdir(parents=True, exist_ok=True)
        self._folder = folder
        self._path = folder / LOG
        kept = [line for line in read_log(folder) if line["update"] <= update]
        write_atomically(self._path, "".join(json.dumps(line) + "\n" for line in kept).encode())
        self._board = _tensorboard(folder)

    def write(self, kind: str, update: int, numbers: Mapping[str, Any]) -> None:
        """One line: {"kind", "update", …}."""
        with open(self._path, "a") as file:
            file.write(json.dumps({"kind": kind, "update": update, **numbers}) + "\n")
        if self._board is not None:
            for name, value in _flat(kind, numbers):
                self._board.add_scalar(name, value, update)

    def preview(self, update: int, frames: Tensor, targets: Tensor) -> None:
        """Pairs of a frame (above) and its target (below), b 1 h w in 0 … 1, shown with a gamma of 2.2."""
        rows = [np.concatenate(list(images.clamp(0, 1)[:, 0].cpu().numpy()), axis=1) for images in (frames, targets)]
        picture = (np.concatenate(rows) ** (1 / 2.2) * 255).round().astype(np.uint8)
        cv2.imwrite(str(self._folder / f"preview_{update:07d}.png"), picture)


def read_log(folder: Path) -> list[dict[str, Any]]:
    """The lines of a run's log; a last line that was cut off is left out."""
    path = folder / LOG
    lines = []
    for line in path.read_text().splitlines() if path.exists() else []:
        try:
            lines.append(json.loads(line))
        except json.JSONDecodeError:
            break
    return lines


def _tensorboard(folder: Path) -> Any | None:
    try:
        from torch.utils.tensorboard import SummaryWriter
    except ImportError:
        return None
    return SummaryWriter(str(folder / "tensorboard"))


def _flat(prefix: str, numbers: Mapping[str, Any]) -> Iterator[tuple[str, float]]:
    for name, value in numbers.items():
        if isinstance(value, Mapping):
            yield from _flat(f"{prefix}/{name}", value)
        elif isinstance(value, (int, float)):
            yield f"{prefix}/{name}", float(value)

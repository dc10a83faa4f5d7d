"""A learned interpolator that a user brings as ONNX; none is bundled.

RIFE's layout: two pictures (1 3 h w, values 0 … 1) and a moment between them, as inputs img0, img1 and timestep, or all
stacked along the channels (1 7 h w); the answer is a picture. Sides are padded to a multiple of 32. It runs in OpenCV.
"""

from __future__ import annotations

from pathlib import Path
from threading import Lock

import cv2
import numpy as np

from etnet.errors import EtnetError
from etnet.simulation.motion import Level

_MULTIPLE = 32
_INPUTS = ("img0", "img1", "timestep")


class LearnedInterpolator:
    """Two log images and a share of the way give the log image there. Safe from every thread, one call at a time.

    The network sees each pair between its own darkest and brightest value, because it was trained on pictures.
    """

    def __init__(self, path: Path) -> None:
        if not path.is_file():
            raise EtnetError(f"{path.name}: there is no such interpolator; give an ONNX file in RIFE's layout")
        try:
            self._network = cv2.dnn.readNetFromONNX(str(path))
        except cv2.error as error:
            raise EtnetError(f"{path.name}: OpenCV cannot read it as a network ({_line(error)})") from error
        self._path, self._lock = path, Lock()

    def __call__(self, before: Level, after: Level, share: float) -> Level:
        low = min(float(before.min()), float(after.min()))
        reach = max(float(before.max()), float(after.max())) - low or 1.0
        height, width = before.shape
        padding = [(0, -height % _MULTIPLE), (0, -width % _MULTIPLE)]
        first, second = (np.pad((level - low) / reach, padding, mode="edge") for level in (before, after))
        moment = np.full(first.shape, share, np.float32)
        stacked = np.stack([first] * 3 + [second] * 3 + [moment])[None].astype(np.float32)
        with self._lock:
            try:
                answer = self._asked(stacked)
            except cv2.error as error:
                wanted = "does not take two pictures and a moment"
                raise EtnetError(f"{self._path.name}: {wanted} ({_line(error)})") from error
        if answer.ndim != 4 or answer.shape[-2:] != first.shape:
            raise EtnetError(f"{self._path.name}: answers {answer.shape}; wanted a picture of {first.shape}")
        level = answer[0].mean(0)[:height, :width] * np.float32(reach) + np.float32(low)
        return np.ascontiguousarray(level, np.float32)

    def _asked(self, stacked: np.ndarray) -> np.ndarray:
        try:
            self._network.setInput(stacked)
            return np.asarray(self._network.forward())
        except cv2.error:
            for name, part in zip(_INPUTS, (stacked[:, :3], stacked[:, 3:6], stacked[:, 6:]), strict=False):
                self._network.setInput(np.ascontiguousarray(part), name)
            return np.asarray(self._network.forward())


def _line(error: BaseException) -> str:
    return " ".join(str(error).split())[:160]

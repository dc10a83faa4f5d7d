"""Photos and cut-outs in a given number of bytes, under their own names, because names decide what is held out."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np

from etnet.simulation.pictures import SOURCE_WEIGHTS, pictures_in, read_cutout, read_photo, source_of
from etnet.training.config import TrainConfig, TrainingError

VIEWS = 4
"""A photo's longer side is at most so many views: every share of it from a quarter of each side up is then seen as
sharply as before, and photos up to four times as long as wide fill a view without being enlarged."""
CUTOUT_REACH = 2
"""A cut-out's longer side is at most so many times the largest object: it is drawn shrunk in any case."""
WAYS = (*((1.0, quality) for quality in (95, 92, 90, 88, 85, 80)), (0.85, 80), (0.7, 80), (0.55, 80))
"""(share of the largest side, WebP quality) that are tried until all pictures fit."""


@dataclass(frozen=True, slots=True)
class Limits:
    """Longest sides in pixels at which nothing is lost for the sizes that a run trains and is validated at."""

    photo: int
    cutout: int

    @staticmethod
    def of(config: TrainConfig) -> Limits:
        """For all stages of a run, and its validation."""
        sizes = [stage.size for stage in config.stages if stage.updates]
        sizes += [config.validation.size] if config.validation.every else []
        largest = config.data.scene.object_size[1] * max(min(size) for size in sizes)
        return Limits(VIEWS * max(max(size) for size in sizes), math.ceil(CUTOUT_REACH * largest))


@dataclass(frozen=True, slots=True)
class PackedPictures:
    """What became of the pictures: how many, in how many bytes, and in which words they are coded."""

    count: int
    num_bytes: int
    how: str


def pack_pictures(config: TrainConfig, photos: Path, cutouts: Path, max_bytes: int) -> PackedPictures:
    """Write the pictures that a run may draw into the folders `photos` and `cutouts`, at most `max_bytes` together.

    Files are copied where all of them fit. Else each is shrunk to `Limits` and coded again, unless it is smaller as it
    is; all alike, as well as the bytes allow. A WebP file may then bear the name of a JPEG: what reads it looks inside.
    """
    from_photos = [path for path in _listed(config.data.photos) if SOURCE_WEIGHTS.get(source_of(path), 1.0) > 0]
    files = [(path, photos / path.name, False) for path in from_photos]
    files += [(path, cutouts / path.name, True) for path in _listed(config.data.cutouts)]
    total = sum(path.stat().st_size for path, _, _ in files)
    if total <= max_bytes:
        for path, target, _ in files:
            _write(target, path.read_bytes())
        return PackedPictures(len(files), total, "as they were")
    limits = Limits.of(config)
    for share, quality in WAYS:
        coded: list[tuple[Path, bytes]] = []
        total = 0
        for target, content in _coded(files, limits, share, quality):
            coded.append((target, content))
            total += len(content)
            if total > max_bytes:
                break
        else:
            for target, content in coded:
                _write(target, content)
            shrunk = f", {share:.0%} of the size that loses nothing" if share < 1 else ""
            return PackedPictures(len(files), total, f"WebP of quality {quality}{shrunk}")
    bound = f"{max_bytes / 1e6:g} MB"
    raise TrainingError(f"{len(files)} pictures do not fit in {bound}; leave some out, or raise --pack-megabytes")


def _listed(folder: Path | None) -> list[Path]:
    return [] if folder is None else pictures_in(folder)


def _coded(
    files: list[tuple[Path, Path, bool]], limits: Limits, share: float, quality: int
) -> Iterator[tuple[Path, bytes]]:
    for path, target, is_cutout in files:
        side = max(1, round(share * (limits.cutout if is_cutout else limits.photo)))
        picture = _pixels(path, is_cutout)
        is_small = max(picture.shape[:2]) <= side
        content = _webp(picture if is_small else _shrunk(picture, side), quality)
        yield target, path.read_bytes() if is_small and path.stat().st_size <= len(content) else content


def _pixels(path: Path, is_cutout: bool) -> np.ndarray:
    """Grey in three channels, as WebP has no grey, and alpha behind them."""
    if not is_cutout:
        return cv2.cvtColor(read_photo(path), cv2.COLOR_GRAY2BGR)
    cutout = read_cutout(path)
    return np.dstack([cutout.picture, cutout.picture, cutout.picture, cutout.alpha])


def _shrunk(picture: np.ndarray, side: int) -> np.ndarray:
    share = side / max(picture.shape[:2])
    size = (max(1, round(picture.shape[1] * share)), max(1, round(picture.shape[0] * share)))
    return cv2.resize(picture, size, interpolation=cv2.INTER_AREA)


def _webp(picture: np.ndarray, quality: int) -> bytes:
    done, content = cv2.imencode(".webp", picture, [cv2.IMWRITE_WEBP_QUALITY, quality])
    assert done
    return content.tobytes()


def _write(target: Path, content: bytes) -> None:
    target.parent.mkdir(parents=True, exist_ok=True)
    target.write_bytes(content)

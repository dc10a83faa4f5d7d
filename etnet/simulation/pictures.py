"""The pictures that scenes are made of: photos and cut-outs, decoded once to grey."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

import cv2
import numpy as np
from jaxtyping import Float32, Float64, UInt8

from etnet.errors import EtnetError

Grey = UInt8[np.ndarray, "h w"]
Greys = Sequence[UInt8[np.ndarray, "_ _"]]
"""Pictures of any sizes."""
Split = Literal["train", "held-out", "all"]

SOURCE_WEIGHTS: Mapping[str, float] = {"tfflowers": 0.3, "skimage": 0.0}
"""How often a source (the file name up to "__") is drawn; 1 for others. Flowers would be a third of the training
photos; scikit-image's pictures make the bundled samples, so no weights may have seen them."""


class PictureError(EtnetError):
    """Pictures are missing or cannot be decoded."""


def _srgb_to_linear_table() -> Float32[np.ndarray, " 256"]:
    code = np.arange(256) / 255.0
    return np.where(code <= 0.04045, code / 12.92, ((code + 0.055) / 1.055) ** 2.4).astype(np.float32)


SRGB_TO_LINEAR = _srgb_to_linear_table()
"""Linear light in 0 … 1 of each 8-bit sRGB code (IEC 61966-2-1)."""


def linear_of(picture: Grey) -> Float32[np.ndarray, "h w"]:
    """Linear light in 0 … 1 of an 8-bit sRGB picture."""
    return SRGB_TO_LINEAR[picture]


def srgb_of(linear: Float32[np.ndarray, "*shape"]) -> Float32[np.ndarray, "*shape"]:
    """sRGB tone in 0 … 1 of linear light in 0 … 1 (IEC 61966-2-1)."""
    curved = 1.055 * np.power(np.maximum(linear, 0.0031308), 1 / 2.4) - 0.055
    return np.where(linear <= 0.0031308, linear * 12.92, curved).astype(np.float32)


def is_held_out(name: str) -> bool:
    """Whether the picture of this file name is kept for validation: one in ten, by the name's hash alone."""
    return int.from_bytes(hashlib.sha256(name.encode()).digest()[:4], "big") % 10 == 0


@dataclass(frozen=True, slots=True)
class Cutout:
    """An object cut from its picture; `alpha` 255 is the object."""

    picture: Grey
    alpha: Grey


@dataclass(frozen=True, eq=False)
class PicturePool:
    """Photos and cut-outs in memory, 8-bit sRGB grey. Worker processes that fork share them."""

    photos: Greys
    weights: Float64[np.ndarray, " n"]
    cutouts: Sequence[Cutout] = ()
    names: Sequence[str] = field(default=(), repr=False)
    cutout_names: Sequence[str] = field(default=(), repr=False)
    split: Split | None = None
    """What was chosen of the folders, if they came from some."""

    def __post_init__(self) -> None:
        if not len(self.photos):
            raise PictureError("no photos: a scene needs at least one background; look at the folder and the split")
        if len(self.weights) != len(self.photos) or abs(float(self.weights.sum()) - 1) > 1e-6:
            raise ValueError(f"{len(self.weights)} weights for {len(self.photos)} photos; wanted one each, sum 1")

    @staticmethod
    def of(photos: Greys, cutouts: Sequence[Cutout] = ()) -> PicturePool:
        """A pool of pictures at hand, each as likely as the others."""
        return PicturePool(photos, np.full(len(photos), 1 / max(1, len(photos))), cutouts)

    @staticmethod
    def from_folder(
        photos: Path,
        cutouts: Path | None = None,
        split: Split = "train",
        source_weights: Mapping[str, float] = SOURCE_WEIGHTS,
        max_bytes: int = 256 << 20,
        progress: Callable[[float], None] | None = None,
    ) -> PicturePool:
        """Decode every JPEG, PNG and WebP of `photos` (and of `cutouts`, with their alpha) that is in `split`.

        Pictures are shrunk evenly if they would pass `max_bytes`. `progress` hears the fraction done.
        """
        chosen = [path for path in pictures_in(photos) if source_weights.get(source_of(path), 1.0) > 0]
        chosen = [path for path in chosen if split == "all" or is_held_out(path.name) == (split == "held-out")]
        objects = [] if cutouts is None else pictures_in(cutouts)
        objects = [path for path in objects if split == "all" or is_held_out(path.name) == (split == "held-out")]
        greys: list[Grey] = []
        for i, path in enumerate(chosen):
            greys.append(read_photo(path))
            if progress is not None:
                progress((i + 1) / (len(chosen) + len(objects)))
        shapes: list[Cutout] = []
        for i, path in enumerate(objects):
            shapes.append(read_cutout(path))
            if progress is not None:
                progress((len(chosen) + i + 1) / (len(chosen) + len(objects)))
        weights = np.array([source_weights.get(source_of(path), 1.0) for path in chosen], np.float64)
        if not len(weights):
            raise PictureError(f"{photos}: no picture of the split {split!r} in it; wanted .jpg, .png or .webp files")
        names, cutout_names = [path.name for path in chosen], [path.name for path in objects]
        return PicturePool(_within(greys, max_bytes), weights / weights.sum(), shapes, names, cutout_names, split)

    @property
    def names_digest(self) -> str:
        """A hash of the file names of photos and cut-outs."""
        listed = json.dumps([list(self.names), list(self.cutout_names)])
        return hashlib.sha256(listed.encode()).hexdigest()[:16]

    @property
    def num_bytes(self) -> int:
        """Memory held by the photos and cut-outs."""
        return sum(p.nbytes for p in self.photos) + sum(c.picture.nbytes + c.alpha.nbytes for c in self.cutouts)

    def draw_photo(self, rng: np.random.Generator) -> Grey:
        """A photo by the weights, mirrored half of the time."""
        photo = self.photos[int(rng.choice(len(self.photos), p=self.weights))]
        return photo[:, ::-1] if rng.random() < 0.5 else photo

    def draw_cutout(self, rng: np.random.Generator) -> Cutout | None:
        """A cut-out; None where the pool has none."""
        return self.cutouts[int(rng.integers(len(self.cutouts)))] if len(self.cutouts) else None


def source_of(path: Path) -> str:
    """Where a picture comes from, by its file's name."""
    return path.name.split("__", 1)[0]


def pictures_in(folder: Path) -> list[Path]:
    """The pictures of a folder by name."""
    if not folder.is_dir():
        raise PictureError(f"{folder}: no such folder; name one that holds .jpg, .png or .webp pictures")
    return sorted(path for path in folder.iterdir() if path.suffix.lower() in {".jpg", ".jpeg", ".png", ".webp"})


def _read(path: Path, flags: int) -> UInt8[np.ndarray, "*shape"]:
    picture = cv2.imread(str(path), flags)
    if picture is None or picture.dtype != np.uint8:
        raise PictureError(f"{path}: not an 8-bit picture that can be decoded; remove it or convert it")
    return picture


def read_photo(path: Path) -> Grey:
    """A photo's grey."""
    return _read(path, cv2.IMREAD_GRAYSCALE)


def read_cutout(path: Path) -> Cutout:
    """An object with its alpha."""
    picture = _read(path, cv2.IMREAD_UNCHANGED)
    if picture.ndim != 3 or picture.shape[2] != 4:
        raise PictureError(f"{path}: a cut-out needs an alpha channel, this has none; remove it")
    return Cutout(cv2.cvtColor(picture, cv2.COLOR_BGRA2GRAY), np.ascontiguousarray(picture[:, :, 3]))


def _within(pictures: Greys, max_bytes: int) -> Greys:
    total = sum(picture.nbytes for picture in pictures)
    if total <= max_bytes:
        return pictures
    share = (max_bytes / total) ** 0.5
    sizes = [(max(8, int(p.shape[1] * share)), max(8, int(p.shape[0] * share))) for p in pictures]
    return [cv2.resize(p, size, interpolation=cv2.INTER_AREA) for p, size in zip(pictures, sizes, strict=True)]

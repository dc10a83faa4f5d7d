"""Pictures and optical flow in HDF5 files, read one at a time."""

from __future__ import annotations

from collections.abc import Iterator
from threading import Lock

import h5py
import numpy as np
from jaxtyping import Float32, Int64

from etnet.errors import RecordingError
from etnet.events.assumptions import TimeUnit
from etnet.events.events import Sensor
from etnet.events.formats.base import Remarks, contained
from etnet.events.formats.bounds import check_pixels
from etnet.events.formats.column_finder import Tree, words_of
from etnet.events.formats.column_names import named_axis
from etnet.events.formats.columns import stamps_in_microseconds
from etnet.events.formats.frame_range import is_colours_first
from etnet.events.formats.frames import Frames, ReadFlow, check_frames
from etnet.events.formats.hdf5.file import dataset, find

_NO_PICTURES = ("flow", "depth", "mask", "label", "disparity", "rectify", "map", "pose", "calib")
_PICTURE_WORDS = ("image", "images", "frame", "frames", "gray", "grey", "aps", "rgb", "data", "img")
_STAMP_ENDINGS = ("_ts", "_timestamps", "_timestamp", "_t", "_time", "_times")


def numbered_frames(file: h5py.File, name: str, max_pixels: int, remarks: Remarks) -> Frames | None:
    """event_utils' images/image000000000 …, each with its `timestamp`; flow/flow000000000 … where there is."""
    images, stamps = _numbered(file, "images", name)
    there = sum(any(letter.isdigit() for letter in member) for member in _members(file, "images", name))
    if there > len(images):
        remarks.repaired(f"{there - len(images)} of {there} images have no attribute timestamp and were left out")
    if not images:
        return None

    def read_raw(index: int) -> np.ndarray:
        picture = dataset(file, f"images/{images[index]}", name, ndim=None)
        check_pixels(picture.shape, f"{name}: frame {index}", max_pixels)
        return picture[()]

    def is_bgr(index: int) -> bool:
        return str(dataset(file, f"images/{images[index]}", name, ndim=None).attrs.get("type", "")) == "color_bgr"

    first = dataset(file, f"images/{images[0]}", name, ndim=None)
    usual: TimeUnit = "s" if stamps.dtype.kind == "f" else "us"
    return Frames(
        stamps,
        usual,
        read_raw,
        _size(first.shape, name, max_pixels),
        is_bgr,
        _white(first),
        lambda unit, stamps: _flow_reader(file, name, max_pixels, unit, stamps),
    )


def stacked_frames(file: h5py.File, path: str, stamps_path: str, name: str, max_pixels: int) -> Frames | None:
    """Pictures in one dataset (n × height × width, or with colours) with a dataset of their stamps."""
    pictures = dataset(file, path, name, ndim=None)
    stored = dataset(file, stamps_path, name, ndim=None)
    check_frames(int(stored.size or 0), f"{name}: {stamps_path}")
    stamps = np.asarray(stored[()]).reshape(-1)
    if pictures.ndim not in (3, 4) or len(pictures) != len(stamps):
        raise RecordingError(f"{name}: {path} has the shape {pictures.shape} for {len(stamps)} stamps; they must agree")
    if len(stamps) == 0:
        return None
    size = _size(pictures.shape[1:], f"{name}: {path}", max_pixels)
    usual: TimeUnit = "s" if stamps.dtype.kind == "f" else "us"
    return Frames(stamps, usual, lambda index: pictures[index], size, white=_white(pictures))


def _white(pictures: h5py.Dataset) -> float | None:
    """What the file itself says is white."""
    white = pictures.attrs.get("white")
    return float(white) if isinstance(white, (int, float, np.number)) and white > 0 else None


def stacked_pair(tree: Tree) -> tuple[str, str] | None:
    """The dataset of pictures, left before right, and the one of their stamps; None where there is no such pair."""
    found = []
    for path, is_picture in _stacks(tree):
        stamps = _stamps_of(tree, path, tree[path].shape[0])
        if stamps is not None:
            found.append((not is_picture, "right" in words_of(path), path, stamps))
    return min(found)[2:] if found else None


def stack_without_stamps(tree: Tree) -> str | None:
    """A dataset that is called like pictures and has their shape."""
    return next((path for path, is_picture in _stacks(tree) if is_picture), None)


def _stacks(tree: Tree) -> Iterator[tuple[str, bool]]:
    """Datasets with the shape of many pictures, and whether they are called so."""
    for path, leaf in tree.items():
        words = words_of(path)
        is_like = len(leaf.shape) in (3, 4) and leaf.shape[0] > 1 and leaf.dtype.kind in "iuf"
        if is_like and not any(word in _NO_PICTURES for word in words):
            yield path, any(word in _PICTURE_WORDS for word in words)


def _stamps_of(tree: Tree, path: str, count: int) -> str | None:
    group = path.rpartition("/")[0]
    beside = [path + ending for ending in _STAMP_ENDINGS]
    for folder in (group, group.rpartition("/")[0]):
        prefix = folder + "/" if folder else ""
        inside = (key for key in tree if key.startswith(prefix) and "/" not in key[len(prefix) :])
        beside += [key for key in inside if (named_axis(key[len(prefix) :]) or ("",))[0] == "t"]
    fitting = (key for key in beside if key in tree and tree[key].is_vector and max(tree[key].shape) == count)
    return next(fitting, None)


def _size(shape: tuple[int, ...], where: str, max_pixels: int) -> Sensor:
    if len(shape) not in (2, 3) or 0 in shape or max(shape) > 65_536:
        raise RecordingError(f"{where} has the shape {shape}; wanted a picture")
    check_pixels(shape, where, max_pixels)
    if is_colours_first(shape):
        return Sensor(int(shape[2]), int(shape[1]))
    return Sensor(int(shape[1]), int(shape[0]))


def _members(file: h5py.File, group: str, name: str) -> list[str]:
    node = find(file, group, name)
    return sorted(node.keys()) if isinstance(node, h5py.Group) else []


def _numbered(file: h5py.File, group: str, name: str) -> tuple[list[str], np.ndarray]:
    """Members that have a stamp, and their stamps."""
    members, values = [], []
    check_frames(len(_members(file, group, name)), f"{name}: {group}")
    for member in _members(file, group, name):
        stamp = dataset(file, f"{group}/{member}", name, ndim=None).attrs.get("timestamp")
        if stamp is not None and np.size(stamp) == 1:
            members.append(member)
            values.append(np.asarray(stamp).ravel()[0])
    return members, np.array(values) if values else np.empty(0, np.float64)


def _flow_reader(
    file: h5py.File, name: str, max_pixels: int, unit: TimeUnit, stamps: Int64[np.ndarray, " n"]
) -> ReadFlow | None:
    flows, flow_stamps = _numbered(file, "flow", name)
    if not flows:
        return None
    flow_of = dict(zip(stamps_in_microseconds(flow_stamps, unit, name).tolist(), flows, strict=True))
    lock = Lock()

    def read_flow(index: int) -> Float32[np.ndarray, "2 h w"]:
        stamp = int(stamps[index])
        if stamp not in flow_of:
            raise RecordingError(f"{name}: no flow is stored for frame {index} at {stamp} µs")
        with lock, contained(name, f"flow {index}"):
            stored = dataset(file, f"flow/{flow_of[stamp]}", name, ndim=3)
            check_pixels(stored.shape[1:], f"{name}: flow {index}", max_pixels)
            flow = np.asarray(stored[()], np.float32)
        if flow.shape[0] != 2:
            raise RecordingError(f"{name}: flow {index} has the shape {flow.shape}; wanted (2, height, width)")
        # The layout stores a velocity (px/s): its loaders multiply by the time since the frame before.
        return flow * np.float32((stamp - int(stamps[index - 1])) * 1e-6 if index else 0.0)

    return read_flow

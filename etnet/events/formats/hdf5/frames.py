"""Frames and optical flow in HDF5 files, read one at a time."""

from __future__ import annotations

from threading import Lock

import h5py
import numpy as np
from jaxtyping import Float32

from etnet.errors import RecordingError
from etnet.events.assumptions import TimeUnit
from etnet.events.cache import grey
from etnet.events.formats.base import Remarks, contained
from etnet.events.formats.camera_frames import check_size, in_order
from etnet.events.formats.columns import stamps_in_microseconds
from etnet.events.formats.hdf5.file import dataset, find
from etnet.events.recording import GroundTruth


def numbered_frames(file: h5py.File, name: str, unit: TimeUnit, remarks: Remarks) -> GroundTruth | None:
    """event_utils' images/image000000000 …, each with its `timestamp`; flow/flow000000000 … where there is."""
    images = _numbered(file, "images", name)
    if not images:
        return None
    stamps = _stamps(file, "images", images, unit, name)
    lock = Lock()

    def read_frame(index: int) -> Float32[np.ndarray, "h w"]:
        with lock, contained(name, f"frame {index}"):
            picture = dataset(file, f"images/{images[index]}", name, ndim=None)
            check_size(picture.shape, f"{name}: frame {index}")
            is_bgr = str(picture.attrs.get("type", "")) == "color_bgr"
            return _pixels(picture[()], is_bgr, name, index)

    flows = _numbered(file, "flow", name)
    flow_of = dict(zip(_stamps(file, "flow", flows, unit, name).tolist(), flows, strict=True))

    def read_flow(index: int) -> Float32[np.ndarray, "2 h w"]:
        stamp = int(stamps[index])
        if stamp not in flow_of:
            raise RecordingError(f"{name}: no flow is stored for frame {index} at {stamp} µs")
        with lock, contained(name, f"flow {index}"):
            stored = dataset(file, f"flow/{flow_of[stamp]}", name, ndim=3)
            check_size(stored.shape[1:], f"{name}: flow {index}")
            flow = np.asarray(stored[()], np.float32)
        if flow.shape[0] != 2:
            raise RecordingError(f"{name}: flow {index} has the shape {flow.shape}; wanted (2, height, width)")
        # The layout stores a velocity (px/s): its loaders multiply by the time since the frame before.
        return flow * np.float32((stamp - int(stamps[index - 1])) * 1e-6 if index else 0.0)

    return in_order(stamps, GroundTruth(stamps, read_frame, read_flow if flows else None), remarks)


def stacked_frames(file: h5py.File, path: str, name: str, remarks: Remarks) -> GroundTruth | None:
    """MVSEC's image_raw (n × height × width) and image_raw_ts (epoch seconds)."""
    if find(file, path, name) is None or find(file, path + "_ts", name) is None:
        return None
    pictures = dataset(file, path, name, ndim=None)
    stamps = stamps_in_microseconds(dataset(file, path + "_ts", name)[:], "s", name)
    if pictures.ndim not in (3, 4) or len(pictures) != len(stamps):
        raise RecordingError(f"{name}: {path} has the shape {pictures.shape} for {len(stamps)} stamps; they must agree")
    if len(stamps) == 0:
        return None
    check_size(pictures.shape[1:], f"{name}: {path}")
    lock = Lock()

    def read_frame(index: int) -> Float32[np.ndarray, "h w"]:
        with lock, contained(name, f"frame {index}"):
            return _pixels(pictures[index], False, name, index)

    return in_order(stamps, GroundTruth(stamps, read_frame), remarks)


def _numbered(file: h5py.File, group: str, name: str) -> list[str]:
    node = find(file, group, name)
    return sorted(node.keys()) if isinstance(node, h5py.Group) else []


def _stamps(file: h5py.File, group: str, members: list[str], unit: TimeUnit, name: str) -> np.ndarray:
    values = []
    for member in members:
        stamp = dataset(file, f"{group}/{member}", name, ndim=None).attrs.get("timestamp")
        if stamp is None or np.size(stamp) != 1:
            raise RecordingError(f"{name}: {group}/{member} has no attribute timestamp; frames need their time")
        values.append(np.asarray(stamp).ravel()[0])
    column = np.array(values) if values else np.empty(0, np.float64)
    return stamps_in_microseconds(column, unit if column.dtype.kind != "f" or unit != "us" else "s", name)


def _pixels(picture: np.ndarray, is_bgr: bool, name: str, index: int) -> Float32[np.ndarray, "h w"]:
    if picture.ndim not in (2, 3) or picture.dtype.kind not in "uf" or 0 in picture.shape:
        raise RecordingError(f"{name}: frame {index} is {picture.dtype} of the shape {picture.shape}; wanted a picture")
    return grey(picture, is_bgr=is_bgr)

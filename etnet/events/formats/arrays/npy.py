"""numpy files: npz and npy with columns, records (tonic, N-ImageNet) or a table, and folders of npy columns.

EVREAL: ercanburak/EVREAL, tools/bag_to_npy.py (events_ts in s, events_xy, events_p, images, images_ts, metadata.json).
EVIMO2: better-flow/evimo (dataset_events_t in s, dataset_events_xy, dataset_events_p).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from etnet.errors import RecordingError
from etnet.events.events import Sensor
from etnet.events.formats.archive import FolderStore, Store, ZipStore
from etnet.events.formats.arrays.leaves import MAGIC, PICKLED, header_of, is_pickled, leaves_of, load_foreign, mapped
from etnet.events.formats.base import Format, Opened, Remarks, Request, contained
from etnet.events.formats.bounds import check_pixels
from etnet.events.formats.column_finder import Found, Leaf, Tree, find_events, rank_of
from etnet.events.formats.column_names import column_keys
from etnet.events.formats.declared_size import size_beside, unless_stated
from etnet.events.formats.foreign import listed
from etnet.events.formats.frame_range import is_colours_first
from etnet.events.formats.frames import Frames, check_frames, found_frames
from etnet.events.formats.metadata import metadata_of, metadata_size
from etnet.events.formats.open_columns import Table, open_table
from etnet.events.provenance import ATTRIBUTES, provenance_of

_BOX_FIELDS = {"w", "h", "class_id"}
_LONGEST_TEXT = 1 << 20
_NO_ATTRIBUTES: Mapping[str, Any] = {}


def found_in(tree: Tree, what: str, name: str, remarks: Remarks) -> Found:
    """The events in a tree of arrays; an error that says what is in it instead."""
    found = find_events(tree, remarks)
    if found is not None:
        if found.order:
            remarks.assumed(f"the four columns are {', '.join(found.order)}, judged by their values")
        return found
    if any(is_pickled(leaf) for leaf in tree.values()):
        raise RecordingError(f"{name}: {PICKLED}")
    for leaf in tree.values():
        if leaf.dtype.names is not None and len(_BOX_FIELDS & set(leaf.dtype.names)) >= 2:
            raise RecordingError(f"{name}: these are boxes (labels), not events; open the recording beside it")
    keys = column_keys(tree)
    odd = [key for key in (keys or {}).values() if not tree[key].is_numbers]
    if odd:
        raise RecordingError(
            f"{name}: its array {odd[0]} is of type {tree[odd[0]].dtype}; numbers are wanted there: save it as such"
        )
    said = ", ".join(f"{path or 'an array'} {_kind(leaf)}" for path, leaf in list(tree.items())[:8])
    raise RecordingError(
        f"{name}: {what} with {said or 'nothing'}; wanted x, y, t and p as columns or fields, or an n × 4 table"
    )


def _kind(leaf: Leaf) -> str:
    fields = leaf.dtype.names
    return f"of {', '.join(fields[:9])}" if fields is not None else f"{leaf.dtype} {leaf.shape}"


def _npy_tree(request: Request) -> dict[str, Leaf]:
    with contained(request.name, "the npy array"), request.path.open("rb") as stream:
        shape, dtype = header_of(stream)
    return {"": Leaf(shape, dtype, lambda: load_foreign(request.path, request.name, request))}


def _open_npy(request: Request) -> Opened:
    remarks = Remarks()
    with contained(request.name, "the npy array"):
        found = found_in(_npy_tree(request), "an npy array", request.name, remarks)
    return open_table(request, Table("npy array", found.columns, settled=found.unit), remarks)


def _open_npz(request: Request) -> Opened:
    """Only what is used is unpacked, into scratch, and stays there."""
    remarks = Remarks()
    store = ZipStore(request.path, request.resources)
    with contained(request.name, "the npz archive"):
        tree = leaves_of(store, request.members, request, mapped)
        found = found_in(tree, "an npz", request.name, remarks)
        declared = unless_stated(request, lambda: size_beside(tree, "", lambda _: _NO_ATTRIBUTES, request.name))
        made = {name: _short_text(tree[name]) for name in ATTRIBUTES if name in tree}
    opened = open_table(request, Table("npz columns", found.columns, declared, settled=found.unit), remarks)
    return replace(opened, provenance=provenance_of(made))


def _short_text(leaf: Leaf) -> bytes:
    is_text = leaf.shape == () and leaf.dtype.kind == "S" and leaf.dtype.itemsize <= _LONGEST_TEXT
    return bytes(leaf.open()[()]) if is_text else b""


def holds_events(request: Request) -> bool:
    """Whether an npy or npz is a table of events."""
    if request.head.startswith(MAGIC):
        return find_events(_npy_tree(request), Remarks()) is not None
    tree = leaves_of(ZipStore(request.path, request.resources), request.members, request, mapped)
    return find_events(tree, Remarks()) is not None


def folder_prefixes(members: tuple[str, ...]) -> list[str]:
    """The folders, as "a/b/" or "", whose npy files are columns; those of a left camera before those of a right one."""
    groups: dict[str, list[str]] = {}
    for member in members:
        folder, slash, last = member.rpartition("/")
        if last.lower().endswith(".npy"):
            groups.setdefault(folder + slash, []).append(last[: -len(".npy")])
    found = [
        prefix
        for prefix, names in groups.items()
        if column_keys([name.lower() for name in names]) is not None or "events_ts" in names
    ]
    return sorted(found, key=rank_of)


def _chosen_folder(request: Request, remarks: Remarks) -> str:
    """The one with the recording; an error that names them where there are several that are not left and right."""
    prefixes = folder_prefixes(request.members)
    left = [prefix for prefix in prefixes if not rank_of(prefix)[2]]
    if len(prefixes) > 1 and len(left) != 1:
        raise RecordingError(f"{request.name}: holds {listed([path or 'the top' for path in prefixes])}; name one")
    others = [prefix for prefix in prefixes if prefix != prefixes[0]]
    if others:
        remarks.detected(f"the recording is in {prefixes[0]}; of another camera, and not shown: {listed(others)}")
    return prefixes[0]


def _open_folder(request: Request) -> Opened:
    remarks = Remarks()
    store: Store = FolderStore(request.path) if request.path.is_dir() else ZipStore(request.path, request.resources)
    prefix = _chosen_folder(request, remarks)
    is_evreal = f"{prefix}events_ts.npy" in request.members
    kind = "EVREAL npy folder" if is_evreal else "npy folder"
    for part in ("xy", "p") if is_evreal else ():
        if f"{prefix}events_{part}.npy" not in request.members:
            raise RecordingError(f"{request.name}: events_{part}.npy is missing; an EVREAL folder needs it")
    if f"{prefix}dataset_events_t.npy" in request.members:
        kind = "EVIMO2 npy folder"
    with contained(request.name, "the npy columns"):
        inside = [
            member for member in request.members if member.startswith(prefix) and "/" not in member[len(prefix) :]
        ]
        tree = {path[len(prefix) :]: leaf for path, leaf in leaves_of(store, inside, request, mapped).items()}
        found = found_in(tree, "a folder of npy files", request.name, remarks)
        metadata = metadata_of(store, prefix, request.name)
        declared = unless_stated(request, lambda: metadata_size(metadata, request.name))
    frames = found_frames(lambda: _folder_frames(tree, request), request.name, remarks)
    usual = "s" if kind != "npy folder" else None
    table = Table(kind, found.columns, declared, settled=found.unit, usual=usual, frames=frames)
    return open_table(request, table, remarks)


def _folder_frames(tree: Tree, request: Request) -> Frames | None:
    """EVREAL's images.npy (n × height × width × 1) and images_ts.npy."""
    if "images" not in tree or "images_ts" not in tree:
        return None
    pictures = tree["images"].open()
    check_frames(int(np.prod(tree["images_ts"].shape)), f"{request.name}: images_ts.npy")
    stamps = np.asarray(tree["images_ts"].open()).reshape(-1)
    if pictures.ndim not in (3, 4) or len(pictures) != len(stamps):
        raise RecordingError(f"images.npy is {pictures.dtype} {pictures.shape} for {len(stamps)} stamps")
    check_pixels(pictures.shape[1:], f"{request.name}: images.npy", request.assume.max_pixels)
    height, width = pictures.shape[2:] if is_colours_first(pictures.shape[1:]) else pictures.shape[1:3]
    size = Sensor(int(width), int(height))
    return Frames(stamps, "s", lambda index: np.asarray(pictures[index]), size)


def _is_npz(request: Request) -> bool:
    is_zip = request.head[:4] == b"PK\x03\x04"
    return is_zip and bool(request.members) and all("/" not in m and m.endswith(".npy") for m in request.members)


def _is_folder(request: Request) -> bool:
    return bool(folder_prefixes(request.members)) and not (request.suffix == ".npz" and _is_npz(request))


NPY = Format("npy", (".npy",), lambda request: request.head[:6] == MAGIC, _open_npy, holds_events=holds_events)
EVREAL = Format("EVREAL npy", (".zip", ""), _is_folder, _open_folder)
NPZ = Format("npz", (".npz",), _is_npz, _open_npz, holds_events=holds_events)

"""An HDF5 file that is one of the numbered pieces of a recording."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from etnet.events.formats.base import Remarks, Request, contained
from etnet.events.formats.column_finder import find_events
from etnet.events.formats.hdf5.file import find, open_file
from etnet.events.formats.hdf5.layouts import frames_in, offset_in, size_in
from etnet.events.formats.hdf5.tree import check_columns, tree_of
from etnet.events.formats.piece import Piece


def hdf5_piece(request: Request, path: Path, label: str) -> Piece | None:
    """Its columns, read while the request's resources are held; None where it has none."""
    inner, remarks = replace(request, path=path, name=label), Remarks()
    file = open_file(inner)
    with contained(label, "HDF5"):
        tree = tree_of(file, label)
        found = find_events(tree, remarks)
        if found is None:
            return None
        check_columns(file, set(found.paths), label)
        if find(file, "ms_to_idx", label) is not None:
            found = replace(found, unit="us")
        offset = offset_in(file, inner) if find(file, "t_offset", label) is not None else 0
        frames = frames_in(inner, file, tree, remarks)
        if frames is not None and not isinstance(frames.is_bgr, bool):
            frames = replace(frames, is_bgr=frames.is_bgr(0))  # the file will not be open later
        return Piece(found, size_in(inner, file, tree, found.where), offset, frames)

"""A text that is one of the numbered pieces of a recording."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from etnet.events.formats.base import Remarks, Request
from etnet.events.formats.column_finder import Found
from etnet.events.formats.piece import Piece
from etnet.events.formats.text.layout import HEAD_BYTES, has_fraction, looks_like_events, text_layout
from etnet.events.formats.text.rows import text_pieces


def text_piece(request: Request, path: Path, label: str) -> Piece | None:
    """Its rows as columns in memory; None where it has none.

    Numbers stay as they are written, for the unit is judged of all pieces together.
    """
    with path.open("rb") as stream:
        head = stream.read(HEAD_BYTES)
        if not looks_like_events(head):
            return None
        layout, unit = text_layout(head, label, Remarks(), None, request.assume.sensor is not None)
        has_fractions = any(has_fraction(row[layout.columns.t]) for row in layout.sample)
        # To the parser fractions are seconds, which it turns into µs exactly, and whole numbers µs.
        columns = replace(
            layout.columns, unit="s" if has_fractions else "us", rounds=request.assume.pixels == "rounded"
        )
        stream.seek(layout.num_bytes)
        rows = list(text_pieces(stream, path.stat().st_size, columns, label, 1 + layout.num_lines))
    none = [np.empty(0, np.int64)]
    x, y, t, p = (np.concatenate([np.asarray(part[i], np.int64) for part in rows] or none) for i in range(4))
    stamps = t / 1e6 if has_fractions else t
    order = ", ".join(layout.names)
    return Piece(Found("", {"x": x, "y": y, "t": stamps, "p": p}, unit, order), layout.sensor)

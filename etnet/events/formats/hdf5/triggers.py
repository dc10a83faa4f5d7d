"""Triggers in HDF5 files of ours: `triggers/t` in µs, `channel` and `edge`, beside events of any layout."""

from __future__ import annotations

import h5py
import numpy as np

from etnet.errors import RecordingError
from etnet.events.formats.base import Remarks, contained
from etnet.events.formats.hdf5.file import dataset, find
from etnet.events.formats.trigger_table import MOST_TRIGGERS, TriggerTable
from etnet.events.triggers import Triggers

_COLUMNS = ("t", "channel", "edge")


def triggers_beside(file: h5py.File, name: str, remarks: Remarks) -> Triggers | None:
    """Those of the file; a fault of them never costs the events."""
    if any(find(file, f"triggers/{column}", name) is None for column in _COLUMNS):
        return None
    try:
        with contained(name, "the triggers"):
            stored = [dataset(file, f"triggers/{column}", name) for column in _COLUMNS]
            if len({column.shape for column in stored}) != 1 or any(column.dtype.kind not in "iu" for column in stored):
                raise RecordingError(f"{name}: triggers' t, channel and edge are no whole numbers of one length")
            columns = [np.asarray(column[:MOST_TRIGGERS]).astype(np.int64) for column in stored]
    except RecordingError as fault:
        remarks.repaired(f"the triggers were left out: {str(fault).removeprefix(f'{name}: ')}")
        return None
    if len(columns[0]) == 0:
        return None
    table = TriggerTable()
    table.add(columns[0], columns[1], np.sign(columns[2]))
    return table.triggers(remarks)

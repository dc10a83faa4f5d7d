"""HDF5 files over a file object of ours are closed before the interpreter ends.

HDF5 closes what is open when the C library exits. It then calls the file object, and Python is gone: the process ends
with signal 11. A thread that still holds such a file when a script ends is enough.
"""

from __future__ import annotations

import atexit
import contextlib
from functools import cache

import h5py
from h5py import h5f, h5fd, h5i  # pyright: ignore[reportAttributeAccessIssue]  they are compiled

_IN_FILES = h5f.OBJ_FILE | h5f.OBJ_GROUP | h5f.OBJ_DATASET | h5f.OBJ_ATTR


@cache
def close_at_exit() -> None:
    """See to it, once for the process. Call it before the first such file is opened."""
    atexit.register(_close_all)


def _close_all() -> None:
    """A data set keeps its file open, also when nobody holds the file itself."""
    for held in h5f.get_obj_ids(h5f.OBJ_ALL, _IN_FILES):
        # One that was closed together with an earlier one is no longer there to be asked.
        with contextlib.suppress(OSError, ValueError, RuntimeError, KeyError):
            file = h5i.get_file_id(held)
            if file.get_access_plist().get_driver() == h5fd.fileobj_driver:
                h5py.File(file).close()

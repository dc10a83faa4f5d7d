"""The table of formats. A file is asked by content in this order; its suffix decides where two fit."""

from __future__ import annotations

from etnet.events.formats.aedat4 import AEDAT4
from etnet.events.formats.arrays import EVREAL, NPY, NPZ
from etnet.events.formats.base import Format
from etnet.events.formats.dat import DAT
from etnet.events.formats.hdf5_layouts import HDF5
from etnet.events.formats.prophesee import RAW
from etnet.events.formats.text import TEXT, TEXT_STORE

FORMATS: tuple[Format, ...] = (HDF5, AEDAT4, RAW, DAT, NPY, EVREAL, NPZ, TEXT_STORE, TEXT)

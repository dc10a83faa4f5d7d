"""The table of formats. A file is asked by content in this order; its suffix decides where two fit."""

from __future__ import annotations

from etnet.events.formats.aedat2 import AEDAT2
from etnet.events.formats.aedat3 import AEDAT3
from etnet.events.formats.aedat4 import AEDAT4
from etnet.events.formats.arrays import EVREAL, NPY, NPZ
from etnet.events.formats.base import Format
from etnet.events.formats.dat import DAT
from etnet.events.formats.event_stream import EVENT_STREAM
from etnet.events.formats.forty_bits import FORTY_BITS
from etnet.events.formats.hdf5_layouts import HDF5
from etnet.events.formats.prophesee import RAW
from etnet.events.formats.ros_bags import MCAP, ROS1_BAG, ROS2_DATABASE, ROS2_FOLDER
from etnet.events.formats.text import TEXT, TEXT_STORE

FORMATS: tuple[Format, ...] = (
    HDF5,
    AEDAT4,
    AEDAT3,
    AEDAT2,
    RAW,
    DAT,
    EVENT_STREAM,
    ROS1_BAG,
    MCAP,
    ROS2_DATABASE,
    NPY,
    EVREAL,
    NPZ,
    ROS2_FOLDER,
    TEXT_STORE,
    TEXT,
    FORTY_BITS,
)

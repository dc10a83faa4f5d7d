"""The table of formats. A file is asked by content in this order; its suffix decides where two or none fit."""

from __future__ import annotations

from etnet.errors import RecordingError
from etnet.events.formats.aedat.aedat2 import AEDAT2
from etnet.events.formats.aedat.aedat3 import AEDAT3
from etnet.events.formats.aedat.aedat4 import AEDAT4
from etnet.events.formats.arrays.matlab import MATLAB_V5, MATLAB_V73
from etnet.events.formats.arrays.npy import EVREAL, NPY, NPZ
from etnet.events.formats.base import Format, Opened, Request, contained
from etnet.events.formats.chunks import CHUNKS
from etnet.events.formats.companions import folder_formats
from etnet.events.formats.compressed import packed_formats
from etnet.events.formats.event_stream import EVENT_STREAM
from etnet.events.formats.foreign import what_else
from etnet.events.formats.hdf5.layouts import HDF5
from etnet.events.formats.nmnist import FORTY_BITS
from etnet.events.formats.prophesee.dat import DAT
from etnet.events.formats.prophesee.raw import RAW
from etnet.events.formats.ros.bags import MCAP, ROS1_BAG, ROS2_DATABASE, ROS2_FOLDER
from etnet.events.formats.text.text import TEXT, TEXT_STORE

_PLAIN: tuple[Format, ...] = (
    MATLAB_V73,
    MATLAB_V5,
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
    CHUNKS,
    TEXT,
    FORTY_BITS,
)


def choose(request: Request, formats: tuple[Format, ...]) -> Format:
    """The first format that recognises the content; among several, one with the file's suffix. Content comes first."""
    with contained(request.name, "its beginning"):
        fitting = [entry for entry in formats if entry.recognises(request)]
    if not fitting:
        said = what_else(request.head)
        if said is not None:
            raise RecordingError(f"{request.name}: {said}")
        known = ", ".join(entry.name for entry in formats)
        begins = f"file that begins with {request.head[:8]!r}"
        raise RecordingError(f"{request.name}: a {begins} of no known format; read are {known}")
    fitting = [entry for entry in fitting if entry.is_known_by_content] or fitting
    if request.path.is_dir():
        return fitting[0]
    return next((entry for entry in fitting if request.suffix in entry.suffixes), fitting[0])


def _open_inner(request: Request) -> Opened:
    return choose(request, _PLAIN).open(request)


_SINGLE = tuple(entry for entry in _PLAIN if entry not in (EVREAL, ROS2_FOLDER, CHUNKS, TEXT_STORE))

_MIXED, _FOLDER = folder_formats(_SINGLE, TEXT_STORE.recognises)

FORMATS: tuple[Format, ...] = (_MIXED, *_PLAIN, *packed_formats(_open_inner), _FOLDER)

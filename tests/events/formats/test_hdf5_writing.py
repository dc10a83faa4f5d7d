"""A file that is written for hours holds no more of HDF5's own headers at its end than at its beginning."""

from contextlib import closing

import h5py
import numpy as np

from etnet.events.events import Sensor
from etnet.events.formats.hdf5.writing import METADATA_BYTES, hdf5_to_write
from etnet.live.hdf5_writer import Hdf5Writer
from etnet.live.source import CameraFrame

NUM_FRAMES = 2_000


def metadata_bytes(file: h5py.File) -> int:
    return file.id.get_mdc_size()[2]


def test_headers_of_many_pictures_are_not_held(tmp_path):
    with hdf5_to_write(tmp_path / "a.h5") as file:
        for number in range(NUM_FRAMES):
            file.create_dataset(f"images/{number:06d}", data=np.full((4, 4), number % 256, np.uint8))
        assert metadata_bytes(file) <= METADATA_BYTES
    with h5py.File(tmp_path / "a.h5") as file:
        assert [int(file[f"images/{number:06d}"][0, 0]) for number in (0, 1_000, NUM_FRAMES - 1)] == [0, 232, 207]


def test_nor_are_those_of_a_camera_that_is_recorded(tmp_path):
    with closing(Hdf5Writer(tmp_path / "a.h5", Sensor(4, 4), "a camera")) as writer:
        for number in range(NUM_FRAMES):
            writer.add_frame(CameraFrame(number * 1_000, np.full((4, 4), number % 256, np.uint8)), 0)
        writer.flush()
        assert metadata_bytes(writer._file) <= METADATA_BYTES
    with h5py.File(tmp_path / "a.h5") as file:
        assert len(file["images"]) == NUM_FRAMES

"""The real recordings, what they hold, and which of them are one recording in several containers."""

from __future__ import annotations

import numpy as np

from etnet.events.events import Events
from etnet.events.recording import Recording

COUNTS = {
    "ecd_slider_depth/slider_depth.zip": ((240, 180), 1_078_541, 87),
    "aedat4/davis346_street_0.17s.aedat4": ((346, 260), 6_676, 4),
    "aedat4/davis346_newtons_cradle_0.5s.aedat4": ((346, 260), 319_512, 13),
    "aedat4/dvxplorer_lite_face_headphones_1.5s.aedat4": ((320, 240), 323_963, 0),
    "aedat4/test_data_gray16.aedat4": ((2, 2), 0, 1),
    "prophesee/evt2_640x480_rotating_dot_0.05s.raw": ((640, 480), 539_481, 0),
    "prophesee/evt3_1280x720_night_lights_cut.raw": ((1280, 720), 101_325, 0),
    "prophesee/dat_ncars_sample.dat": ((78, 42), 2_009, 0),
    "derived/slider_depth_1.0s_event_utils.h5": ((240, 180), 311_110, 26),
    "derived/slider_depth_0.5s_mvsec.hdf5": ((240, 180), 146_168, 13),
    "derived/slider_depth_0.4s_evreal.zip": ((240, 180), 117_429, 11),
    "derived/slider_depth_1.4s_frames.aedat4": ((240, 180), 442_728, 37),
    "derived/davis346_aprilgrid_1.0s.aedat4": ((346, 260), 571_266, 0),
    "derived/davis346_aprilgrid_0.5s_evt2.raw": ((346, 260), 189_576, 0),
    "derived/davis346_aprilgrid_0.5s_evt3.raw": ((346, 260), 189_576, 0),
    "derived/davis346_aprilgrid_0.5s.dat": ((346, 260), 189_576, 0),
    "derived/davis346_aprilgrid_0.1s_tonic.npy": ((346, 260), 56_365, 0),
    "derived/dvxplorer_lite_face1_dsec.h5": ((320, 240), 323_963, 0),
    "aedat2/dvs128_checkerboard_flash.aedat": ((128, 128), 63_483, 0),
    "rosbag/event_camera_msgs_evt3_person_2.1s.bag": ((640, 480), 343_474, 0),
    "rosbag/event_camera_msgs_libcaer_cmp_aprilgrid_1.0s.mcap": ((346, 260), 571_266, 0),
    "bin/ncaltech101_faces_easy_0001.bin": ((151, 173), 67_445, 0),
    "bin/nmnist_digit4.bin": ((34, 34), 4_325, 0),
    "derived/slider_depth_0.3s_dvs_msgs.bag": ((240, 180), 87_478, 8),
    "derived/slider_depth_0.3s_v31.aedat": ((240, 180), 87_478, 8),
    "derived/davis346_aprilgrid_0.5s.es": ((346, 260), 189_576, 0),
    "derived/davis346_aprilgrid_0.3s_evt21.raw": ((346, 260), 151_503, 0),
    "derived/dvxplorer_lite_face1_metavision_ecf.h5": ((320, 240), 323_963, 0),
    "ecd_snippets/dynamic_rotation_snippet.txt": ((240, 180), 30_000, 0),
    "ecd_snippets/poster_rotation_snippet.txt": ((240, 180), 30_000, 0),
    "ecd_snippets/boxes_rotation_snippet.txt": ((240, 180), 30_000, 0),
    "ecd_snippets/shapes_rotation_snippet.txt": ((240, 180), 20_000, 0),
}
"""Sensor (width, height), events and frames of each file."""

SAME_RECORDING = (
    (
        "ecd_slider_depth/slider_depth.zip",
        "derived/slider_depth_1.0s_event_utils.h5",
        "derived/slider_depth_0.5s_mvsec.hdf5",
        "derived/slider_depth_0.4s_evreal.zip",
        "derived/slider_depth_1.4s_frames.aedat4",
        "derived/slider_depth_0.3s_dvs_msgs.bag",
        "derived/slider_depth_0.3s_v31.aedat",
    ),
    (
        "derived/davis346_aprilgrid_1.0s.aedat4",
        "derived/davis346_aprilgrid_0.5s_evt2.raw",
        "derived/davis346_aprilgrid_0.5s_evt3.raw",
        "derived/davis346_aprilgrid_0.5s.dat",
        "derived/davis346_aprilgrid_0.1s_tonic.npy",
        "derived/davis346_aprilgrid_0.5s.es",
        "rosbag/event_camera_msgs_libcaer_cmp_aprilgrid_1.0s.mcap",
    ),
    (
        "aedat4/dvxplorer_lite_face_headphones_1.5s.aedat4",
        "derived/dvxplorer_lite_face1_dsec.h5",
        "derived/dvxplorer_lite_face1_metavision_ecf.h5",
    ),
)
"""The first of each row is the longest; the others are its beginning."""

SAME_FRAMES = tuple(name for name in SAME_RECORDING[0][1:] if not name.endswith("v31.aedat"))
"""Containers with the frames of the first one, bit for bit. AEDAT 3.1 was given 16-bit pixels and exposures of 1 ms."""


def all_events(recording: Recording) -> Events:
    """Every event at once."""
    return recording.read(0, recording.num_events)


def assert_same_events(first: Events, second: Events) -> None:
    """Column by column: x, y, p and t − t[0]."""
    np.testing.assert_array_equal(first.x, second.x)
    np.testing.assert_array_equal(first.y, second.y)
    np.testing.assert_array_equal(first.p, second.p)
    np.testing.assert_array_equal(first.t - first.t[:1], second.t - second.t[:1])

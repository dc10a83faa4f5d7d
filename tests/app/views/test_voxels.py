"""The voxel grid's tiles."""

import numpy as np
import pytest

from app.html.moment import Moment
from app.views.voxels.html import voxel_html
from etnet.events.events import Events, Sensor
from etnet.events.recording import recording_of_events
from etnet.windows import ByCount, plan_windows
from tests.app.checked_html import Checker


def test_voxel_tiles_are_five_in_a_row_with_a_legend_in_numbers(moment):
    page = Checker(voxel_html(moment))
    assert page.keys == [f"set:voxels.voxel_bin:{i}" for i in range(5)]
    assert "≥ +" in page.text
    assert "38–62 %" in page.text


def test_an_opened_bin_is_shown_large_and_can_be_closed(moment):
    page = Checker(voxel_html(moment, 2))
    assert page.keys[-1] == "set:voxels.voxel_bin:none"
    images = [attrs for tag, attrs in page.tags if tag == "img"]
    assert images[-1]["width"] == "50"


@pytest.mark.parametrize(("width", "pooled"), [(40, "0,0,40,30"), (346, "0,0,348,30"), (1280, "0,0,1287,33")])
def test_a_tile_of_whatever_size_says_which_pixels_of_the_sensor_it_shows(width, pooled):
    rng, num = np.random.default_rng(3), 500
    x, y = rng.integers(0, width, num).astype(np.uint16), rng.integers(0, 30, num).astype(np.uint16)
    t, p = np.arange(num, dtype=np.int64), rng.choice(np.array([-1, 1], np.int8), num)
    opened = recording_of_events(Events(x, y, t, p, Sensor(width, 30)), "made")
    page = Checker(voxel_html(Moment(f"w{width}", ByCount(num), 0, opened, plan_windows(opened, ByCount(num)))))
    assert [attrs["data-area"] for tag, attrs in page.tags if tag == "img"] == [pooled] * 5

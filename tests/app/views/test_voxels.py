"""The voxel grid's tiles."""

from app.views.voxels.html import voxel_html
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

"""Sensors of any size become one that runs and that a page can show, no event is lost, and it is said."""

import tracemalloc

import numpy as np
import pytest

from app.catalogue.binning import RUNNABLE_PIXELS, runnable_downsample, shown_downsample
from app.catalogue.recordings import Catalogue, suited_policy
from app.config import ViewerConfig
from app.html.moment import Moment
from etnet.events.pixel_counts import LARGEST_COUNTED
from etnet.events.stated import Stated
from etnet.windows import ByCount, ByDensity, plan_windows
from tests.real_data import real_file

MEGABYTE = 1 << 20


@pytest.fixture
def opened(tmp_path):
    """Opens a recording of 400 events, some in each corner of a sensor of these sides."""
    catalogues = []

    def open_it(width, height, **options):
        rng = np.random.default_rng(0)
        x, y = rng.integers(0, width, 400), rng.integers(0, height, 400)
        x[:4], y[:4] = [0, width - 1, 0, width - 1], [0, 0, height - 1, height - 1]
        rows = np.column_stack([np.sort(rng.random(400)), x, y, rng.integers(0, 2, 400)])
        np.savetxt(tmp_path / "wide.txt", rows, fmt="%.6f %d %d %d")
        stated = Stated(assume=f"width={width},height={height}", max_pixels=1 << 32)
        catalogues.append(Catalogue(ViewerConfig(file=tmp_path / "wide.txt", stated=stated, **options)))
        return catalogues[-1].open(catalogues[-1].entries()[0].id)

    yield open_it
    for catalogue in catalogues:
        catalogue.close()


def sides(recording):
    return recording.sensor.width, recording.sensor.height


@pytest.mark.parametrize(
    ("width", "height", "factor"),
    [
        (240, 180, 1), (346, 260, 1), (640, 480, 2), (1280, 720, 4), (3840, 2160, 4), (4096, 4096, 8),
        (65_536, 65_536, 128), (65_536, 4096, 32),
    ],
)  # fmt: skip
def test_sensors_are_brought_to_a_size_that_runs(width, height, factor):
    assert runnable_downsample(width * height) == factor


@pytest.mark.parametrize("num_pixels", [1, RUNNABLE_PIXELS + 1, 1280 * 720, 1 << 24, 1 << 28, 1 << 32])
def test_no_sensor_is_larger_than_what_runs_and_what_is_shown(num_pixels):
    assert num_pixels / runnable_downsample(num_pixels) ** 2 <= 4 * RUNNABLE_PIXELS
    factor = shown_downsample(num_pixels)
    assert num_pixels / factor**2 <= LARGEST_COUNTED
    assert factor == 1 or num_pixels / (factor / 2) ** 2 > LARGEST_COUNTED


def test_a_large_sensor_is_made_smaller_and_says_so(opened):
    recording = opened(1280, 720)
    assert sides(recording) == (320, 180)
    assert any("--downsample 1" in remark.text for remark in recording.remarks)
    assert recording.opened_as.view.downsample == 4
    assert sides(opened(1280, 720, downsample=1)) == (1280, 720)


@pytest.mark.parametrize("options", [{}, {"downsample": 1}, {"downsample": 4}, {"rotate": 90, "flip": "horizontal"}])
def test_a_vast_sensor_costs_no_more_than_one_that_is_built(opened, options):
    tracemalloc.start()
    try:
        recording = opened(65_536, 65_536, **options)
        before, _ = tracemalloc.get_traced_memory()
        tracemalloc.reset_peak()
        moment = Moment(f"wide {options}", ByCount(100), 1, recording, plan_windows(recording, ByCount(100)))
        assert moment.voxel.nbytes == 5 * 4 * recording.sensor.num_pixels
        peak = tracemalloc.get_traced_memory()[1] - before
    finally:
        tracemalloc.stop()
    assert recording.sensor.num_pixels <= (LARGEST_COUNTED if "downsample" in options else 4 * RUNNABLE_PIXELS)
    assert peak < (500 if "downsample" in options else 100) * MEGABYTE
    events = recording.read(0, recording.num_events)
    assert len(events) == 400
    assert {(0, 0), (recording.sensor.width - 1, recording.sensor.height - 1)} <= set(
        zip(events.x.tolist(), events.y.tolist(), strict=True)
    )
    assert any("binned" in remark.text and f"{LARGEST_COUNTED:,}" in remark.text for remark in recording.remarks)


def test_every_event_of_a_vast_sensor_lies_where_it_lay(opened):
    recording = opened(65_536, 4096)
    rng = np.random.default_rng(0)
    x, y = rng.integers(0, 65_536, 400)[4:], rng.integers(0, 4096, 400)[4:]
    events = recording.read(4, 400)
    assert (events.x == x // 32).all()
    assert (events.y == y // 32).all()


@pytest.mark.real
def test_a_large_sensors_file_is_cut_by_density():
    path = real_file("prophesee/evt3_1280x720_night_lights_cut.raw")
    small = Catalogue(ViewerConfig(file=path))
    recording = small.open(small.entries()[0].id)
    assert sides(recording) == (320, 180)
    assert any("--downsample 1" in remark.text for remark in recording.remarks)
    assert suited_policy(recording) == ByDensity(0.35)
    whole = Catalogue(ViewerConfig(file=path, downsample=1))
    assert whole.open(whole.entries()[0].id).sensor.width == 1280

"""Three runs on a real recording, in a real browser: they follow the slider, and the strip holds the right numbers."""

import re

import numpy as np
import pytest
import torch

from app.config import ViewerConfig
from app.main import Viewer
from etnet.evaluation.evaluate import FrameJudge, Judges, evaluate
from etnet.evaluation.protocol import PAPER
from etnet.events.open import open_recording
from etnet.events.opened_as import View
from etnet.nets.presets import build_model
from etnet.nets.weights import load_model, save_weights
from etnet.reconstruction import reconstruct
from etnet.windows import BetweenFrames
from tests.browser.chromium import open_page, until_window
from tests.real_data import real_file

ROI = (60, 40, 64, 48)
"""A small part of the sensor: a whole strip is then filled in seconds."""


@pytest.fixture(scope="module")
def recording_file():
    return real_file("ecd_slider_depth/slider_depth.zip")


@pytest.fixture(scope="module")
def desk(browser, recording_file, tmp_path_factory):
    """A viewer on the real recording, with a network of somebody's own in the data folder."""
    folder = tmp_path_factory.mktemp("data")
    save_weights(build_model("firenet"), folder / "mine.safetensors", {"title": "my network"}, dtype=None)
    config = ViewerConfig(
        file=recording_file, data=folder, port=0, precision="fp32", threads=1, roi=",".join(map(str, ROI))
    )
    running = Viewer(config)
    yield running, folder / "mine.safetensors"
    running.stop()


@pytest.fixture(scope="module")
def page(browser, desk):
    opened = open_page(browser, desk[0].url, 1600, 900)
    until_window(opened, 0)
    opened.keyboard.press("PageDown")
    opened.keyboard.press("PageDown")
    until_window(opened, 20)
    opened.keyboard.press("3")
    yield opened
    assert opened.errors == []
    opened.context.close()


@pytest.fixture(scope="module")
def runs(page):
    """The default network, somebody's own, and the default one over other windows."""
    page.get_by_test_id("run-A").wait_for()
    page.get_by_role("button", name="Add a run").click()
    page.get_by_label("Network of run B").select_option(label="my network")
    page.get_by_role("button", name="Add a run").click()
    page.get_by_label("Windowing of run C").select_option("milliseconds")
    page.get_by_label("Size of run C").wait_for()
    return page


@pytest.fixture(scope="module")
def expected(desk, recording_file):
    """What plain loops over both networks give between frames, and the judge's values of every frame."""
    judge, found = FrameJudge(PAPER, Judges.default()), {}
    with open_recording(recording_file, view=View(ROI, 1)) as recording:
        truth = recording.ground_truth
        targets = [torch.from_numpy(np.ascontiguousarray(truth.read_frame(i)))[None, None] for i in range(len(truth))]
        for name, source in (("A", "etnet-half"), ("B", desk[1])):
            found[name] = [
                judge.score(step.frame, targets[window.index + 1], judge.features(targets[window.index + 1]))
                for window, step in reconstruct(load_model(source), recording, BetweenFrames())
            ]
        cut = evaluate(load_model("etnet-half"), recording, PAPER)
    return found, cut


def test_three_runs_scrub_together_with_the_right_numbers(runs, expected):
    for index in (19, 18):
        runs.locator("body").press("j")
        for name in "AB":
            runs.get_by_alt_text(f"Run {name}: window {index}", exact=True).wait_for(timeout=120_000)
            runs.get_by_test_id(f"value-of-{name}").wait_for(timeout=120_000)
            shown = float(runs.get_by_test_id(f"value-of-{name}").get_attribute("data-value"))
            assert shown == pytest.approx(expected[0][name][index]["lpips"], rel=1e-6)


def test_a_wheel_zooms_all_pictures_at_one_place_and_a_double_click_shows_them_whole_again(runs):
    boxes = (
        "() => [...document.querySelectorAll('.etv-under .et-picture > img')].map(i => i.getBoundingClientRect().width)"
    )
    before = runs.evaluate(boxes)
    runs.locator("[data-card='compare.A'] .et-picture").hover()
    runs.mouse.wheel(0, -400)
    runs.wait_for_function("document.documentElement.hasAttribute('data-zoomed')")
    zoomed = runs.evaluate(boxes)
    assert len(set(round(after / old, 3) for after, old in zip(zoomed, before, strict=True))) == 1
    assert zoomed[0] > 2 * before[0]
    runs.locator("[data-card='compare.A'] .et-picture").dblclick()
    assert runs.evaluate(boxes) == pytest.approx(before)


def test_the_value_under_the_pointer_is_that_of_the_picture(runs):
    runs.locator("[data-card='compare.A'] .et-picture").hover()
    said = runs.locator(".etv-values .etv-own").inner_text()
    assert re.fullmatch(r"x \d+, y \d+ · [≤≥]? ?\d\.\d\d", said)


def test_a_drag_on_a_swiped_picture_moves_the_line_and_chooses_no_pixel(runs):
    runs.get_by_role("button", name="swipe", exact=True).click()
    swipe = runs.locator("[data-card='compare.B'] .et-swipe")
    swipe.wait_for()
    box = swipe.bounding_box()
    before = runs.locator(".et-cross").count()
    runs.mouse.move(box["x"] + 0.6 * box["width"], box["y"] + 20)
    runs.mouse.down()
    runs.mouse.move(box["x"] + 0.25 * box["width"], box["y"] + 20, steps=4)
    runs.mouse.up()
    line = float(runs.evaluate("parseFloat(document.documentElement.style.getPropertyValue('--swipe'))"))
    assert line == pytest.approx(25, abs=1)
    assert runs.locator(".et-cross").count() == before
    runs.get_by_role("button", name="side by side", exact=True).click()


@pytest.mark.parametrize("sight", ["difference", "error"])
def test_every_difference_has_its_colour_bar(runs, sight):
    runs.get_by_role("button", name=sight, exact=True).click()
    runs.get_by_test_id("scale").first.wait_for()
    runs.get_by_role("button", name="side by side", exact=True).click()


def test_means_are_right_and_a_click_on_a_worst_frame_goes_there(runs, expected):
    runs.locator("[data-k='compare:remove:2']").click()
    for name in "AB":
        runs.get_by_test_id(f"series-{name}").get_by_text(re.compile(r"\d scored$")).wait_for(timeout=240_000)
    for name in "AB":
        wanted = np.array([values["lpips"] for values in expected[0][name]])
        shown = float(runs.get_by_test_id(f"mean-{name}-lpips").get_attribute("data-value"))
        assert shown == pytest.approx(wanted.mean(), rel=1e-6)
    runs.wait_for_function(
        "document.querySelectorAll('[data-testid=strip] path[data-run]').length === 2", timeout=10_000
    )
    assert runs.locator("[data-testid=chart] path[data-run]").count() == 2
    first = runs.get_by_test_id("worst-A").locator("button").first
    seconds = float(first.inner_text().split(" s")[0])
    first.click()
    runs.wait_for_timeout(700)
    assert float(runs.get_by_test_id("time").inner_text().split(" s")[0]) == pytest.approx(seconds, abs=0.02)


def test_the_protocols_range_shows_what_the_command_line_prints_and_the_frames_that_it_scored(runs, expected):
    runs.get_by_role("button", name="protocol’s range").click()
    whole = re.compile(rf"^{expected[1].num_frames} scored$")
    runs.get_by_test_id("series-A").get_by_text(whole).wait_for(timeout=240_000)
    for measure in ("mse", "ssim", "lpips", "temporal"):
        shown = float(runs.get_by_test_id(f"mean-A-{measure}").get_attribute("data-value"))
        assert shown == pytest.approx(expected[1].mean(measure), rel=1e-5)
    runs.get_by_test_id("worst-A").locator("button").first.click()
    runs.get_by_test_id("value-of-A").wait_for(timeout=120_000)
    worst = float(np.nanmax(expected[1].rows["as it is"]["lpips"]))
    runs.wait_for_function(
        f"Math.abs(document.querySelector('[data-testid=value-of-A]')?.dataset.value - {worst}) < 1e-5", timeout=120_000
    )
    runs.get_by_role("button", name="timeline", exact=True).click()

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
    until_window(opened, 20)
    opened.get_by_role("tab", name="Compare").click()
    yield opened
    assert opened.errors == []
    opened.context.close()


def choose(page, label, option):
    page.get_by_label(label, exact=True).first.click()
    page.get_by_role("option", name=option, exact=True).first.click()
    page.evaluate("document.activeElement.blur()")  # a field that has the focus takes the keys


@pytest.fixture(scope="module")
def runs(page):
    """The default network, somebody's own, and the default one over other windows."""
    choose(page, "Compare", "runs at this moment")
    page.get_by_test_id("run-A").wait_for()
    page.get_by_role("button", name="Add a run").click()
    page.get_by_test_id("run-B").wait_for()
    choose(page, "Network", "my network")
    page.get_by_role("button", name="Add a run").click()
    page.get_by_test_id("run-C").wait_for()
    choose(page, "Windows by", "milliseconds")
    page.get_by_test_id("run-C").get_by_text("every 20 ms").wait_for()
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


def figures(page, name):
    page.get_by_test_id(f"figures-{name}").wait_for()
    return [float(part) for part in re.findall(r"-?[\d.]+$", page.get_by_test_id(f"figures-{name}").inner_text(), re.M)]


def test_all_tabs_stand_in_one_row_of_the_narrow_column(page):
    tabs = page.locator("[data-dock-region=right] [data-dock-tab]")
    tops = tabs.evaluate_all("all => all.map(tab => tab.getBoundingClientRect().top)")
    assert len(tops) >= 5
    assert len(set(tops)) == 1


def test_three_runs_scrub_together_with_the_right_numbers(runs, expected):
    runs.locator("body").press("j")
    for index in (19, 18):
        until_window(runs, index)
        for name in "AB":
            runs.get_by_alt_text(f"Run {name}: window {index}", exact=True).wait_for()
            runs.get_by_test_id(f"figures-{name}").wait_for()
            wanted = [expected[0][name][index][measure] for measure in ("mse", "ssim", "lpips")]
            assert figures(runs, name) == pytest.approx(wanted, abs=6e-4)
        runs.get_by_test_id("figures-C").wait_for()
        runs.locator("body").press("j")


@pytest.mark.parametrize("sight", ["wiped over each other", "their difference", "error against the camera"])
def test_each_way_of_showing_draws_pictures(runs, sight):
    choose(runs, "Show", sight)
    runs.get_by_test_id("figures-A").wait_for()
    mark = {"wiped over each other": "wipe", "their difference": "difference"}.get(sight, "run-camera")
    # Asked in the page: a picture that has just been replaced by its next one has no box for a moment.
    tall = "name => document.querySelector(`[data-testid=${name}]`)?.getBoundingClientRect().height > 10"
    runs.wait_for_function(tall, arg=mark)
    sizes = runs.get_by_test_id("runs").locator("img").evaluate_all("all => all.map(image => image.naturalWidth)")
    assert len(sizes) >= 1
    assert min(sizes) > 0
    choose(runs, "Show", "side by side")


def test_the_strip_is_filled_and_right_and_a_click_on_the_worst_frame_goes_there(runs, expected):
    choose(runs, "Compare", "scores over time")
    for name in "ABC":
        runs.get_by_test_id(f"series-{name}").get_by_text(re.compile(r"\d scored$")).wait_for(timeout=120_000)
    for name in "AB":
        wanted = np.array([values["lpips"] for values in expected[0][name]])
        shown = float(runs.get_by_test_id(f"mean-{name}-lpips").get_attribute("data-value"))
        assert shown == pytest.approx(wanted.mean(), rel=1e-6)
    assert runs.locator("[data-testid=strip] path[data-run]").count() == 3
    assert runs.locator("[data-testid=chart] path[data-run]").count() == 3
    first = runs.get_by_test_id("worst").locator("button").first
    seconds = float(first.inner_text().split(" s")[0])
    first.click()
    runs.get_by_test_id("time").get_by_text(re.compile(r"\d")).wait_for()
    runs.wait_for_timeout(700)
    assert float(runs.get_by_test_id("time").inner_text().split(" s")[0]) == pytest.approx(seconds, abs=0.02)


def test_the_protocols_own_run_shows_what_the_command_line_prints(runs, expected):
    runs.get_by_label("Protocol’s own cut").click()
    whole = re.compile(rf" {expected[1].num_frames} scored$")
    runs.get_by_test_id("series-A").get_by_text(whole).wait_for(timeout=120_000)
    for measure in ("mse", "ssim", "lpips", "temporal"):
        shown = float(runs.get_by_test_id(f"mean-A-{measure}").get_attribute("data-value"))
        assert shown == pytest.approx(expected[1].mean(measure), rel=1e-5)
    runs.get_by_label("Protocol’s own cut").click()


def test_what_kind_of_recording_it_is_is_told(runs):
    choose(runs, "Compare", "what kind of recording this is")
    runs.get_by_test_id("fit-contrast threshold").wait_for()
    assert "0.1 to 1 inside" in runs.get_by_test_id("fit-events per pixel").inner_text()
    assert "not on card" in runs.get_by_test_id("fit-noise").inner_text()
    runs.get_by_role("button", name="Compare with a run of cleaned events").click()
    runs.get_by_test_id("run-D").get_by_text("without hot pixels").wait_for()


_BOXES = """() => {
    const runs = ["A", "B"].map((name) => document.querySelector(`[data-testid="run-${name}"]`))
    const boxes = runs.map((run) => run?.getBoundingClientRect().toJSON())
    return boxes.every((box) => box?.width > 150) && boxes
}"""
"""Asked in the page and at once: a run that has just been replaced by its next self has no box for a moment."""


def test_on_a_phone_runs_stand_beside_each_other(browser, desk):
    phone = open_page(browser, desk[0].url, 390, 844)
    phone.get_by_text("Compare", exact=True).first.tap()
    phone.locator("input[value=nothing]:visible").first.tap()
    phone.get_by_role("option", name="runs at this moment", exact=True).tap()
    phone.get_by_role("button", name="Add a run").tap()
    phone.get_by_test_id("run-B").wait_for()
    first, second = phone.wait_for_function(_BOXES).json_value()
    assert first["right"] <= second["left"]
    assert second["right"] <= 390
    assert phone.errors == []
    phone.context.close()

"""What a visitor does, in a real browser, with the real network."""

import numpy as np
import pytest
import torch

from etnet.bundled import samples
from etnet.events.open import open_recording
from etnet.events.opened_as import View
from etnet.nets.attention import AttentionProbe
from etnet.nets.weights import load_model
from etnet.voxel import voxel_grid
from etnet.windows import BetweenFrames, plan_windows
from tests.browser.chromium import box_of, open_page, until_window
from tests.browser.conftest import ROI

SITE = "scale1.encoder.0.self"


def seek(page, index):
    """Go to a window with the keys alone."""
    page.locator("body").press("Home")
    page.get_by_test_id("window").get_by_text("window 0 of").wait_for()
    for _ in range(index):
        page.locator("body").press("l")
    until_window(page, index)


def test_it_opens_with_every_part_drawn(page):
    until_window(page, 20)
    for part in ("reconstruction", "camera", "events", "voxels", "attention", "timeline", "provenance", "scene-legend"):
        assert box_of(page, page.get_by_test_id(part))["height"] > 10
    assert page.get_by_test_id("chip-exact").first.is_visible()
    assert page.title() == "ET-Net viewer"


def test_the_slider_scrubs(page):
    until_window(page, 20)
    thumb = page.locator("div:has(> .etv-strip) + div [role=slider]")
    thumb.focus()
    thumb.press("ArrowLeft")
    page.get_by_test_id("window").get_by_text("window 19 of").wait_for()
    until_window(page, 19)
    strip = box_of(page, page.get_by_test_id("strip"))
    page.mouse.click(strip["x"] + strip["width"] * 0.5, strip["y"] + strip["height"] / 2)
    page.get_by_test_id("window").get_by_text("window 25 of").or_(
        page.get_by_test_id("window").get_by_text("window 24 of")
    ).wait_for()


def test_it_plays_and_a_key_stops_it(page):
    until_window(page, 20)
    page.get_by_role("button", name="Play", exact=True).click()
    page.get_by_role("button", name="Pause", exact=True).wait_for()
    page.get_by_test_id("window").get_by_text("window 22 of").wait_for()
    page.locator("body").press("j")
    page.get_by_role("button", name="Play", exact=True).wait_for()


@pytest.fixture(scope="module")
def expected():
    """What a plain loop over the model gives for window 3, without playback, engine or page."""
    recording = open_recording(samples()[0], view=View(ROI, 1))
    windows = plan_windows(recording, BetweenFrames())
    model, state = load_model("etnet-half", "cpu", "fp32"), None
    step = None
    with torch.inference_mode():
        for window in [windows[i] for i in range(4)]:
            voxel = voxel_grid(recording.read(window.start, window.stop))[None]
            step = model(voxel, state, AttentionProbe())
            state = step.state
    return step.attention


@pytest.mark.parametrize("pixel", [(20, 17), (41, 30), (59, 21)], ids=["middle", "right", "padded edge"])
def test_a_click_shows_the_peak_token_and_value_that_the_model_gives(page, expected, pixel):
    seek(page, 3)
    image = box_of(page, page.get_by_test_id("reconstruction").locator("img"))
    page.mouse.click(
        image["x"] + (pixel[0] + 0.5) / ROI[2] * image["width"],
        image["y"] + (pixel[1] + 0.5) / ROI[3] * image["height"],
    )
    page.get_by_text(f"What pixel ({pixel[0]}, {pixel[1]}) reads").wait_for()
    page.get_by_test_id(SITE).locator("img").click()
    peak = page.get_by_test_id("peak")
    row = expected.rows(SITE, [expected.grid.token_at(*pixel)])[:, 0].mean(0).numpy()
    assert int(peak.get_attribute("data-token")) == int(row.argmax())
    assert float(peak.get_attribute("data-weight")) == pytest.approx(float(row.max()), rel=1e-4)
    page.get_by_role("button", name="All sites").click()
    page.get_by_test_id(SITE).wait_for()


def test_a_click_on_the_plane_in_the_scene_asks_too(page):
    until_window(page, 20)
    page.locator("body").press("f")
    page.wait_for_timeout(1500)
    canvas = box_of(page, page.locator("canvas[data-engine]"))
    page.mouse.click(canvas["x"] + canvas["width"] / 2, canvas["y"] + canvas["height"] / 2)
    found = page.get_by_text("What pixel (").inner_text()
    x, y = (int(part) for part in found.split("(")[1].split(")")[0].split(","))
    assert np.abs(np.array([x, y]) - [ROI[2] / 2, ROI[3] / 2]).max() <= 1


def test_an_error_is_shown_and_the_page_goes_on(page, viewer, monkeypatch):
    until_window(page, 20)
    from app.engine.recent_frames import RecentFrames
    from etnet.errors import WindowError

    def refuse(turn):
        raise WindowError("these windows do not fit; choose ByDuration")

    monkeypatch.setattr(viewer.engine, "_recent", RecentFrames())  # other tests may have been there
    monkeypatch.setattr(viewer.engine, "_grant", refuse)
    page.locator("body").press("End")
    page.get_by_test_id("failed").get_by_text("these windows do not fit").first.wait_for()
    monkeypatch.undo()
    page.locator("body").press("j")
    until_window(page, 48)


def test_two_visitors_scrub_alone(browser, viewer, page):
    until_window(page, 20)
    other = open_page(browser, viewer.url)
    until_window(other, 20)
    seek(page, 2)
    seek(other, 4)
    assert "window 2 of" in page.get_by_test_id("window").inner_text()
    assert "window 4 of" in other.get_by_test_id("window").inner_text()
    other.context.close()


_KEPT = """() => Object.values(localStorage).some((text) =>
    text.includes('"index": 5,') && text.includes('"workspace": "attention"'))"""


def test_a_reload_returns_to_the_moment_and_a_new_tab_does_not(page, viewer):
    seek(page, 5)
    page.locator("body").press("2")
    page.locator("[data-etv-workspace=attention]").wait_for(state="attached")
    page.wait_for_function(_KEPT)
    page.reload()
    page.get_by_test_id("window").get_by_text("window 5 of").wait_for()
    page.locator("[data-etv-workspace=attention]").wait_for(state="attached")


def test_the_workspaces_and_help_answer_to_their_keys(page):
    until_window(page, 20)
    page.locator("body").press("3")
    page.get_by_test_id("demo").get_by_text("Image the network makes of them").wait_for()
    page.locator("body").press("1")
    page.get_by_test_id("demo").wait_for(state="hidden")
    page.keyboard.type("?")
    page.get_by_test_id("help").wait_for()

"""What a visitor does, in a real browser, with the real network."""

import re

import pytest
import torch
from playwright.sync_api import expect

from etnet.bundled import samples
from etnet.events.open import open_recording
from etnet.events.opened_as import View
from etnet.nets.attention import AttentionProbe
from etnet.nets.weights import load_model
from etnet.voxel import voxel_grid
from etnet.windows import BetweenFrames, plan_windows
from tests.browser.chromium import PAUSE, PLAY, box_of, open_page, open_workspace, press, until_window
from tests.browser.conftest import ROI
from tests.browser.faults import SCENE

SITE = "scale1.encoder.0.self"


def seek(page, index):
    """Go to a window with the keys alone."""
    page.locator("body").press("Home")
    page.get_by_test_id("window").get_by_text("window 0 of").wait_for()
    for _ in range(index):
        page.locator("body").press("l")
    until_window(page, index)


def on_axis(page, index):
    """The point of the screen at the end of one of the fifty windows, all of them equally long."""
    axis = box_of(page, page.locator(".et-axis"))
    return axis["x"] + (index + 1) / 50 * axis["width"], axis["y"] + 20


def click_pixel(page, x, y):
    """Click into the middle of a pixel of the reconstruction, and wait for the cross on it."""
    image = page.get_by_test_id("reconstruction").locator("img:visible").first
    box = box_of(page, image)
    image.click(position={"x": (x + 0.5) / ROI[2] * box["width"], "y": (y + 0.5) / ROI[3] * box["height"]})
    expect(page.get_by_test_id("query").first).to_have_attribute("style", marked(x, y))


def marked(x, y):
    """The style of the cross on a pixel."""
    return f"--u:{(x + 0.5) / ROI[2]:.4f};--v:{(y + 0.5) / ROI[3]:.4f}"


def test_it_opens_with_every_part_drawn(page):
    until_window(page, 0)
    for card in ("reconstruction", "camera", "events", "scene", "voxels"):
        assert box_of(page, page.locator(f"[data-card={card}]"))["height"] > 100
    for part in ("timeline", "provenance", "scene-legend"):
        page.get_by_test_id(part).first.wait_for()  # the scene's words come with the scene, after the picture
        assert box_of(page, page.get_by_test_id(part))["height"] > 10
    assert page.get_by_test_id("chip-exact").first.is_visible()
    assert page.title() == "ET-Net viewer"


def test_the_slider_and_a_click_on_the_axis_scrub(page):
    thumb = page.locator("div:has(> .etv-strip) + div [role=slider]")
    thumb.focus()
    thumb.press("ArrowRight")
    until_window(page, 1)
    page.mouse.click(*on_axis(page, 25))
    until_window(page, 25)


def test_a_drag_along_the_timeline_moves_windows_and_its_last_value_wins(page):
    page.mouse.move(*on_axis(page, 5))
    page.mouse.down()
    page.mouse.move(*on_axis(page, 15), steps=3)
    page.get_by_test_id("window").get_by_text("window 15 of").wait_for()
    page.mouse.move(*on_axis(page, 45), steps=6)
    page.mouse.move(*on_axis(page, 35), steps=3)
    page.mouse.up()
    until_window(page, 35)
    line, there = box_of(page, page.locator(".et-head-line")), on_axis(page, 35)[0]
    assert line["x"] + line["width"] / 2 == pytest.approx(there, abs=3)


COMPILED = """() => {
  const prototype = WebGL2RenderingContext.prototype, compile = prototype.compileShader;
  window.etnetCompiled = 0;
  prototype.compileShader = function (shader) { window.etnetCompiled += 1; return compile.call(this, shader); };
}"""


def test_another_window_compiles_no_shader_again(page):
    page.evaluate(COMPILED)
    seek(page, 1)
    before = -1
    while before != (before := page.evaluate("() => window.etnetCompiled")):
        page.wait_for_timeout(1500)  # the scene is drawn after the pictures
    page.evaluate("() => (window.etnetCompiled = 0)")
    for index in (2, 3, 4):
        page.locator("body").press("l")
        until_window(page, index)
        page.wait_for_timeout(500)  # at rest the cloud is drawn in full
    assert page.evaluate("() => window.etnetCompiled") == 0


def test_it_plays_and_a_key_stops_it(page):
    page.get_by_role("button", name=PLAY).click()
    page.get_by_role("button", name=PAUSE).wait_for()
    page.get_by_test_id("window").get_by_text(re.compile(r"window ([2-9]|\d\d) of")).wait_for()
    page.locator("body").press("j")
    page.get_by_role("button", name=PLAY).wait_for()


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
    click_pixel(page, *pixel)
    open_workspace(page, "attention")
    page.get_by_test_id(SITE).locator("img").first.click()
    row = expected.rows(SITE, [expected.grid.token_at(*pixel)])[:, 0].mean(0).numpy()
    peak = page.get_by_test_id("peak")
    expect(peak).to_have_attribute("data-token", str(row.argmax()))
    assert float(peak.get_attribute("data-weight")) == pytest.approx(float(row.max()), rel=1e-4)


def test_a_click_on_the_plane_in_the_scene_asks_too(page):
    click_pixel(page, 5, 5)
    press(page, "stage:scene")
    page.locator("body").press("f")
    page.locator("[data-k='scene:camera:front'][aria-pressed=true]").wait_for()
    canvas = box_of(page, page.locator("[data-card=scene].etv-staged .etv-scene-slot"))
    page.wait_for_function(SCENE)
    middle = [marked(x, y) for x in (29, 30, 31) for y in (21, 22, 23)]
    for _ in range(50):  # the camera is on its way
        page.mouse.click(canvas["x"] + canvas["width"] / 2, canvas["y"] + canvas["height"] / 2)
        if page.get_by_test_id("query").first.get_attribute("style") in middle:
            break
        page.wait_for_timeout(100)
    assert page.get_by_test_id("query").first.get_attribute("style") in middle
    press(page, "scene:camera:orbit")
    press(page, "stage:camera")


def test_an_error_is_shown_and_the_page_goes_on(page, viewer, monkeypatch):
    from app.engine.published import RecentFrames
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
    other = open_page(browser, viewer.url)
    seek(page, 2)
    seek(other, 4)
    assert "window 2 of" in page.get_by_test_id("window").inner_text()
    assert "window 4 of" in other.get_by_test_id("window").inner_text()
    assert other.errors == []
    other.context.close()


_KEPT = r"""() => Object.values(localStorage).some((text) =>
    /index\W+5\b/.test(text) && /workspace\W+attention/.test(text))"""


def test_a_reload_returns_to_the_moment_and_a_new_tab_does_not(page, viewer):
    seek(page, 5)
    open_workspace(page, "attention")
    page.wait_for_function(_KEPT)
    page.reload()
    page.get_by_test_id("window").get_by_text("window 5 of").wait_for()
    page.locator("[data-etv-workspace=attention]").wait_for(state="attached")
    other = open_page(None, viewer.url, context=page.context)
    other.get_by_test_id("window").get_by_text("window 0 of").wait_for()
    other.locator("[data-etv-workspace=inspect]").wait_for(state="attached")
    other.close()


def test_help_answers_to_its_key_and_closes(page):
    page.keyboard.type("?")
    page.get_by_test_id("help").wait_for()
    page.get_by_role("button", name="Close", exact=True).click()
    page.get_by_test_id("help").wait_for(state="detached")

"""The one-file page in a real browser, opened from disk with the network off."""

import shutil
from collections.abc import Iterator
from pathlib import Path

import pytest

from etnet.bundled import samples
from etnet.events.open import open_recording
from etnet.export.page import PageConfig, write_page
from etnet.export.take import Take
from etnet.playback.playback import Playback
from etnet.windows import BetweenFrames, plan_windows
from tests.export.recordings_made_up import made_up_model

CHROMIUM = shutil.which("chromium")
pytestmark = [
    pytest.mark.browser,
    pytest.mark.skipif(CHROMIUM is None, reason="chromium is not installed"),
    # Playwright's event loop leaves sockets to the garbage collector.
    pytest.mark.filterwarnings("ignore::ResourceWarning"),
]
FLAGS = ["--no-sandbox", "--disable-quic", "--no-first-run", "--disable-background-networking", "--disable-gpu"]
SCRUB = """async (seconds) => {
  const slider = document.getElementById('seek'), moments = Number(slider.max) + 1, start = performance.now();
  let frames = 0;
  while (performance.now() - start < seconds * 1000) {
    const wanted = frames % moments;
    slider.value = wanted;
    slider.dispatchEvent(new Event('input'));
    await new Promise((done) => {
      const look = () => document.documentElement.dataset.shown === String(wanted) ? done() : setTimeout(look, 0);
      look();
    });
    frames++;
  }
  return [frames, (performance.now() - start) / 1000];
}"""
INK = """(id) => {
  const canvas = typeof id === 'string' ? document.querySelector(id) : id;
  const data = canvas.getContext('2d').getImageData(0, 0, canvas.width, canvas.height).data;
  let sum = 0;
  for (let i = 0; i < data.length; i += 4) sum = (sum * 31 + data[i] + data[i + 1] * 3 + data[i + 2] * 7) % 1000003;
  return sum;
}"""


@pytest.fixture(scope="module")
def page_file(tmp_path_factory) -> Path:
    """The page of a bundled recording, with a small network of random weights."""
    path = tmp_path_factory.mktemp("page") / "prints.html"
    recording = open_recording(next(p for p in samples() if p.stem == "prints"))
    take = Take.of(Playback(made_up_model(), recording, plan_windows(recording, BetweenFrames())))
    write_page(take, BetweenFrames(), path, PageConfig("prints"))
    recording.close()
    return path


@pytest.fixture(scope="module")
def plain_browser(browser) -> Iterator:
    """A browser of its own, with no WebGL at all: the page must not need any."""
    launched = browser.browser_type.launch(executable_path=CHROMIUM, args=FLAGS)
    yield launched
    launched.close()


@pytest.fixture(params=[(1600, 900), (390, 844)], ids=["desk", "phone"])
def page(plain_browser, page_file, request) -> Iterator:
    """The page, shown; any error, message or request beyond the file itself fails the test."""
    width, height = request.param
    context = plain_browser.new_context(
        viewport={"width": width, "height": height}, has_touch=width < 600, offline=True, reduced_motion="reduce"
    )
    page = context.new_page()
    trouble: list[str] = []
    # Chromium's advice on reading pixels is for this test, which reads them; the page does not.
    page.on("console", lambda said: None if said.text.startswith("Canvas2D") else trouble.append(said.text))
    page.on("pageerror", lambda error: trouble.append(str(error)))
    page.on("request", lambda request: trouble.append(request.url) if request.url.startswith("http") else None)
    page.goto(page_file.as_uri())
    page.locator("html[data-shown]").wait_for(timeout=60_000)
    yield page
    assert trouble == []
    context.close()


def shown(page, index: int) -> None:
    page.locator(f'html[data-shown="{index}"]').wait_for()


def test_it_plays_by_itself_where_nothing_speaks_against_it_and_rests_at_a_named_moment(plain_browser, page_file):
    for address, plays in ((page_file.as_uri(), True), (f"{page_file.as_uri()}#t=0.3", False)):
        context = plain_browser.new_context(offline=True, reduced_motion="no-preference")
        page = context.new_page()
        page.goto(address)
        page.locator("html[data-shown]").wait_for(timeout=60_000)
        assert page.get_by_role("button", name="Pause" if plays else "Play", exact=False).first.is_visible()
        first = page.locator("html").get_attribute("data-shown")
        if plays:
            page.wait_for_function("(first) => document.documentElement.dataset.shown !== first", arg=first)
        context.close()


def test_every_panel_shows_something_and_nothing_sticks_out(page):
    for canvas in page.locator("canvas").all():
        colours = canvas.evaluate(
            "c => new Set(new Uint32Array(c.getContext('2d').getImageData(0,0,c.width,c.height).data.buffer)).size"
        )
        assert colours > 3
    assert page.evaluate("document.documentElement.scrollWidth <= innerWidth")
    assert page.locator("#bins canvas").count() == 5
    assert page.locator("#maps canvas").count() == 6
    assert page.locator("#camera-panel").is_visible()
    assert not page.locator("#problem").is_visible()


def test_keys_step_jump_and_play(page):
    before = page.evaluate(INK, ".lane canvas")
    page.keyboard.press("Home")
    shown(page, 0)
    assert page.evaluate(INK, ".lane canvas") != before
    page.keyboard.press("ArrowRight")
    shown(page, 1)
    page.keyboard.press("Shift+ArrowRight")
    shown(page, 11)
    page.keyboard.press("End")
    shown(page, 49)
    page.keyboard.press("ArrowRight")
    page.keyboard.press("ArrowLeft")
    shown(page, 48)
    page.keyboard.press("Home")
    shown(page, 0)
    page.keyboard.press("Space")
    page.get_by_role("button", name="Pause").wait_for()
    page.locator('html[data-shown="0"]').wait_for(state="detached")
    page.keyboard.press("Space")
    page.get_by_role("button", name="Play").wait_for()


def test_an_address_names_the_moment_and_follows_it(page):
    page.keyboard.press("Home")
    shown(page, 0)
    page.keyboard.press("Shift+ArrowRight")
    shown(page, 10)
    address = page.url
    assert "#t=" in address
    page.keyboard.press("End")
    shown(page, 49)
    page.goto(address)
    shown(page, 10)


def test_the_page_says_that_the_cross_snaps_and_rests_where_less_motion_is_wanted(page):
    assert "snaps to the nearest of 24 places" in page.locator("#attention-note").inner_text()
    assert page.get_by_role("button", name="Play", exact=True).is_visible()
    for button in page.get_by_role("button").all():
        assert button.inner_text().strip() or button.get_attribute("aria-label")


def test_a_click_into_the_image_picks_the_nearest_query_and_its_maps(page):
    maps = page.evaluate(INK, "#maps canvas")
    box = page.locator(".lane canvas").bounding_box()
    # The sensor's upper left corner: the grid's first pixel is nearest.
    page.mouse.click(box["x"] + 5, box["y"] + 5)
    page.locator('html[data-query="0"]').wait_for()
    assert page.evaluate(INK, "#maps canvas") != maps
    assert "pixel 20, 22" in page.locator("#attention-note").inner_text()
    page.keyboard.press("d")
    page.locator('html[data-query="1"]').wait_for()
    page.keyboard.press("s")
    page.locator('html[data-query="7"]').wait_for()


def test_the_events_turn_by_drag_and_by_keys(page):
    seen = {page.evaluate(INK, "#cloud")}
    page.locator("#cloud").scroll_into_view_if_needed()
    box = page.locator("#cloud").bounding_box()
    page.mouse.move(box["x"] + 60, box["y"] + 60)
    page.mouse.down()
    page.mouse.move(box["x"] + 120, box["y"] + 70, steps=3)
    page.mouse.up()
    seen.add(page.evaluate(INK, "#cloud"))
    page.locator("#cloud").focus()
    page.keyboard.press("ArrowLeft")
    seen.add(page.evaluate(INK, "#cloud"))
    page.get_by_role("button", name="Front").click()
    seen.add(page.evaluate(INK, "#cloud"))
    assert len(seen) == 4


def test_a_touch_on_the_strip_seeks(page):
    box = page.locator("#strip").bounding_box()
    page.mouse.click(box["x"] + box["width"] - 12, box["y"] + 20)
    shown(page, 49)


def test_every_control_has_a_name_and_text_is_readable(page):
    for control in page.locator("button, input, select, [tabindex]").all():
        name = control.evaluate("e => e.ariaLabel || e.textContent.trim() || e.labels?.[0]?.textContent")
        assert name
    sizes = page.evaluate(
        "[...new Set([...document.querySelectorAll('body *')].filter(e => e.checkVisibility() && "
        "[...e.childNodes].some(n => n.nodeType === 3 && n.data.trim())).map(e => getComputedStyle(e).fontSize))]"
    )
    assert set(sizes) <= {"13px", "15px", "20px"}


def test_scrubbing_reaches_thirty_frames_a_second(page):
    """Frames a second, or what the page's thread could do if it had a processor of its own: test machines share."""
    session = page.context.new_cdp_session(page)
    session.send("Performance.enable", {"timeDomain": "threadTicks"})

    def busy() -> float:
        metrics = session.send("Performance.getMetrics")["metrics"]
        return next(metric["value"] for metric in metrics if metric["name"] == "TaskDuration")

    best = 0.0
    for _ in range(4):
        before = busy()
        frames, seconds = page.evaluate(SCRUB, 1.5)
        best = max(best, frames / seconds, frames / max(busy() - before, 1e-3))
        if best >= 30:
            return
    pytest.fail(f"{best:.1f} frames a second")

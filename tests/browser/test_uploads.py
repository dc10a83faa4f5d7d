"""A visitor's own files in a real browser: uploaded, shown, and deleted when the visitor leaves."""

import base64
import re

import numpy as np
import pytest

from app.config import ViewerConfig
from app.main import Viewer
from etnet.events.open import open_recording
from etnet.events.write import write_recording
from tests.app.stand_ins import held_files, recording
from tests.browser.chromium import open_page, open_tab, until_window

OPTIONS, SORTED, REOPEN = "Import options", "Sort timestamps", "Reopen"
"""What viser's folder, checkbox and button of the import options are called."""


@pytest.fixture(scope="module")
def small_viewer(browser):
    running = Viewer(ViewerConfig(port=0, precision="fp32", budget=128, threads=1, uploads=1, roi="0,0,40,30"))
    yield running
    running.stop()


@pytest.fixture(scope="module")
def shared(browser, small_viewer):
    opened = open_page(browser, small_viewer.url)
    yield opened
    opened.context.close()


@pytest.fixture
def own_page(shared, small_viewer):
    """A page on the bundled recording, with nothing uploaded."""
    until(shared, lambda: not held_files(small_viewer.uploads))
    yield shared
    assert shared.errors == []


@pytest.fixture
def mine(tmp_path):
    """A small real recording with frames, written by the project's own writer."""
    path = tmp_path / "my <b>street</b>".replace("/", "")
    path = path.with_name(f"{path.name}.h5")
    write_recording(recording(), path)
    assert open_recording(path).num_events == 6000
    return path


def choose(page, files):
    open_tab(page, "recording")
    with page.expect_file_chooser() as chooser:
        page.locator("[data-etv-upload]:visible").click()
    chooser.value.set_files(files)


def until(page, condition):
    for _ in range(100):
        if condition():
            return
        page.wait_for_timeout(100)
    raise AssertionError("it did not come about")


def test_a_file_goes_up_shows_scrubs_and_is_gone_when_its_visitor_is(browser, small_viewer, shared, mine):
    page = open_page(browser, small_viewer.url)
    choose(page, mine)
    page.get_by_test_id("facts").get_by_text("6,000").wait_for()
    page.get_by_test_id("handing").get_by_text("my <b>street<b>.h5").wait_for()
    page.get_by_test_id("window").get_by_text("window 0 of 0 – 29").wait_for()
    until_window(page, 0)
    page.locator("body").press("l")
    until_window(page, 1)
    page.get_by_test_id("camera").locator("img:visible").first.wait_for()
    assert held_files(small_viewer.uploads)
    assert page.errors == []
    page.context.close()
    until(shared, lambda: not held_files(small_viewer.uploads))
    until(shared, lambda: small_viewer.catalogue._private == {})
    until(shared, lambda: not any("upload-" in str(key) for key in small_viewer.engine._playbacks._stages))
    assert "street" not in shared.content()


def test_a_file_may_be_dropped_anywhere_and_removed(own_page, small_viewer, mine):
    content = base64.b64encode(mine.read_bytes()).decode()
    data = own_page.evaluate_handle(
        """content => {
            const data = new DataTransfer();
            const bytes = Uint8Array.from(atob(content), sign => sign.charCodeAt(0));
            data.items.add(new File([bytes], "dropped.h5"));
            return data;
        }""",
        content,
    )
    own_page.dispatch_event("body", "dragover", {"dataTransfer": data})
    own_page.locator(".etv-drop").wait_for()
    own_page.dispatch_event("body", "drop", {"dataTransfer": data})
    own_page.get_by_test_id("window").get_by_text("window 0 of 0 – 29").wait_for()
    open_tab(own_page, "recording")
    own_page.get_by_test_id("handing").get_by_text("dropped.h5").wait_for()
    own_page.locator("[data-k^='remove:']:visible").click()
    own_page.get_by_test_id("window").get_by_text("window 0 of 0 – 49").wait_for()
    until(own_page, lambda: not held_files(small_viewer.uploads))


def test_a_file_that_is_too_large_is_refused_in_one_line(own_page, small_viewer, tmp_path):
    large = tmp_path / "night drive.raw"
    large.write_bytes(np.random.default_rng(0).bytes((1 << 20) + 1))
    choose(own_page, large)
    told = own_page.get_by_test_id("refused")
    told.get_by_text("night drive.raw: 1.1 MB, this viewer takes 1 MB").wait_for()
    assert "--data FOLDER" in told.inner_text()
    assert not held_files(small_viewer.uploads)


def test_what_is_sent_beyond_the_declared_size_is_cut_off(own_page, small_viewer):
    told = own_page.evaluate(
        """() => new Promise(end => {
            const ticket = document.querySelector("[data-etv-ticket]").dataset.etvTicket;
            const socket = new WebSocket(`ws://${location.host}/upload`);
            socket.onopen = () => socket.send(JSON.stringify({ticket, name: "liar.raw", size: 1000}));
            socket.onmessage = event => {
                const said = JSON.parse(event.data);
                if (said.go) socket.send(new Uint8Array(5000));
                if (said.refused) end(said.refused);
            };
        })"""
    )
    assert "more came than the 1,000 bytes" in told
    open_tab(own_page, "recording")
    own_page.get_by_test_id("refused").get_by_text("liar.raw: more came").wait_for()
    assert not held_files(small_viewer.uploads)


def test_what_a_file_does_not_say_can_be_said(own_page, tmp_path):
    page, path = own_page, tmp_path / "back.txt"
    rows = np.array([[0.001 * (i + (1 if i % 500 else 9)), i % 40, i % 30, i % 2] for i in range(3000)])
    np.savetxt(path, rows, fmt="%.6f %d %d %d")
    choose(page, path)
    page.get_by_text("open it with --sort").first.wait_for()
    page.get_by_text(OPTIONS, exact=True).click()
    page.get_by_text(SORTED, exact=True).click()
    sensor = page.locator("input.mantine-TextInput-input:visible").first  # viser ties no label to it
    sensor.fill("wide")
    page.get_by_role("button", name=REOPEN).click()
    page.get_by_text("640×480").first.wait_for()
    sensor.fill("40x30")
    page.get_by_role("button", name=REOPEN).click()
    page.get_by_test_id("facts").get_by_text("3,000").wait_for()
    page.get_by_test_id("facts").get_by_text("the events were sorted by timestamp").wait_for()
    page.get_by_alt_text(re.compile("^Reconstruction of window")).first.wait_for()

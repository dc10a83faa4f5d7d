"""Links to moments, a file that is taken along, the tour: in a real browser."""

import csv
import gzip
import io
import urllib.request

from tests.browser.chromium import PATIENCE, open_page, open_tab, open_workspace, until_window

LINKED = "[data-etv-workspace=attention]:not([data-etv-moment=''])"
QUERY = "[data-card='attention.map'] [data-etv-query]"


def test_one_key_copies_a_link_that_opens_paused_at_exactly_that_moment(browser, viewer, page):
    page.context.grant_permissions(["clipboard-read", "clipboard-write"])
    for _ in range(4):
        page.locator("body").press("l")
    until_window(page, 4)
    page.get_by_test_id("reconstruction").locator("img:visible").first.click(position={"x": 40, "y": 30})
    page.get_by_test_id("query").first.wait_for()
    open_workspace(page, "attention")
    page.locator(LINKED).wait_for(state="attached")
    asked = page.locator(QUERY).get_attribute("data-etv-query")
    page.locator("body").press("c")
    page.get_by_text("Link copied").wait_for()
    address = page.evaluate("navigator.clipboard.readText()")
    assert address.startswith(f"{viewer.url}/?moment=")
    open_workspace(page, "inspect")  # nothing is computed for this page any more
    page.locator("body").press("Home")
    other = open_page(browser, address, patience=2 * PATIENCE)
    other.get_by_test_id("window").get_by_text("window 4 of").wait_for()
    other.locator("[data-etv-workspace=attention]").wait_for(state="attached")
    assert other.locator(QUERY).get_attribute("data-etv-query") == asked
    assert other.get_by_role("button", name="Play (space)").is_visible()
    other.locator("div:has(> .etv-strip) + div [role=slider][aria-valuenow='4']").wait_for(state="attached")
    other.context.close()


def test_an_address_that_names_no_moment_is_refused_kindly_and_the_page_is_there(browser, viewer):
    page = browser.new_page()
    page.set_default_timeout(PATIENCE)
    page.goto(f"{viewer.url}/?fixedDpr=1&moment=bm90aGluZw")
    page.get_by_text("perhaps it was cut off").wait_for()
    until_window(page, 0)
    page.context.close()


def test_a_table_of_every_window_is_saved_by_the_browser(page):
    until_window(page, 0)
    open_tab(page, "export")
    page.get_by_label("Format", exact=True).click()
    page.get_by_role("option", name="Numbers of every window (CSV)").click()
    with page.expect_download(timeout=PATIENCE) as download:
        page.locator(".mantine-Button-root:visible", has_text="Export").click()
    rows = list(csv.DictReader(io.StringIO(download.value.path().read_text())))
    assert download.value.suggested_filename.endswith(".csv")
    assert [int(row["window"]) for row in rows] == list(range(50))


def test_the_tour_comes_once_and_leads_through_what_is_there(browser, viewer):
    context = browser.new_context(viewport={"width": 1280, "height": 720})
    page = open_page(browser, viewer.url, context=context)
    tour = page.get_by_test_id("tour")
    tour.get_by_text("1 of").wait_for()
    number = int(tour.locator("h3").inner_text().split()[2])
    assert number == 5
    for step in range(1, number + 1):
        tour.get_by_text(f"{step} of {number}").wait_for()
        assert page.locator(".etv-tour-frame").is_visible()
        tour.locator("[data-go=next]").click()
    tour.wait_for(state="detached")
    assert page.evaluate("localStorage.getItem('etnet-tour')") == "seen"
    page.keyboard.type("?")
    page.get_by_text("Show me around").click()
    tour.get_by_text("1 of").wait_for()
    page.keyboard.press("Escape")
    tour.wait_for(state="detached")
    context.close()


def test_the_pages_head_is_our_own_before_any_script_runs(viewer):
    for packing in ("gzip", "identity"):
        request = urllib.request.Request(viewer.url, headers={"Accept-Encoding": packing})
        with urllib.request.urlopen(request, timeout=10) as answer:
            content = answer.read()
        if packing == "gzip":
            content = gzip.decompress(content)
        head = content[:4000].decode()
        assert head.count("<title>") == 1
        assert "<title>ET-Net viewer</title>" in head
        assert head.count('rel="icon"') == 1

"""Query → site → head → pin → intervene, and back to the exact original, in a real browser with the real network."""

from tests.browser.chromium import open_page, until_window

SITE, OTHER = "scale1.encoder.0.self", "scale3.encoder.1.self"


def click(page, key):
    page.locator(f"[data-k='{key}']:visible").first.click()


def look_at(page, words):
    page.get_by_label("Look at").first.click()
    page.get_by_role("option", name=words, exact=True).click()


def test_from_a_pixel_to_a_head_two_pins_and_a_change_and_back(page):
    until_window(page, 20)
    page.get_by_test_id("reconstruction").locator("img").first.click()
    page.get_by_text("What pixel (").wait_for()

    page.get_by_test_id(SITE).locator("img").click()
    click(page, "head:3")
    page.get_by_test_id("map-facts").get_by_text("weights sum to 1.0000").wait_for()
    page.get_by_role("button", name="Pin as A").click()
    page.get_by_test_id("pinned").get_by_text("head 4").wait_for()
    page.get_by_role("button", name="All sites").click()
    page.get_by_test_id(OTHER).locator("img").click()
    page.get_by_role("button", name="Pin as B").click()
    page.get_by_test_id("a-minus-b").get_by_text("of their weight").wait_for()

    original = page.get_by_test_id("reconstruction").locator("img").first.get_attribute("src")
    page.get_by_role("tab", name="Inside").click()
    page.get_by_text("While nothing is open here, nothing is computed for it.").wait_for()
    look_at(page, "Change something")
    click(page, f"inside:switch:head {OTHER} 3")
    click(page, "inside:switch:skip 1")
    page.get_by_test_id("outcome").get_by_text("LPIPS").wait_for()
    page.get_by_test_id("changed").get_by_text("no skip 1/2 · 1 × head muted").wait_for()
    page.get_by_test_id("chip-warning").filter(has_text="changed").first.wait_for()
    assert page.get_by_test_id("chip-exact").count() == 0
    assert page.get_by_test_id("reconstruction").locator("img").first.get_attribute("src") != original

    page.get_by_role("button", name="Put everything back").click()
    page.get_by_test_id("chip-exact").first.wait_for()
    assert page.get_by_test_id("reconstruction").locator("img").first.get_attribute("src") == original


def test_a_change_that_is_carried_on_begins_at_its_window(page):
    until_window(page, 20)
    page.get_by_role("tab", name="Inside").click()
    look_at(page, "Change something")
    click(page, "inside:carry:on")
    click(page, "inside:edit:drop:0.9")
    page.get_by_test_id("outcome").wait_for()
    page.locator("body").press("j")
    page.get_by_text("It begins at window 20: here the image is original.").wait_for()
    page.get_by_test_id("chip-exact").first.wait_for()


def test_what_matters_is_told_and_follows_the_pixel(page):
    until_window(page, 20)
    page.get_by_role("tab", name="Inside").click()
    look_at(page, "What matters here")
    page.get_by_test_id("verdict").get_by_text("decides most").wait_for()
    assert page.get_by_test_id("part").count() == 8
    page.get_by_test_id("reconstruction").locator("img").first.click()
    page.get_by_test_id("verdict").get_by_text("At this pixel").wait_for()
    page.get_by_test_id("attended").get_by_text("handed over").first.wait_for()


def test_on_a_phone_a_finger_can_choose_from_a_list(browser, viewer):
    phone = open_page(browser, viewer.url, 390, 844)
    phone.get_by_text("Inside", exact=True).first.tap()
    phone.get_by_label("Look at").first.tap()
    phone.get_by_role("option", name="What matters here", exact=True).tap()
    phone.get_by_test_id("verdict").get_by_text("decides most").wait_for()
    assert phone.errors == []
    phone.context.close()

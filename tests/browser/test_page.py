"""What the page looks like at every size, and that nothing a person does to viser's panels changes it."""

import pytest

from tests.browser.chromium import (
    PAUSE,
    PLAY,
    WORKSPACES,
    at_rest,
    box_of,
    open_page,
    open_workspace,
    press,
    until_window,
)
from tests.browser.faults import CHROME, FAULTS, SCENE, SETTLED

LARGE, USUAL, SMALL, PHONE = (1920, 1080), (1600, 900), (1280, 720), (390, 844)
BLOCKS = """() => [...document.querySelectorAll(".etv-bar, .etv-card, [data-dock-region], .et-axis")]
  .filter((e) => e.checkVisibility()).map((e) => [e.dataset.card ?? e.className,
    ...["left", "top", "width", "height"].map((side) => Math.round(e.getBoundingClientRect()[side]))].join(" "))"""
"""Where everything stands."""
REACHABLE = """(parts) => {
  const found = new Set();
  const chrome = parts.join();
  const told = (how, part) => found.add(`${how}: ${part.outerHTML.slice(0, 80)}`);
  for (const part of document.querySelectorAll(chrome)) if (part.checkVisibility()) told("seen", part);
  for (let y = 1; y < innerHeight; y += 9) for (let x = 1; x < innerWidth; x += 13) {
    const hit = document.elementFromPoint(x, y);
    const cursor = getComputedStyle(hit).cursor;
    const isHandle = /grab|resize/.test(cursor) && !hit.closest(".et-axis");
    if (hit.closest(chrome) || isHandle) told(`under the pointer at ${x}, ${y}`, hit);
  }
  for (const part of document.querySelectorAll("button, [tabindex], [role=button], [role=tab]")) {
    if (part.tabIndex >= 0 && part.checkVisibility() && part.closest(chrome)) told("by keyboard", part);
  }
  const tab = document.querySelector(".etv-tabs [aria-pressed=true]")?.innerText;
  for (const head of document.querySelectorAll(".mantine-Paper-root > .mantine-Paper-root:first-child")) {
    if (head.checkVisibility() && head.innerText.trim() === tab) found.add(`the tab ${tab} can be folded`);
  }
  return [...found].slice(0, 5);
}"""
PICTURES = """() => [...document.querySelectorAll(".et-picture img")].filter((e) => e.checkVisibility())
  .map((e) => [e.closest("[data-card]").dataset.card, e.getBoundingClientRect().width])"""
"""Name and width of every picture."""
BEHIND = """async () => {
  const view = document.querySelector("[data-card=scene]").closest(".mantine-ScrollArea-viewport");
  const top = (what) => document.querySelector(what).getBoundingClientRect().top;
  let most = 0;
  for (let i = 0; i < 12; i++) {
    view.scrollBy(0, i % 2 ? 23 : -31);
    await new Promise((drawn) => requestAnimationFrame(() => requestAnimationFrame(drawn)));
    most = Math.max(most, Math.abs(top(".etv-scene-slot") - top("canvas[data-engine]")));
  }
  return Math.round(most);
}"""
"""Pixels by which the scene ever lags behind its card while it scrolls."""
TOUCHED = "button, summary, select, [role=button], .et-axis, .etv-strip"
SMALL_TARGETS = f"""() => [...document.querySelectorAll("{TOUCHED}")].filter((e) => {{
  const box = e.getBoundingClientRect();
  const isNotice = e.closest(".mantine-Notification-root");
  const isSeen = !isNotice && e.checkVisibility() && box.width > 2 && box.bottom > 0 && box.top < innerHeight;
  return isSeen && (box.width < 44 || box.height < 44);
}}).map((e) => `${{e.ariaLabel || e.innerText || e.className}} ${{Math.round(e.getBoundingClientRect().height)}} px`)"""


def resize(page, size):
    """Give the window another size, and wait until the scene has followed."""
    page.set_viewport_size({"width": size[0], "height": size[1]})
    page.wait_for_function(SCENE)


def faults_at_rest(page):
    """What is wrong with the page once it rests: after a new size viser moves its column for a second or two."""
    for _ in range(100):
        if not page.evaluate(FAULTS):
            return []
        page.wait_for_timeout(200)
    return page.evaluate(FAULTS)


def card(page, name):
    return page.locator(f"[data-card='{name}']:visible")


@pytest.fixture(scope="module")
def phone(browser, viewer):
    opened = open_page(browser, viewer.url, *PHONE)
    yield opened
    assert opened.errors == []
    opened.context.close()


def test_the_style_sheets_stand_in_the_documents_head(page):
    sheets = page.locator("style[data-sheet]").evaluate_all(
        "all => all.map(sheet => [sheet.parentElement.tagName, sheet.sheet.cssRules.length > 0])"
    )
    assert sheets == [["HEAD", True]] * 4


@pytest.mark.parametrize("size", [USUAL, SMALL, PHONE], ids=str)
def test_visers_grips_chevrons_and_tabs_are_out_of_reach_of_pointer_and_keyboard(page, size):
    resize(page, size)
    at_rest(page, BLOCKS)
    assert page.evaluate(REACHABLE, list(CHROME)) == []


@pytest.mark.parametrize("size", [USUAL, SMALL], ids=str)
def test_no_drag_or_double_click_moves_folds_or_closes_a_part_of_the_page(page, size):
    resize(page, size)
    before = at_rest(page, BLOCKS)
    bar, column = box_of(page, page.locator(".etv-bar")), box_of(page, page.locator("[data-dock-region=right]"))
    heads = [box_of(page, card(page, name).locator("header h3")) for name in ("reconstruction", "events")]
    places = [(box["x"] + 4, box["y"] + 4) for box in heads]
    places += [(bar["x"] + 2, 2), (column["x"] - 3, 300), (column["x"] + 2, 300), (column["x"] + 40, column["y"] + 3)]
    for x, y in places:
        page.mouse.dblclick(x, y)
        page.mouse.move(x, y)
        page.mouse.down()
        page.mouse.move(x + 90, y + 120, steps=4)
        page.mouse.up()
    assert page.evaluate(BLOCKS) == before


def test_tabbing_through_the_page_meets_controls_of_ours_alone(page):
    page.mouse.click(640, 4)
    met = []
    for _ in range(40):
        page.keyboard.press("Tab")
        met.append(page.evaluate("parts => document.activeElement.closest(parts) !== null", ", ".join(CHROME)))
    assert not any(met)


@pytest.mark.parametrize(("size", "least"), [(LARGE, 640), (USUAL, 520), (SMALL, 400)], ids=str)
def test_the_reconstruction_is_the_largest_picture(page, size, least):
    resize(page, size)
    at_rest(page, BLOCKS)
    widths = dict(page.evaluate(PICTURES))
    assert widths["reconstruction"] >= least
    assert widths["reconstruction"] >= max(widths.values()) - 1


@pytest.mark.parametrize("size", [USUAL, SMALL], ids=str)
@pytest.mark.parametrize("workspace", WORKSPACES)
def test_no_workspace_scrolls_sideways_cuts_words_or_lets_cards_overlap(page, workspace, size):
    until_window(page, 0)
    resize(page, size)
    open_workspace(page, workspace)
    page.wait_for_function(SCENE)
    page.wait_for_function(SETTLED)
    assert faults_at_rest(page) == []


def test_the_scene_lies_over_its_slot_wherever_that_goes_and_is_out_of_sight_elsewhere(page):
    page.wait_for_function(SCENE)
    press(page, "stage:scene")
    page.locator("[data-card=scene].etv-staged").wait_for()
    page.wait_for_function(SCENE)
    for size in (USUAL, LARGE, SMALL):
        resize(page, size)
    press(page, "stage:camera")
    page.locator("[data-card=scene].etv-shelf").wait_for()
    page.wait_for_function(SCENE)
    for workspace in ("attention", "compare", "recording", "demo", "inspect"):
        open_workspace(page, workspace)
        page.wait_for_function(SCENE)
    assert box_of(page, page.locator("canvas[data-engine]"))["width"] > 100


def test_a_card_of_the_shelf_goes_to_the_stage_and_back_by_one_click(page):
    before = {name: box_of(page, card(page, name)) for name in ("events", "camera")}
    press(page, "stage:events")
    page.locator("[data-card=events].etv-staged").wait_for()
    assert box_of(page, card(page, "events")) == pytest.approx(before["camera"], abs=1)
    page.locator("[data-card=camera].etv-shelf").wait_for()
    press(page, "stage:camera")
    page.locator("[data-card=events].etv-shelf").wait_for()
    assert box_of(page, card(page, "events")) == pytest.approx(before["events"], abs=1)


def test_the_workspaces_answer_to_the_keys_one_to_five(page):
    for number, name in [*enumerate(WORKSPACES, 1), (1, "inspect")]:
        page.locator("body").press(str(number))
        page.locator(f"[data-etv-workspace={name}]").wait_for(state="attached")


def test_a_phone_shows_reconstruction_timeline_and_play_at_once(phone):
    until_window(phone, 0)
    picture = box_of(phone, phone.get_by_test_id("reconstruction").locator("img:visible"))
    axis, play = box_of(phone, phone.locator(".et-axis")), box_of(phone, phone.get_by_role("button", name=PLAY))
    assert picture["width"] >= 390 - 50
    assert picture["y"] + picture["height"] <= min(axis["y"], play["y"])
    assert max(axis["y"] + axis["height"], play["y"] + play["height"]) <= 844
    assert phone.evaluate(SMALL_TARGETS) == []
    assert faults_at_rest(phone) == []


def test_a_thumb_reaches_every_workspace_of_a_phone_and_nothing_in_it_is_small_or_cut(phone):
    for name in (*WORKSPACES[1:], "inspect"):
        phone.locator(f".etv-bar [data-k='workspace:{name}']").tap()
        phone.locator(f"[data-etv-workspace={name}]").wait_for(state="attached")
        phone.wait_for_function(SCENE)
        phone.wait_for_function(SETTLED)
        assert faults_at_rest(phone) == []
        assert phone.evaluate(SMALL_TARGETS) == []


def test_the_scene_moves_in_the_frame_in_which_its_card_does_and_never_lies_over_the_timeline_of_a_phone(phone):
    phone.locator("[data-card=scene] header").evaluate("head => head.scrollIntoView({ block: 'center' })")
    phone.locator("[data-card=scene] header").evaluate(
        "head => head.closest('.mantine-ScrollArea-viewport').scrollBy(0, head.getBoundingClientRect().top - 600)"
    )
    phone.wait_for_function(SCENE)
    assert phone.evaluate(BEHIND) <= 1
    axis = box_of(phone, phone.locator(".et-axis"))
    met = phone.evaluate("([x, y]) => document.elementFromPoint(x, y).tagName", [axis["x"] + 90, axis["y"] + 8])
    assert met != "CANVAS"
    phone.locator(".etv-bar").first.scroll_into_view_if_needed()


def test_a_finger_scrubs_plays_asks_and_chooses_on_a_phone(phone):
    axis = box_of(phone, phone.locator(".et-axis"))
    phone.touchscreen.tap(axis["x"] + axis["width"] * 0.5, axis["y"] + 20)
    phone.get_by_test_id("window").get_by_text("window 2").wait_for()
    phone.get_by_role("button", name=PLAY).tap()
    phone.get_by_role("button", name=PAUSE).tap()
    phone.get_by_role("button", name=PLAY).wait_for()
    phone.get_by_test_id("reconstruction").locator("img:visible").tap()
    phone.get_by_test_id("query").first.wait_for()
    phone.locator(".etv-recordings summary").tap()
    phone.locator(".etv-list input").wait_for()
    phone.locator(".etv-recordings summary").tap()
    phone.locator(".etv-tabs [data-k='tab:export']").tap()
    phone.locator(".etv-tabs [data-k='tab:export'][aria-pressed=true]").wait_for()

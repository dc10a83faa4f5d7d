"""Every button by finger, mouse and keyboard; axes that do not begin at 0; links where nothing may be kept."""

import numpy as np
import pytest

from app.html.elements import ON_PICK, icon_button, picture
from etnet.render.encode import data_url
from tests.browser.bare import ADDRESS, PHONE, bare_page, told, until_told
from tests.browser.chromium import at_rest, box_of

REMOVE = f'<button class="et-button" data-k="remove:a" {ON_PICK}>Remove</button>'
IMAGE = picture(data_url(np.zeros((60, 80), np.uint8), is_lossless=True), "Image", key="pixel", size=(80, 60))
AXIS = (
    f'<div class="et-strip" style="height:60px"><div class="et-axis" data-k="span:540,600" data-drag="1" {ON_PICK}'
    ' data-of="live" data-start="540" data-duration="60"><i class="et-head-line" style="--x:50%"></i></div></div>'
    '<div class="etv-ruler" style="width:400px"></div>'
)
TRACK = (
    '<div class="etv-track" role="slider" tabindex="0" aria-valuemin="540" aria-valuemax="600" aria-valuenow="570"'
    f' data-k="span:540,600" data-drag="1" {ON_PICK}></div>'
)
LIST = (
    '<details class="etv-recordings"><summary>astronaut</summary><div class="etv-list"><input type="search">'
    f'<button data-k="open:a" {ON_PICK}>astronaut</button><button data-k="open:r" {ON_PICK}>rolling</button></div>'
    "</details>"
)
HAS_NO_PLACE = """if (!sessionStorage.getItem("came")) {
  sessionStorage.setItem("came", "1");
  Object.defineProperty(window, "etnetChannel", { get() {}, set() {} });
}"""
"""The first load finds nobody to tell, as in a crowded demo; the next one has a place."""
NO_STORAGE = """Object.defineProperty(window, "sessionStorage", {
  get() { throw new DOMException("Access is denied for this document.", "SecurityError"); },
});"""


@pytest.fixture
def show(browser):
    """A way to have a page of some HTML; no script of it may fail."""
    opened = []

    def shown(body, **options):
        opened.append(bare_page(browser, body, **options))
        return opened[-1]

    yield shown
    for page in opened:
        assert page.errors == []
        page.context.close()


def scrolling(body):
    """The same in a part of the page that scrolls."""
    return (
        '<div id="view" style="height:500px;overflow:auto"><div style="height:3000px;padding-top:200px;width:300px">'
        f"{body}</div></div>"
    )


def middle(page, selector):
    box = box_of(page, page.locator(selector))
    return round(box["x"] + box["width"] / 2), round(box["y"] + box["height"] / 2)


@pytest.mark.parametrize(("html", "key"), [(REMOVE, "remove:a"), (IMAGE, "pixel")])
def test_a_finger_that_scrolls_presses_nothing_and_one_that_taps_presses_once(show, html, key):
    page = show(scrolling(html), viewport={"width": 390, "height": 600}, **PHONE)
    x, y = middle(page, "[data-pick]")
    hand = page.context.new_cdp_session(page)
    hand.send("Input.dispatchTouchEvent", {"type": "touchStart", "touchPoints": [{"x": x, "y": y}]})
    for far in (10, 25, 50, 80, 110):
        hand.send("Input.dispatchTouchEvent", {"type": "touchMove", "touchPoints": [{"x": x, "y": y - far}]})
    hand.send("Input.dispatchTouchEvent", {"type": "touchEnd", "touchPoints": []})
    page.wait_for_function("() => document.querySelector('#view').scrollTop > 20")
    at_rest(page, "document.querySelector('#view').scrollTop")
    assert told(page) == []
    page.locator("#view").evaluate("view => view.scrollTo(0, 0)")
    page.touchscreen.tap(*middle(page, "[data-pick]"))
    until_told(page, f"pick|{key}|")
    assert [words.split("|")[0] for words in told(page)] == [key]


def test_a_finger_presses_where_it_is_lifted_within_ten_pixels_and_not_farther(show):
    page = show(f'<div style="touch-action:none;padding:200px 40px">{REMOVE}</div>', **PHONE)
    x, y = middle(page, "[data-pick]")
    hand = page.context.new_cdp_session(page)

    def drag(far):
        hand.send("Input.dispatchTouchEvent", {"type": "touchStart", "touchPoints": [{"x": x, "y": y}]})
        hand.send("Input.dispatchTouchEvent", {"type": "touchMove", "touchPoints": [{"x": x, "y": y - far}]})
        assert told(page) == []
        hand.send("Input.dispatchTouchEvent", {"type": "touchEnd", "touchPoints": []})

    drag(30)
    drag(3)
    until_told(page, "pick|remove:a|")
    assert len(told(page)) == 1


def test_a_finger_that_scrolls_the_list_of_recordings_opens_none_in_the_demo_either(show):
    page = show(LIST.replace("<details", "<details open"), workspace="demo", **PHONE)
    x, y = middle(page, "[data-k='open:a']")
    hand = page.context.new_cdp_session(page)
    hand.send("Input.dispatchTouchEvent", {"type": "touchStart", "touchPoints": [{"x": x, "y": y}]})
    hand.send("Input.dispatchTouchEvent", {"type": "touchMove", "touchPoints": [{"x": x, "y": y - 30}]})
    hand.send("Input.dispatchTouchEvent", {"type": "touchEnd", "touchPoints": []})
    page.touchscreen.tap(*middle(page, "[data-k='open:r']"))
    until_told(page, "pick|")
    assert [words.split("|")[0] for words in told(page)] == ["open:r"]


@pytest.mark.parametrize(("workspace", "html"), [("demo", IMAGE), ("inspect", AXIS)])
def test_where_nothing_scrolls_a_finger_is_answered_as_it_is_put_down(show, workspace, html):
    page = show(html, workspace=workspace, **PHONE)
    x, y = middle(page, "[data-pick]")
    hand = page.context.new_cdp_session(page)
    hand.send("Input.dispatchTouchEvent", {"type": "touchStart", "touchPoints": [{"x": x, "y": y}]})
    until_told(page, "pick|")
    hand.send("Input.dispatchTouchEvent", {"type": "touchEnd", "touchPoints": []})


def test_a_click_of_the_mouse_presses_once(show):
    page = show(REMOVE)
    page.locator("button").click()
    assert [words.split("|")[0] for words in told(page)] == ["remove:a"]


def test_enter_presses_the_button_that_has_the_focus(show):
    page = show(icon_button("timeline:on", "next", "Next window") + REMOVE)
    page.keyboard.press("Tab")
    page.keyboard.press("Enter")
    page.keyboard.press("Tab")
    page.keyboard.press("Enter")
    assert told(page) == ["timeline:on|0|0", "remove:a|0|0"]


def test_a_button_that_is_drawn_again_keeps_the_keyboard_and_gives_it_up_to_the_mouse(show):
    page = show(f'<main>{REMOVE}</main><p style="height:100px">words</p>')
    again = "() => (document.querySelector('main').innerHTML += ' ')"
    page.keyboard.press("Tab")
    page.evaluate(again)
    page.wait_for_function("() => document.activeElement.dataset.k === 'remove:a'")
    page.keyboard.press("Enter")
    assert told(page) == ["remove:a|0|0"]
    page.mouse.click(*middle(page, "p"))
    page.evaluate(again)
    assert page.evaluate("new Promise((drawn) => setTimeout(() => drawn(document.activeElement.tagName)))") == "BODY"


def loop(is_on):
    key = f"timeline:{'once' if is_on else 'loop'}"
    return icon_button("timeline:last", "last", "Last") + icon_button(key, "loop", "Loop the recording", is_on=is_on)


def cold(*runs):
    """Buttons of one name, each of another run."""
    keys = {f"compare:cold:{number}:{'off' if is_on else 'on'}": " et-on" if is_on else "" for number, is_on in runs}
    buttons = (
        f'<button class="et-button{on}" data-k="{key}" {ON_PICK}>cold start</button>' for key, on in keys.items()
    )
    return "".join(buttons)


def over(is_on):
    """One switch on each of two cards, and the button that closes what it opens."""
    key = f"set:attention.over:{'none' if is_on else 'not'}"
    close = icon_button("set:attention.over:none", "close", "Back to the map") if is_on else ""
    return close + 2 * icon_button(key, "info", "What maps are not", is_on=is_on)


def scene(key, title):
    say = "Another scene: " + title
    return f'<button class="etv-round" data-k="open:{key}" {ON_PICK} aria-label="{say}">n</button>' + REMOVE


SWITCHES = {
    "loop": (loop(False), loop(True), 1, 1),
    "one of several runs": (cold((1, False), (2, False)), cold((1, False), (2, True)), 1, 1),
    "one on each card": (over(False), over(True), 1, 2),
    "another scene": (scene("b", "Things that roll"), scene("c", "Photographs on a wall"), 0, 0),
}
"""A page before a press and after it; which of its buttons is pressed, and which is that button afterwards."""


@pytest.mark.parametrize(("before", "after", "at", "then"), SWITCHES.values(), ids=SWITCHES)
def test_a_button_whose_key_is_what_the_next_press_does_keeps_the_keyboard(show, before, after, at, then):
    page = show(f"<main>{before}</main>")
    draw = "html => { document.querySelector('main').innerHTML = html; }"
    is_on = "at => document.activeElement === document.querySelectorAll('main button')[at]"
    for _ in range(at + 1):
        page.keyboard.press("Tab")
    for html, place in ((after, then), (before, at), (after, then)):
        page.keyboard.press("Enter")
        page.evaluate(draw, html)
        page.wait_for_function(is_on, arg=place)
    first, second, third = (words.split("|")[0] for words in told(page))
    assert first == third != second


def test_the_keyboard_does_not_go_from_a_button_that_has_left_to_one_of_the_same_name(show):
    other = REMOVE.replace("remove:a", "remove:b")
    page = show(f"<main>{REMOVE}{other}</main>")
    page.keyboard.press("Tab")
    page.keyboard.press("Enter")
    page.evaluate("html => { document.querySelector('main').innerHTML = html; }", other)
    assert page.evaluate("new Promise((drawn) => setTimeout(() => drawn(document.activeElement.tagName)))") == "BODY"


def test_the_demos_slider_keeps_the_arrows_while_it_is_drawn_again_on_an_axis_that_moves_on(show):
    page = show(f"<main>{TRACK}</main>", workspace="demo")
    page.keyboard.press("Tab")
    page.keyboard.press("ArrowRight")
    page.evaluate("html => { document.querySelector('main').innerHTML = html; }", TRACK.replace("span:540", "span:541"))
    page.wait_for_function("() => document.activeElement.matches('.etv-track')")
    page.wait_for_timeout(100)  # arrows that follow each other faster count once
    page.keyboard.press("ArrowRight")
    assert [words.split("|")[0] for words in told(page)] == ["span:540,600", "span:541,600"]


def test_enter_on_a_row_of_the_list_of_recordings_opens_it_and_shuts_the_list(show):
    page = show(f"<main>{LIST}</main>")
    page.keyboard.press("Tab")
    page.keyboard.press("Enter")
    page.keyboard.type("roll")
    page.keyboard.press("Tab")
    page.evaluate("document.querySelector('main').innerHTML = document.querySelector('main').innerHTML")
    page.wait_for_function("() => document.activeElement.dataset.k === 'open:r'")
    page.keyboard.press("Enter")
    assert told(page) == ["open:r|0|0"]
    assert page.locator("details[open]").count() == 0
    assert page.evaluate("document.activeElement === document.body")


@pytest.mark.parametrize(("key", "share"), [("ArrowRight", 0.52), ("ArrowLeft", 0.48)])
def test_an_arrow_on_the_demos_slider_is_a_step_from_where_it_stands_wherever_its_axis_begins(show, key, share):
    page = show(TRACK, workspace="demo")
    page.locator(".etv-track").focus()
    page.keyboard.press(key)
    assert told(page) == [f"span:540,600|{share:.5f}|0"]


def test_the_ruler_of_an_axis_counts_from_where_the_axis_begins(show):
    page = show(AXIS, viewport={"width": 400, "height": 300})
    page.locator("html[style*='--zoom']").wait_for()  # the page has seen its axis
    page.keyboard.press("+")
    labels = "[...document.querySelectorAll('.etv-ruler span')].map((label) => parseFloat(label.textContent))"
    page.wait_for_function(f"() => {labels}.length > 0")
    seen = page.evaluate(labels)
    assert all(550 <= at <= 590 for at in seen), seen
    page.locator(".et-axis").evaluate("axis => (axis.dataset.start = '640')")  # more has come, and as much has left
    page.wait_for_function(f"() => {labels}.every((at) => at >= 650)")


def test_what_is_looked_at_stays_while_a_recording_grows_and_goes_with_another_one(show):
    page = show(AXIS, viewport={"width": 400, "height": 300})
    page.locator("html[style*='--zoom']").wait_for()
    page.keyboard.press("+")
    page.locator("html.etv-zoomed").wait_for()
    look = "() => ['--zoom', '--from'].map((name) => Number(document.documentElement.style.getPropertyValue(name)))"
    zoom, start = page.evaluate(look)
    page.locator(".et-head-line").evaluate("head => head.style.setProperty('--x', '40%')")  # it is where it was
    page.locator(".et-axis").evaluate("axis => (axis.dataset.duration = '75')")
    page.wait_for_function(f"was => ({look})()[0] > was", arg=zoom + 0.01)
    assert page.evaluate(look) == pytest.approx([zoom * 1.25, start / 1.25])
    page.locator(".et-axis").evaluate("axis => Object.assign(axis.dataset, { of: 'another', duration: '80' })")
    page.wait_for_function(f"() => ({look})()[0] === 1")


LOOK = "() => ['--zoom', '--from'].map((name) => Number(document.documentElement.style.getPropertyValue(name)))"
MOVE = """([start, duration, x]) => {
  document.querySelector(".et-head-line").style.setProperty("--x", x);
  Object.assign(document.querySelector(".et-axis").dataset, { start, duration });
}"""


@pytest.mark.parametrize(("start", "duration"), [("546", "60"), ("546", "57"), ("546", "66")])
def test_what_is_looked_at_stays_while_a_live_buffer_drops_its_oldest(show, start, duration):
    page = show(AXIS, viewport={"width": 400, "height": 300})  # 570 s of 540 … 600 s
    page.locator("html[style*='--zoom']").wait_for()
    page.keyboard.press("+")
    page.locator("html.etv-zoomed").wait_for()
    zoom, begin = page.evaluate(LOOK)
    page.evaluate(MOVE, [start, duration, f"{100 * (570 - float(start)) / float(duration):.3f}%"])
    page.wait_for_function(f"was => Math.abs(({LOOK})()[1] - was) > 1e-6", arg=begin)
    now = page.evaluate(LOOK)
    assert now[0] == pytest.approx(zoom * float(duration) / 60)
    assert float(start) + now[1] * float(duration) == pytest.approx(540 + begin * 60)


def test_it_stays_though_the_moment_lies_elsewhere_and_goes_to_it_once_it_moves(show):
    page = show(AXIS, viewport={"width": 400, "height": 300})
    page.locator("html[style*='--zoom']").wait_for()
    for key in "++]]]":
        page.keyboard.press(key)  # past the moment
    zoom, begin = page.evaluate(LOOK)
    assert begin > 0.5
    page.evaluate(MOVE, ["546", "60", "40%"])
    page.wait_for_function(f"was => ({LOOK})()[1] !== was", arg=begin)
    assert page.evaluate(LOOK) == pytest.approx([zoom, begin - 0.1])
    page.evaluate(MOVE, ["546", "60", "30%"])
    page.wait_for_function(f"() => ({LOOK})()[1] < 0.3")


def test_a_mark_is_dragged_along_although_its_axis_has_moved_on_meanwhile(show):
    mark = '<b class="et-mark" data-k="mark:a:540,600" data-drag="1" data-pick="1" style="left:10%">A</b>'
    page = show(AXIS.replace("<i class", f"{mark}<i class"), viewport={"width": 1000, "height": 300})
    page.mouse.move(*middle(page, ".et-mark"))
    page.mouse.down()
    page.locator(".et-mark").evaluate("mark => (mark.dataset.k = 'mark:a:541,601')")
    box = box_of(page, page.locator(".et-axis"))
    page.mouse.move(box["x"] + box["width"] / 2, box["y"] + 5)
    page.mouse.up()
    assert page.locator(".et-mark").evaluate("mark => parseFloat(mark.style.left)") == pytest.approx(50, abs=0.5)


@pytest.mark.parametrize("before", ["", NO_STORAGE])
def test_a_link_is_followed_once_and_on_a_reload_only_where_the_browser_keeps_nothing(show, before):
    page = show("", address=f"{ADDRESS}?moment=abc", before=before)
    assert told(page, "link") == ["abc"]
    page.reload()
    page.evaluate("window.etnetHello()")
    assert told(page, "link") == (["abc"] if before else [])


def test_a_link_that_found_nobody_to_tell_is_told_by_the_reload_that_finds_somebody(show):
    page = show("", address=f"{ADDRESS}?moment=abc", before=HAS_NO_PLACE)
    assert told(page, "link") == []
    page.reload()
    page.evaluate("window.etnetHello()")
    assert told(page, "link") == ["abc"]
    page.reload()
    page.evaluate("window.etnetHello()")
    assert told(page, "link") == []

"""A demo in a browser, as visitors use it: opened cold, touched where things stand, and what may be in reach."""

from app.config import ViewerConfig
from app.main import Viewer
from tests.browser.chromium import PATIENCE, box_of
from tests.browser.conftest import ROI

OURS = ".etv-demo, .etv-demo-bar, .etv-bar, .etv-card, .etv-tour, .mantine-Modal-content:has(.etv-help)"
REACHED = """(ours) => {
  const wanted = 'button, input, select, textarea, a[href], summary, [role=button], [role=tab], [role=slider],'
    + '[tabindex="0"], [data-dock-griphandle], [data-dock-strip], [data-dock-minimize], [data-dock-resize],'
    + '.mantine-Burger-root';
  const found = [];
  for (const element of document.querySelectorAll(wanted)) {
    if (element.closest(ours) || !element.checkVisibility()) continue;
    const box = element.getBoundingClientRect();
    if (box.width < 2 || box.height < 2) continue;
    const on = document.elementFromPoint(box.left + box.width / 2, box.top + box.height / 2);
    const isOn = on && on !== document.body && (element.contains(on) || on.contains(element));
    if (isOn) found.push(element.outerHTML.slice(0, 200));
  }
  return found;
}"""


def serve(**options):
    usual = {"port": 0, "roi": ",".join(map(str, ROI))}
    return Viewer(ViewerConfig(demo=True, budget=256, threads=1, **{**usual, **options}))


def open_demo(browser, viewer, width=1600, height=900, prepare=lambda page: None):
    phone = {"is_mobile": True, "has_touch": True, "device_scale_factor": 2} if width < 500 else {}
    context = browser.new_context(viewport={"width": width, "height": height}, permissions=["camera"], **phone)
    page = context.new_page()
    page.set_default_timeout(PATIENCE)
    page.errors = []
    page.on("pageerror", lambda error: page.errors.append(str(error)))
    prepare(page)
    page.goto(f"{viewer.url}/?fixedDpr=1", wait_until="commit")
    page.locator(".etv-image img").wait_for()
    return page


def touch(page):
    """A finger on the image: its HTML is replaced with each new frame, so it is aimed at and not waited for."""
    box = box_of(page, page.locator(".etv-image .etv-frame"))
    page.mouse.click(box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)


def press(page, name):
    """A finger on a button: what is drawn twelve times a second never rests, so it is aimed at and not waited for."""
    box = box_of(page, page.get_by_role("button", name=name))
    page.mouse.click(box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)


def close(page):
    assert page.errors == [], page.errors
    page.context.close()

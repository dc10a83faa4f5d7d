"""`make pictures`: screenshots of the viewer for a look, and a check that no panel is empty, overlaps or is cut off.

python -m tests.browser.pictures [FOLDER]   (needs Chromium; real recordings are left out, by name, where absent)
"""

import sys
from dataclasses import dataclass
from pathlib import Path

from app.config import ViewerConfig
from app.main import Viewer
from etnet.bundled import samples
from tests.browser.chromium import chromium, dismiss_notices, executable, open_page
from tests.real_data import DATA

SIZES = ((1600, 900), (1280, 720), (390, 844))
RECORDINGS = {
    "bundled": samples()[0],
    "slider_depth": DATA / "ecd_slider_depth" / "slider_depth.zip",
    "dvxplorer_face": DATA / "aedat4" / "dvxplorer_lite_face_headphones_1.5s.aedat4",
}
CLICK = (0.5, 0.4)
"""Where the picture is clicked, as fractions."""

FAULTS = """() => {
  const faults = [];
  const shown = (e) => e.checkVisibility() && e.getBoundingClientRect().width > 0;
  const named = (e) => e.dataset.testid || e.className;
  const parts = [...document.querySelectorAll('.et[data-testid]')].filter(shown);
  for (const part of parts) {
    const box = part.getBoundingClientRect();
    const holds = part.innerText.trim() || part.querySelector('img, svg');
    if (box.height < 8 || !holds) faults.push(`${named(part)} is empty`);
    if (part.scrollWidth > part.clientWidth + 2) faults.push(`${named(part)} is wider than its place`);
    for (const image of part.querySelectorAll('img')) {
      if (image.complete && image.naturalWidth === 0) faults.push(`a picture of ${named(part)} is broken`);
    }
    for (const bit of part.querySelectorAll('.et-legend, .et-legend-ticks > span, .et-swatch, .et-chip')) {
      const inner = bit.getBoundingClientRect();
      const isCut = inner.left < box.left - 2 || inner.right > box.right + 2;
      if (shown(bit) && isCut) faults.push(`${named(part)} cuts "${bit.innerText}"`);
    }
  }
  for (let i = 0; i < parts.length; i++) for (let j = i + 1; j < parts.length; j++) {
    if (parts[i].contains(parts[j]) || parts[j].contains(parts[i])) continue;
    const a = parts[i].getBoundingClientRect(), b = parts[j].getBoundingClientRect();
    // What is scrolled out of its column lies under the strip but is not seen there.
    const column = (e) => e.closest('[data-dock-region], [data-floating-window], .mantine-Paper-root');
    if (column(parts[i]) !== column(parts[j])) continue;
    const across = Math.min(a.right, b.right) - Math.max(a.left, b.left);
    const down = Math.min(a.bottom, b.bottom) - Math.max(a.top, b.top);
    if (across > 3 && down > 3) faults.push(`${named(parts[i])} overlaps ${named(parts[j])}`);
  }
  return faults;
}"""


@dataclass(frozen=True)
class Picture:
    """One screenshot: what was pressed before it."""

    name: str
    keys: tuple[str, ...] = ()


PICTURES = (Picture("inspect"), Picture("attention", ("2",)), Picture("demo", ("3",)))


def main(folder: Path) -> int:
    """Make all pictures; 1 if one shows a fault."""
    path = executable()
    if path is None:
        print("no Chromium on this machine (apt-get install chromium): no pictures")
        return 1
    folder.mkdir(parents=True, exist_ok=True)
    faults: list[str] = []
    with chromium(path) as browser:
        for name, recording in RECORDINGS.items():
            if not recording.exists():
                print(f"left out: {name} is not on this machine")
                continue
            viewer = Viewer(ViewerConfig(file=recording, port=0))
            try:
                for size in SIZES:
                    faults += photograph(browser, viewer.url, folder, name, size)
            finally:
                viewer.stop()
    for fault in faults:
        print(fault)
    print(f"pictures are in {folder}; {len(faults)} faults")
    return 1 if faults else 0


def photograph(browser, url: str, folder: Path, name: str, size: tuple[int, int]) -> list[str]:
    """All pictures of one recording at one size, and the faults found in them."""
    page = open_page(browser, url, *size, patience=300_000)
    is_phone = size[0] < 500
    image = page.get_by_test_id("reconstruction").locator("img").first
    image.wait_for()
    page.get_by_test_id("lag").first.wait_for(state="hidden")
    width, height = image.evaluate("image => [image.clientWidth, image.clientHeight]")
    image.click(position={"x": width * CLICK[0], "y": height * CLICK[1]})
    if not is_phone:
        page.get_by_text("What pixel (").wait_for()
    found: list[str] = []
    for picture in PICTURES[:1] if is_phone else PICTURES:
        for key in picture.keys:
            page.locator("body").press(key)
        page.wait_for_timeout(2500)
        dismiss_notices(page)
        page.wait_for_timeout(800)
        title = f"{name}_{picture.name}_{size[0]}x{size[1]}"
        page.screenshot(path=folder / f"{title}.png")
        found += [f"{title}: {fault}" for fault in [*page.evaluate(FAULTS), *page.errors]]
    page.context.close()
    return found


if __name__ == "__main__":
    sys.exit(main(Path(sys.argv[1] if len(sys.argv) > 1 else "pictures")))

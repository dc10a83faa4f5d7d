"""`make pictures`: screenshots of every workspace and tab for a look, and a check that nothing is empty or cut off.

python -m tests.browser.pictures [FOLDER]   (needs Chromium; real recordings are left out, by name, where absent)
"""

import sys
from pathlib import Path

from playwright.sync_api import TimeoutError as NotInTime

from app.config import ViewerConfig
from app.main import Viewer
from etnet.bundled import samples
from tests.browser.chromium import WORKSPACES, chromium, executable, open_page, open_tab, open_workspace
from tests.browser.faults import FAULTS, SCENE, SETTLED
from tests.real_data import DATA

SIZES = ((1920, 1080), (1600, 900), (1280, 720), (390, 844))
RECORDINGS = {
    "slider_depth": DATA / "ecd_slider_depth" / "slider_depth.zip",
    "bundled": samples()[0],
    "dvxplorer_face": DATA / "aedat4" / "dvxplorer_lite_face_headphones_1.5s.aedat4",
}
"""The first that is there is shown in every tab, the others in every workspace."""
CLICK = (0.5, 0.4)
"""Where the picture is clicked, as fractions."""
PATIENCE = 300_000
"""Milliseconds for the first image of a whole sensor on a busy machine."""
SETTLING = 45_000
"""Milliseconds that a tab may go on computing; then its picture is taken as it is."""


def main(folder: Path) -> int:
    """Make all pictures; 1 if one shows a fault."""
    path = executable()
    if path is None:
        print("no Chromium on this machine (apt-get install chromium): no pictures")
        return 1
    folder.mkdir(parents=True, exist_ok=True)
    here = {name: file for name, file in RECORDINGS.items() if file.exists()}
    for name in RECORDINGS.keys() - here.keys():
        print(f"left out: {name} is not on this machine")
    faults: list[str] = []
    with chromium(path) as browser:
        for number, (name, recording) in enumerate(here.items()):
            viewer = Viewer(ViewerConfig(file=recording, port=0))
            try:
                for size in SIZES:
                    faults += photograph(browser, viewer.url, folder, name, size, with_tabs=number == 0)
            finally:
                viewer.stop()
    for fault in faults:
        print(fault)
    print(f"pictures are in {folder}; {len(faults)} faults")
    return 1 if faults else 0


def photograph(browser, url: str, folder: Path, name: str, size: tuple[int, int], with_tabs: bool) -> list[str]:
    """All pictures of one recording at one size, and the faults found in them."""
    page = open_page(browser, url, *size, patience=PATIENCE)
    image = page.get_by_test_id("reconstruction").locator("img:visible").first
    image.wait_for()
    width, height = image.evaluate("image => [image.clientWidth, image.clientHeight]")
    image.click(position={"x": width * CLICK[0], "y": height * CLICK[1]})
    found: list[str] = []
    for workspace in WORKSPACES:
        open_workspace(page, workspace)
        if size[0] < 500:  # a tab stands far below the first card
            page.locator(".etv-bar").first.scroll_into_view_if_needed()
            found += take(page, folder, f"{name}_{workspace}_top_{size[0]}x{size[1]}")
        keys = page.locator(".etv-tabs [data-k^='tab:']:visible").evaluate_all("all => all.map(e => e.dataset.k)")
        for key in keys[: None if with_tabs else 1] or [""]:
            if key:
                open_tab(page, key.removeprefix("tab:"))
            title = "_".join([name, workspace, *([key.removeprefix("tab:")] if with_tabs and key else [])])
            found += take(page, folder, f"{title}_{size[0]}x{size[1]}")
    page.context.close()
    return found


def take(page, folder: Path, title: str) -> list[str]:
    """One picture, once nothing is computed any more, and its faults."""
    found = []
    try:
        page.wait_for_function(SETTLED, timeout=SETTLING)
    except NotInTime:
        print(f"{title}: still computing after {SETTLING // 1000} s")
    try:
        page.wait_for_function(SCENE, timeout=SETTLING)
    except NotInTime:
        found.append("the scene's canvas is not where its card is")
    page.screenshot(path=folder / f"{title}.png")
    found += [*page.evaluate(FAULTS), *page.errors]
    page.errors.clear()
    return [f"{title}: {fault}" for fault in found]


if __name__ == "__main__":
    sys.exit(main(Path(sys.argv[1] if len(sys.argv) > 1 else "pictures")))

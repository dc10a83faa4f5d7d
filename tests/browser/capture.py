"""Five seconds of the demo and of the one-file page as a visitor sees them: a film and a sheet of ten frames of each.

python -m tests.browser.capture FOLDER demo|PAGE.html …   (needs Chromium; pages are made by `etnet export page`)

The frames are those that Chromium painted, at the times at which it painted them (screencast), not screenshots.
"""

import base64
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np

from app.config import ViewerConfig
from app.main import Viewer
from app.views.demo.html import ACTS
from etnet.export.video import video_writer
from tests.browser.booth import open_demo, press
from tests.browser.chromium import chromium, executable

SECONDS = 5.0
SIZES = ((1600, 900), (390, 844))
PATIENCE = 300_000
"""Milliseconds until a page is there, on a machine that is busy with other things."""
RATE = 20.0
"""Frames a second of the film; each shows what was painted last."""
ON_SHEET = 10
COLUMNS = {True: 5, False: 10}
"""Of the sheet, for a page that is wider than high and for one that is not."""
SHEET_WIDTH = 2400
WAITS = {"file": 500}
"""Milliseconds before a film begins."""
NOTE_IMAGES = """window.images = [];
let shown;
setInterval(() => {
  const now = document.querySelector(".etv-image img")?.alt;
  if (now && now !== shown) window.images.push(performance.now() / 1000);
  shown = now;
}, 20);"""
"""Seconds since the page was asked for at which another image stood in it."""
SCRUB = """async (seconds) => {
  const play = document.getElementById('play');
  const slider = document.getElementById('seek'), last = Number(slider.max), start = performance.now();
  play.click();
  while (performance.now() - start < seconds * 400) await new Promise(requestAnimationFrame);
  play.click();
  while (performance.now() - start < seconds * 1000) {
    const share = (performance.now() / 1000 - start / 1000) / seconds;
    slider.value = Math.round(last * Math.abs(Math.sin(share * 6)));
    slider.dispatchEvent(new Event('input'));
    await new Promise(requestAnimationFrame);
  }
}"""


@dataclass(frozen=True, eq=False)
class Film:
    """What was painted: `times` in seconds from the beginning, and the pictures (BGR)."""

    times: np.ndarray
    frames: list[np.ndarray]

    def at(self, second: float) -> np.ndarray:
        """What stood on the screen at that time."""
        return self.frames[max(int(np.searchsorted(self.times, second, side="right")) - 1, 0)]

    @property
    def flashes(self) -> list[float]:
        """When a frame stood between two that are alike and was like neither: a flicker, or a drag that turned."""
        small = [cv2.resize(frame, (160, 90), interpolation=cv2.INTER_AREA).astype(np.float32) for frame in self.frames]
        apart = lambda a, b: float(np.abs(a - b).mean())  # noqa: E731
        return [
            round(float(self.times[i]), 2)
            for i in range(1, len(small) - 1)
            if min(apart(small[i], small[i - 1]), apart(small[i], small[i + 1]))
            > 2 + 3 * apart(small[i - 1], small[i + 1])
        ]


def record(page, act: Callable[[], object]) -> Film:
    """Do something with the page, and keep everything that is painted meanwhile."""
    session = page.context.new_cdp_session(page)
    painted: list[tuple[float, bytes]] = []

    def keep(said: dict) -> None:
        painted.append((said["metadata"]["timestamp"], base64.b64decode(said["data"])))
        session.send("Page.screencastFrameAck", {"sessionId": said["sessionId"]})

    session.on("Page.screencastFrame", keep)
    session.send("Page.startScreencast", {"format": "jpeg", "quality": 90, "everyNthFrame": 1})
    began = time.time()
    act()
    session.send("Page.stopScreencast")
    if not painted:
        raise RuntimeError("the browser painted nothing; is the page hidden?")
    frames = [cv2.imdecode(np.frombuffer(content, np.uint8), cv2.IMREAD_COLOR) for _, content in painted]
    whole = [(at - began, frame) for (at, _), frame in zip(painted, frames, strict=True) if frame is not None]
    return Film(np.array([at for at, _ in whole]), [frame for _, frame in whole])


def keep(film: Film, folder: Path, name: str) -> None:
    """Write film and sheet, and say how smooth it was."""
    height, width = film.frames[0].shape[:2]
    with video_writer(folder / f"{name}.mp4", width, height, RATE, is_grey=False) as write:
        for number in range(int(SECONDS * RATE)):
            write(np.ascontiguousarray(film.at(number / RATE)[..., ::-1]))
    columns = COLUMNS[width > height]
    tile = SHEET_WIDTH // columns
    tiles = [stamped(film.at(second), second, tile) for second in np.linspace(0, SECONDS, ON_SHEET, endpoint=False)]
    rows = [np.hstack(tiles[start : start + columns]) for start in range(0, ON_SHEET, columns)]
    cv2.imwrite(str(folder / f"{name}.png"), np.vstack(rows))
    gaps = np.diff([0.0, *film.times, SECONDS])
    print(f"{name}: {len(film.times)} paints, longest pause {gaps.max():.2f} s, flashes at {film.flashes}")


def stamped(frame: np.ndarray, second: float, width: int) -> np.ndarray:
    """A frame of the sheet, with its time above it."""
    height = round(frame.shape[0] * width / frame.shape[1])
    small = cv2.resize(frame, (width - 4, height), interpolation=cv2.INTER_AREA)
    tile = np.full((height + 26, width, 3), 40, np.uint8)
    tile[26:, 2 : width - 2] = small
    cv2.putText(tile, f"{second:.1f} s", (6, 19), cv2.FONT_HERSHEY_SIMPLEX, 0.55, (255, 255, 255), 1, cv2.LINE_AA)
    return tile


def film_demo(browser, folder: Path) -> None:
    """The demo as a visitor meets it who comes cold; then each act, and all that can be opened."""
    viewer = Viewer(ViewerConfig(demo=True, port=0))
    try:
        viewer.rehearse()
        for width, height in SIZES:
            film_cold(browser, viewer, folder, width, height)
            page = open_demo(browser, viewer, width, height)
            for act in ACTS:
                page.locator(f".etv-demo[data-act={act}]").wait_for()
                keep(record(page, lambda page=page: page.wait_for_timeout(SECONDS * 1000)), folder, f"{act}_{width}")
            for name, prepare in OPENED.items():
                if name == "guess" and width < 500:
                    continue  # a group's game: a phone has no button for it
                prepare(page)
                film = record(page, lambda page=page: page.wait_for_timeout(SECONDS * 1000))
                keep(film, folder, f"{name}_{width}")
            page.context.close()
    finally:
        viewer.stop()


def film_cold(browser, viewer: Viewer, folder: Path, width: int, height: int) -> None:
    """The first seconds of a page that nobody has loaded before."""
    phone = {"is_mobile": True, "has_touch": True} if width < 500 else {}
    context = browser.new_context(viewport={"width": width, "height": height}, **phone)
    context.add_init_script(NOTE_IMAGES)
    page = context.new_page()
    page.set_default_timeout(PATIENCE)
    page.goto(viewer.url, wait_until="commit")
    film = record(page, lambda: page.wait_for_timeout(SECONDS * 1000))
    page.wait_for_function("() => window.images.length > 2")
    first, second = page.evaluate("() => window.images.slice(0, 2)")
    context.close()  # it would go on painting, and take the processor from the film that is written
    print(f"first image after {first:.1f} s, motion {second - first:.1f} s later")
    keep(film, folder, f"cold_{width}")


def _show_the_mirror(page) -> None:
    press(page, "Use my camera")
    page.get_by_test_id("delay").wait_for()


def _show_the_page_to_take_home(page) -> None:
    press(page, "Take it home")
    page.get_by_test_id("home-link").wait_for()


def _guess(page) -> None:
    press(page, "Close")
    page.evaluate("() => document.querySelector('[data-etv-camera-stop]').click()")
    page.get_by_test_id("mirror").wait_for(state="hidden")
    page.locator(".etv-image img").wait_for()
    press(page, "Guess first")


OPENED: dict[str, Callable] = {
    "consent": lambda page: press(page, "Your own face"),
    "mirror": _show_the_mirror,
    "home": _show_the_page_to_take_home,
    "guess": _guess,
}
"""What a visitor opens, one after the other."""


def film_page(browser, file: Path, folder: Path) -> None:
    """A one-file page, from disk with the network off: it plays for two seconds and is dragged for three."""
    for width, height in SIZES:
        context = browser.new_context(viewport={"width": width, "height": height}, offline=True)
        page = context.new_page()
        page.set_default_timeout(PATIENCE)
        page.goto(file.resolve().as_uri())
        page.wait_for_function("() => document.documentElement.dataset.shown !== undefined")
        page.wait_for_timeout(WAITS["file"])
        film = record(page, lambda page=page: page.evaluate(SCRUB, SECONDS))
        context.close()
        keep(film, folder, f"{file.stem}_{width}")


def main(folder: Path, names: list[str]) -> int:
    """Film everything; 1 where there is no browser."""
    path = executable()
    if path is None:
        print("no Chromium on this machine (apt-get install chromium): nothing to film with")
        return 1
    folder.mkdir(parents=True, exist_ok=True)
    with chromium(path) as browser:
        for name in names:
            if name == "demo":
                film_demo(browser, folder)
            else:
                film_page(browser, Path(name), folder)
    return 0


if __name__ == "__main__":
    if len(sys.argv) < 3:
        sys.exit("usage: python -m tests.browser.capture FOLDER demo|PAGE.html …")
    sys.exit(main(Path(sys.argv[1]), sys.argv[2:]))

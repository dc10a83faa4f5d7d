"""A dropped video on the page: seconds from moving one of its sliders to the events of that other film.

`python video_slider.py [--film FILM.mp4] [--rounds 3]`. A browser drops two seconds of a known scene (or FILM) on a
running viewer and waits until the film is made. Then it moves contrast and noise with the keyboard and chooses
bandwidths and sizes, at the first window and at the last, up to which the other film has to be made. The clock is the
page's own: it starts with the key or the click, and stops when the same window's picture of events of the new film is
decoded in the document. For a true figure the machine should have nothing else to do.
"""

from __future__ import annotations

import argparse
import statistics
import sys
import tempfile
from pathlib import Path

from measure import report

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from app.config import ViewerConfig
from app.main import Viewer
from tests.browser.chromium import chromium, executable, open_page, until_window
from tests.browser.test_video import drop
from tests.simulation.films import write_film
from tests.simulation.known_motion import KnownScene

PATIENCE = 300_000
SECONDS = 2
AIM = 1.0
_CLOCK = """() => {
    const began = () => { window.beganAt = performance.now(); };
    document.addEventListener("keydown", began, true);
    document.addEventListener("click", began, true);
}"""
_PICTURE = "img[alt*=' events of window ']"
_SHOWN = """picture => {
    const image = document.querySelector(picture);
    return [image.src, image.alt.split(" of ")[1]];
}"""
_ARRIVED = """([picture, [before, place], chosen]) => {
    const image = document.querySelector(picture);
    const there = document.querySelector(chosen) && image && image.src !== before && image.alt.endsWith(` of ${place}`);
    return there && image.complete && image.naturalWidth ? performance.now() - window.beganAt : false;
}"""


def film_of(folder: Path) -> Path:
    """Two seconds of a photo that turns and drifts by 4 pixels a frame, 240 × 180."""
    scene = KnownScene(4.0, True, num_frames=30 * SECONDS)
    return write_film(folder / "known.mp4", scene.film)


def changed(page, act, chosen: str) -> float:
    """Seconds from what `act` does to the same window's events in the film whose button `chosen` (a selector) is on."""
    before = page.evaluate(_SHOWN, _PICTURE)
    act()
    took = page.wait_for_function(_ARRIVED, arg=[_PICTURE, before, chosen], polling="raf", timeout=PATIENCE)
    return took.json_value() / 1000


def measured(page, rounds: int) -> dict[str, list[float]]:
    """Seconds of each change, by what was changed."""
    found: dict[str, list[float]] = {"contrast": [], "noise": [], "bandwidth": [], "size": []}
    sliders = page.get_by_role("slider")

    def until_made() -> None:
        page.get_by_test_id("film").get_by_text("all of its").wait_for()

    def setting() -> list[str]:
        key = page.locator("[data-testid=film-choices] .etv-on").first.get_attribute("data-k")
        return key.split("~")

    for _ in range(rounds):
        for name, number, place in (("contrast", 0, 1), ("noise", 1, 2)):
            now = setting()
            now[place] = f"{float(now[place]) + (0.05 if name == 'contrast' else 0.1):.2f}"
            sliders.nth(number).focus()
            on = f"[data-testid=film-choices] .etv-on[data-k*='~{now[1]}~{now[2]}~']"
            found[name].append(changed(page, lambda n=number: sliders.nth(n).press("ArrowRight"), on))
            until_made()
        for name, row in (("bandwidth", 0), ("size", 1)):
            group = page.locator("[data-testid=film-choices] .etv-row").nth(row)
            button = group.locator("button:not(.etv-on)").first
            key = button.get_attribute("data-k")
            on = f"[data-testid=film-choices] .etv-on[data-k='{key}']"
            found[name].append(changed(page, button.click, on))
            until_made()
    return found


def main() -> None:
    """Measure and keep."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--film", type=Path)
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--threads", type=int, default=2)
    options = parser.parse_args()
    path = executable()
    if path is None:
        raise SystemExit("no Chromium on this machine (apt-get install chromium)")
    viewer = Viewer(ViewerConfig(port=0, precision="fp32", threads=options.threads, uploads=64, cache="off"))
    try:
        with tempfile.TemporaryDirectory() as folder, chromium(path) as browser:
            page = open_page(browser, viewer.url, 1600, 900, patience=PATIENCE)
            drop(page, options.film or film_of(Path(folder)))
            page.get_by_test_id("film").get_by_text("all of its").wait_for()
            until_window(page, 0)
            page.evaluate(_CLOCK)
            found = {"first window": measured(page, options.rounds)}
            page.locator("body").press("End")
            until_window(page, int(page.get_by_test_id("window").inner_text().split()[-1]))
            found["last window"] = measured(page, options.rounds)
    finally:
        viewer.stop()
    rows: list[dict[str, object]] = [
        {"where": where, "what": what, "median_s": statistics.median(took), "worst_s": max(took), "aim_s": AIM}
        for where, changes in found.items()
        for what, took in changes.items()
    ]
    report("video_slider", rows)


if __name__ == "__main__":
    main()

"""How many files of the viewer a visitor's act passes: a slider drag, a click on a pixel, an upload.

Calls are traced on a real viewer with the default weights, from the act until its answer is on the page. A file counts
if any of its functions ran on the way: somebody who looks for a line has so many places to look. What is done beside
an act, whether there is one or not, is no part of it: the catalogue looked at every half second, other frames prepared.

Run: python benchmarks/paths.py [--list]
"""

import asyncio
import json
import re
import sys
import threading
from pathlib import Path

from measure import leave, report
from websockets.asyncio.client import connect

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from app.config import ViewerConfig
from app.main import Viewer
from app.web.upload_endpoint import PATH
from etnet.bundled import samples
from tests.app.stand_ins import Browser

AIM = {"drag": 25, "click": 30, "upload": 35}
BESIDE = {("session/session.py", "_tidy"), ("engine/prefetch.py", "work"), ("engine/prefetch.py", "has_work")}
"""Functions that, with all that they call, are no part of an act."""
_HOUSE = str(Path(__file__).resolve().parents[1] / "app") + "/"


class Tracer:
    """Collects the files whose functions are called, on every thread, while it is on."""

    def __init__(self) -> None:
        self.files: set[str] = set()
        self.is_on = False
        self._beside = threading.local()
        threading.setprofile(self._note)
        sys.setprofile(self._note)

    def _note(self, frame, event, _argument) -> None:
        if event not in ("call", "return") or not frame.f_code.co_filename.startswith(_HOUSE):
            return
        name = frame.f_code.co_filename.removeprefix(_HOUSE)
        depth = getattr(self._beside, "depth", 0)
        if (name, frame.f_code.co_name) in BESIDE:
            self._beside.depth = depth + (1 if event == "call" else -1)
        elif self.is_on and event == "call" and depth == 0:
            self.files.add(name)

    def begin(self) -> None:
        self.files = set()
        self.is_on = True

    def end(self) -> set[str]:
        self.is_on = False
        return self.files


async def _until(browser: Browser, pattern: str, patience: float = 120) -> None:
    await browser.until(lambda: re.search(pattern, browser.html()) is not None, patience)


async def _quiet() -> None:
    """The page rests: what runs every half second is not part of an act."""
    await asyncio.sleep(1.5)


async def _story(viewer: Viewer, tracer: Tracer) -> dict[str, set[str]]:
    passed, port = {}, viewer.port
    async with Browser.open(port, tab=1) as browser:
        await _until(browser, "Reconstruction of window 0")
        channel = browser.widget("channel")
        await _quiet()
        tracer.begin()
        for counter in range(5):
            await browser.use(channel, f"pick|span:0,1.0|{0.2 + counter / 50}|0.5|{10 + counter}")
            await asyncio.sleep(0.05)
        await _until(browser, r"window [1-9]\d* <i>of")
        await asyncio.sleep(0.1)
        passed["drag"] = tracer.end()
        await browser.use(channel, "key|end|20")
        await browser.use(browser.widget("Window"), 0)
        await _until(browser, "Reconstruction of window 0")
        await browser.use(channel, "pick|workspace:attention|0.5|0.5|21")
        await _quiet()
        tracer.begin()
        await browser.use(channel, "pick|pixel|0.4|0.4|22")
        await _until(browser, 'data-testid="scale1.decoder.0.cross"')
        passed["click"] = tracer.end()
        await _quiet()
        tracer.begin()
        await _upload(port, _ticket(browser))
        await _until(browser, "mine.h5")
        passed["upload"] = tracer.end()
    return passed


def _ticket(browser: Browser) -> str:
    """What lets this page upload files."""
    found = re.search(r'data-etv-ticket="([^"]+)"', browser.html())
    assert found is not None
    return found[1]


async def _upload(port: int, ticket: str) -> None:
    content = samples()[0].read_bytes()
    async with connect(f"ws://127.0.0.1:{port}{PATH}", max_size=None) as socket:
        await socket.send(json.dumps({"ticket": ticket, "name": "mine.h5", "size": len(content)}))
        for start in range(0, len(content), 1 << 18):
            await socket.recv()
            await socket.send(content[start : start + (1 << 18)])
        await socket.recv()
        await socket.send(b"")  # that was all
        while "done" not in json.loads(await socket.recv()):
            pass


def main() -> None:
    """Trace one visit and report the counts."""
    tracer = Tracer()
    viewer = Viewer(ViewerConfig(port=0, cache="off"))
    try:
        passed = asyncio.run(_story(viewer, tracer))
    finally:
        sys.setprofile(None)
        threading.setprofile(None)
        viewer.stop()
    if "--list" in sys.argv:
        for what, files in passed.items():
            print(f"{what}: {len(files)}\n  " + "\n  ".join(sorted(files)))
        return
    report("paths", [{"what": what, "files": len(files), "aim": AIM[what]} for what, files in passed.items()])


if __name__ == "__main__":
    main()
    leave()

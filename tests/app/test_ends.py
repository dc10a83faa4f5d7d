"""However the viewer is asked to end, it ends at once, with 0, and leaves nothing behind."""

import asyncio
import http.client
import os
import re
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import pytest

from tests.app.stand_ins import Browser

ROOT = Path(__file__).parents[2]
START = "import sys; from app.main import main; sys.exit(main(sys.argv[1:]))"


@pytest.fixture
def started(tmp_path):
    """Starts viewers with a temporary folder of their own; gives the process and its port."""
    running = []

    def start(*options):
        environment = {**os.environ, "TMPDIR": str(tmp_path), "PYTHONPATH": str(ROOT), "OMP_NUM_THREADS": "1"}
        command = [sys.executable, "-c", START, "--port", "0", "--model", "leaky-integrator", *options]
        viewer = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=environment)
        running.append(viewer)
        line = viewer.stdout.readline()
        assert "open http" in line, viewer.stderr.read()[-2000:]
        return viewer, line, int(line.split("localhost:")[-1].split("127.0.0.1:")[-1].split(" ")[0].split("/")[0])

    yield start
    for viewer in running:
        viewer.kill()
        viewer.communicate()


def dragging(viewer, port, ask):
    """A visitor drags while the viewer is asked to end; seconds until it had."""

    async def story():
        async with Browser.open(port, tab=5) as browser:
            await browser.until(lambda: any(props.get("label") == "Window" for props in browser.widgets.values()), 60)
            slider = browser.widget("Window")
            for i in range(15):
                await browser.use(slider, i)
                await asyncio.sleep(0.02)
            began = time.monotonic()
            ask(viewer)
            i = 0
            while viewer.poll() is None and time.monotonic() - began < 10:
                i += 1
                try:
                    await browser.use(slider, i % 20)
                except Exception:  # the connection ends with the viewer
                    break
                await asyncio.sleep(0.01)
            return began

    began = asyncio.run(story())
    viewer.wait(timeout=10)
    return time.monotonic() - began


@pytest.mark.parametrize("number", [(signal.SIGINT,), (signal.SIGTERM,), (signal.SIGHUP,), (signal.SIGINT,) * 3])
def test_signals_end_it_within_five_seconds_while_somebody_drags(started, tmp_path, number):
    viewer, _, port = started()

    def ask(process):
        for each in number:
            process.send_signal(each)
            time.sleep(0.05)

    assert dragging(viewer, port, ask) < 5
    _, errors = viewer.communicate()
    assert viewer.returncode == 0
    assert "Traceback" not in errors
    assert [name for name in os.listdir(tmp_path) if name.startswith("etnet-")] == []


def test_what_a_killed_viewer_left_is_swept_at_the_next_start(started, tmp_path):
    left = tmp_path / "etnet-uploads-old"
    (left / "visitor").mkdir(parents=True)
    (left / ".held").write_bytes(b"")
    (left / "visitor" / "secret.raw").write_bytes(b"events")
    started()
    assert not left.exists()


def test_a_demo_says_how_far_its_first_scene_is_before_its_address(tmp_path):
    environment = {**os.environ, "TMPDIR": str(tmp_path), "PYTHONPATH": str(ROOT), "OMP_NUM_THREADS": "1"}
    command = [sys.executable, "-c", START, "--port", "0", "--model", "leaky-integrator", "--demo", "--cache", "off"]
    viewer = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, env=environment)
    try:
        said = ""
        while "open http" not in said:
            line = viewer.stdout.readline()
            assert line, said
            said += line
    finally:
        viewer.kill()
        viewer.communicate()
    told = re.findall(r"Preparing the first scene: image (\d+) of (\d+)", said.partition("open http")[0])
    totals = {int(total) for _, total in told}
    assert len(totals) == 1
    assert [int(done) for done, _ in told] == list(range(1, totals.pop() + 1))


def test_a_token_with_odd_signs_prints_an_address_that_opens(started):
    token = 'a&b+c;"% é#/?='
    _, line, port = started("--token", token)
    connection = http.client.HTTPConnection("127.0.0.1", port, timeout=10)
    path = "/" + line.split("/", 3)[3].split(" ")[0]
    connection.request("GET", path)
    answer = connection.getresponse()
    assert answer.status == 302
    cookie = answer.getheader("Set-Cookie").partition(";")[0]
    connection.close()
    connection.request("GET", "/", headers={"Cookie": cookie})
    assert connection.getresponse().status == 200
    connection.close()
    assert tempfile.gettempdir() not in line


def test_a_folder_of_odd_names_and_damaged_weights_opens_and_says_what_is_left_out(started, tmp_path):
    folder = tmp_path / "data"
    folder.mkdir()
    from etnet.events.write import write_recording
    from tests.app.stand_ins import recording

    write_recording(recording(), folder / "plain.csv")
    name = "caf\\xe9.csv"
    os.rename(folder / "plain.csv", os.fsencode(folder) + b"/caf\xe9.csv")
    (folder / "null.safetensors").write_bytes(b"\x08" + bytes(7) + b"null    ")
    (folder / "deep.safetensors").write_bytes((5000).to_bytes(8, "little") + b"[" * 5000)
    os.mkfifo(folder / "pipe.safetensors")
    viewer, _, port = started("--data", str(folder))

    async def story():
        async with Browser.open(port, tab=5) as browser:
            await browser.until_shown("15,838 events", 30)
            await browser.use(browser.widget("channel"), "pick|workspace:recording|0|0|1")
            held = browser.widgets[browser.widget("Recording")]
            await browser.until(lambda: name in held["options"], 30)
            await browser.use(browser.widget("Recording"), name)
            await browser.until(lambda: "15,838 events" not in browser.html(), 30)
            await browser.until_shown("Reconstruction", 30)

    asyncio.run(story())
    viewer.send_signal(signal.SIGTERM)
    _, errors = viewer.communicate(timeout=10)
    assert "left out of the list of networks: null.safetensors" in errors
    assert "Traceback" not in errors

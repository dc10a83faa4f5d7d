import asyncio
import subprocess
import sys

import numpy as np
import pytest

import app
from app.catalogue.recordings import suited_policy
from app.notebook import NotShownError
from etnet.bundled import samples
from etnet.errors import EtnetError
from etnet.events.events import Events, Sensor
from etnet.events.open import open_recording
from etnet.events.opened_as import View
from etnet.events.recording import recording_of_events
from etnet.voxel import voxel_array
from etnet.windows import BetweenFrames, plan_windows
from tests.app.stand_ins import Browser

ROI = (86, 60, 60, 44)


def test_a_notebook_gets_the_page_and_the_arrays_of_what_it_shows():
    shown_in = app.view(samples()[0], roi="86,60,60,44", precision="fp32", threads=1, budget=64)
    try:
        assert f'src="{shown_in.url}"' in shown_in._repr_html_()
        with pytest.raises(NotShownError, match="nothing yet"):
            shown_in.shown  # noqa: B018

        async def look():
            async with Browser.open(int(shown_in.url.rsplit(":", 1)[1]), tab=1) as browser:
                await browser.until_shown("Reconstruction of window 0", 60)
                await browser.use(browser.widget("Window"), 2)
                await browser.until(lambda: shown_in.shown.window.index == 2 and shown_in.shown.frame is not None, 60)
                return shown_in.shown

        shown = asyncio.run(look())
    finally:
        shown_in.stop()
    with open_recording(samples()[0], view=View(ROI, 1)) as recording:
        window = plan_windows(recording, BetweenFrames())[2]
        events = recording.read(window.start, window.stop)
        assert shown.window == window
        assert np.array_equal(shown.events.t, events.t)
        assert np.array_equal(shown.voxel, voxel_array(events, 5))
        assert shown.frame.shape == shown.camera.shape == (ROI[3], ROI[2])


def test_a_function_of_a_notebook_is_a_tab_of_its_page():
    def busy_pixels(moment):
        return f"{len(moment.events)} events in window {moment.window.index}"

    shown_in = app.view(samples()[-1], views=[busy_pixels], precision="fp32", threads=1, budget=64)

    async def look():
        async with Browser.open(int(shown_in.url.rsplit(":", 1)[1]), tab=1) as browser:
            await browser.until_shown('data-k="tab:own-busy-pixels"', 60)
            await browser.use(browser.widget("channel"), "pick|tab:own-busy-pixels|0.5|0.5|1")
            await browser.until_shown("events in window 0", 60)
            await browser.use(browser.widget("Window"), 2)
            await browser.until_shown("events in window 2", 60)
            return browser.words()

    try:
        words = asyncio.run(look())
    finally:
        shown_in.stop()
    with open_recording(samples()[-1]) as recording:
        window = plan_windows(recording, suited_policy(recording))[2]
    assert f"{window.num_events} events in window 2" in words


def test_a_recording_without_a_file_is_told_what_to_do():
    recording = recording_of_events(Events.empty(Sensor(8, 8)), "in memory")
    with pytest.raises(EtnetError, match="write it"):
        app.view(recording)


def test_the_public_name_loads_nothing_heavy_before_it_is_used():
    code = "import app, sys; app.__all__; assert not {'torch', 'viser'} & set(sys.modules)"
    subprocess.run([sys.executable, "-c", code], check=True)

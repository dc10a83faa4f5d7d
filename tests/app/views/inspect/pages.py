"""A moment and a page of the small network's playback, as the inspectors get them."""

from dataclasses import replace

from app.engine.jobs import JobResult
from app.html.moment import Moment
from app.views.page import Page
from tests.app.small_loaded import POLICY


def moment_of(loaded):
    return Moment("r", POLICY, 5, loaded.playback.recording, loaded.playback.windows)


def page_of(state, moment, ready, **results):
    found = {f"inspect.{name}": JobResult(job, value, 1.0, True) for name, (job, value) in results.items()}
    return Page(replace(state, recording_id="r", model_id="m"), moment, ready, results=found)

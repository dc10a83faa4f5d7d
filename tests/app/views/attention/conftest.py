"""The small network's moment, and a page over it with the results of chosen jobs."""

import pytest

from app.engine.jobs import JobResult
from app.html.moment import Moment
from app.views.page import Page
from tests.app.small_loaded import POLICY, loaded_of, request_of, whole
from tests.app.views.attention.small_page import CHOSEN, INDEX, STATE, ready_of


@pytest.fixture(scope="package")
def loaded():
    return loaded_of()


@pytest.fixture(scope="package")
def ready(loaded):
    return ready_of(loaded, request_of(INDEX))


@pytest.fixture
def page_of(loaded, ready):
    def make(slice_=CHOSEN, jobs=(), ready=ready, **more):
        found = {f"attention.{slot}": JobResult(job, whole(job, loaded), 1.0, True) for slot, job in jobs}
        playback = loaded.playback
        moment = Moment("r", POLICY, INDEX, playback.recording, playback.windows)
        more = {"state": STATE, **more}
        state = more.pop("state").put(slice_)
        return Page(state, moment, ready, results=found, areas={}, **more)

    return make

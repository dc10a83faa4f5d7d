"""Work of the engine's own that fails: the thread goes on with what visitors ask for."""

import time

import pytest

import app.engine.engine as engine_module
from tests.app.fakes import Inbox, request
from tests.live.sources import wait_for


@pytest.mark.parametrize("fails", ["try_kernels", "forget"])
def test_work_that_fails_ends_nothing_and_does_not_spin(make_engine, monkeypatch, fails):
    engine, inbox, tried = make_engine(), Inbox(), []

    def fail(*_):
        tried.append(fails)
        raise TypeError("no such thing")

    monkeypatch.setattr(engine._playbacks, fails, fail)
    if fails == "try_kernels":
        monkeypatch.setattr(type(engine._playbacks), "has_untried", True)
        engine.request("ada", request(1), inbox)
        inbox.ready(1)
    else:
        engine.forget("r")
    wait_for(lambda: tried, 10)
    began = time.monotonic()
    for index in range(2, 6):
        engine.request("ada", request(index), inbox)
        inbox.ready(index)
    assert len(tried) <= 10 + (time.monotonic() - began) / engine_module.PAUSE

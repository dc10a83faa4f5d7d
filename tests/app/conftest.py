"""An engine over a network that counts, waits and breaks where a test tells it to."""

import pytest

from app.engine.engine import Engine

from .fakes import Shelf

BUDGET = 64 << 20


@pytest.fixture
def shelf():
    return Shelf()


@pytest.fixture
def make_engine(shelf):
    made = []

    def make(budget=BUDGET, prefetches=False, **more):
        engine = Engine(shelf, budget, threads=1, load=shelf.load, prefetches=prefetches, **more)
        made.append(engine)
        return engine

    yield make
    for engine in made:
        if shelf.model_instance.gate is not None:
            shelf.model_instance.gate.release(10_000)
        engine.stop()

"""A viewer of a replayed source with a small real network, for pages without a screen."""

import contextlib
import itertools
from dataclasses import dataclass, replace

from app.catalogue.live import LiveFeed
from app.catalogue.recordings import Catalogue
from app.catalogue.visitor import VisitorCatalogue
from app.config import ViewerConfig
from app.engine.engine import Engine
from app.session.demo import public_view
from app.session.session import Session
from app.state.view_state import ViewState
from app.views import VIEWS
from app.views.live import VIEW as LIVE
from app.web.peer import sits_here
from app.web.server import Address, free_port, start_server
from etnet.events.events import Sensor
from etnet.events.recording import recording_of_events
from etnet.live.replay import Replay
from etnet.nets.presets import build_model
from tests.strategies import make_events

MODEL = build_model("tiny")
SENSOR = Sensor(40, 28)


def replayed(speed=1.0, num_events=12_000, sensor=SENSOR):
    """A source of 0.6 s that goes round and round."""
    return Replay(recording_of_events(make_events(num_events, sensor, duration=600_000)), speed, is_looped=True)


@dataclass
class LiveViewer:
    """What runs behind the page."""

    port: int
    feed: LiveFeed
    engine: Engine
    catalogue: Catalogue
    sessions: dict
    default: ViewState

    @property
    def page(self):
        """What the one visitor was shown last."""
        drawn = [session.drawn for session in self.sessions.values() if session.drawn is not None]
        return drawn[-1][1] if drawn else None


@contextlib.contextmanager
def live_viewer(source=None, keep=None, record=None, view=lambda state: state, public_url=None, is_demo=False):
    feed = LiveFeed(replayed() if source is None else source, keep, record=record)
    catalogue = Catalogue(ViewerConfig(), feed)
    default = ViewState(catalogue.entries()[0].id, catalogue.models()[0].id)
    default = view(public_view(default) if is_demo else default)
    engine = Engine(
        catalogue, 64 << 20, threads=1, load=lambda *_: MODEL, live=(feed, default.model_id, default.precision)
    )
    sessions = {}

    def visit(client):
        seen = VisitorCatalogue(catalogue, is_host=not is_demo and sits_here(public_url))
        sessions[client.client_id] = Session(client, seen, engine, default, views=(*VIEWS, LIVE))
        return sessions[client.client_id]

    server = start_server(Address(), free_port("127.0.0.1", 18_700), visit)
    feed.start()
    try:
        yield LiveViewer(server.get_port(), feed, engine, catalogue, sessions, default)
    finally:
        server.stop()
        engine.stop()
        catalogue.close()


_counter = itertools.count()


async def press(browser, key, u=0.5, v=0.5):
    """A click on HTML of the page."""
    await browser.use(browser.widget("channel"), f"pick|{key}|{u}|{v}|{next(_counter)}")


__all__ = ["MODEL", "SENSOR", "LiveViewer", "live_viewer", "press", "replace", "replayed"]

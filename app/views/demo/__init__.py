"""The page in public: one sentence, large live pictures, and things to do with them."""

from __future__ import annotations

from typing import TYPE_CHECKING

from app.engine.downloads import Downloaded
from app.state import intents as ask
from app.views.demo.jobs import home_jobs
from app.views.demo.state import DemoState, hear, reduce_demo
from app.views.view import View

if TYPE_CHECKING:
    import viser

    from app.views.panel import Panel


def _panel(client: viser.ClientHandle) -> Panel:
    from app.views.demo.panel import DemoPanel

    return DemoPanel()


VIEW = View(
    "demo",
    "Demo",
    "PRESENTATION",
    DemoState(),
    _panel,
    workspaces=frozenset({"demo"}),
    is_public=True,
    reduce=reduce_demo,
    intents=(ask.Query, ask.QueryFraction, ask.OpenRecording, Downloaded),
    hear=hear,
    background_jobs=home_jobs,
)

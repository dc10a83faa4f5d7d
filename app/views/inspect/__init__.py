"""What a pixel owes to each part of the network, to its events and to its state; and what changes without them."""

from __future__ import annotations

from typing import TYPE_CHECKING

from app.views.inspect.jobs.inspect import inspect_jobs
from app.views.inspect.scene_cloud import scene_cloud
from app.views.inspect.state import InspectState, changed_request, hear, reduce_inspect
from app.views.view import View

if TYPE_CHECKING:
    import viser

    from app.views.panel import Panel


def _panel(client: viser.ClientHandle) -> Panel:
    from app.views.inspect.panel import InspectPanel

    return InspectPanel()


VIEW = View(
    "inspect",
    "Inspector",
    "MICROSCOPE",
    InspectState(),
    _panel,
    settings_in=frozenset({"inspect", "attention"}),
    reduce=reduce_inspect,
    hear=hear,
    jobs=inspect_jobs,
    change_request=changed_request,
    cloud=scene_cloud,
)

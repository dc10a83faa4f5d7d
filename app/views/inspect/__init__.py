"""What a pixel owes to each part of the network, to its events and to its state; and what changes without them."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING

from app.state import intents as ask
from app.views.inspect.commands import COMMANDS
from app.views.inspect.state import InspectState, changed_request, hear, reduce_inspect
from app.views.view import View

if TYPE_CHECKING:
    import viser

    from app.engine.jobs import Job
    from app.engine.requests import FrameRequest
    from app.html.pictures import EventCloud
    from app.state.view_state import ViewState
    from app.views.page import Page
    from app.views.panel import Panel


def _panel(client: viser.ClientHandle) -> Panel:
    from app.views.inspect.panel import InspectPanel

    return InspectPanel()


def _jobs(state: ViewState, request: FrameRequest) -> Mapping[str, Job]:
    from app.views.inspect.jobs.inspect import inspect_jobs

    return inspect_jobs(state, request)


def _cloud(page: Page) -> Callable[[int], EventCloud] | None:
    from app.views.inspect.scene_cloud import scene_cloud

    return scene_cloud(page)


def _over_timeline(page: Page) -> str:
    from app.views.inspect.html.on_timeline import change_on_timeline

    return change_on_timeline(page)


VIEW = View(
    "inspect",
    "Inspector",
    "MICROSCOPE",
    InspectState(),
    _panel,
    settings_in=frozenset({"inspect", "attention"}),
    reduce=reduce_inspect,
    intents=(ask.OpenRecording, ask.ReopenRecording, ask.ChooseModel, ask.ChoosePolicy, ask.ChooseCleaning),
    hear=hear,
    jobs=_jobs,
    change_request=changed_request,
    cloud=_cloud,
    over_timeline=_over_timeline,
    commands=COMMANDS,
)

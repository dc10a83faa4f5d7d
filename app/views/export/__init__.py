"""What can be taken home of the recording, and the address of the moment."""

from __future__ import annotations

from typing import TYPE_CHECKING

from app.engine.downloads import Downloaded
from app.views.export.jobs import export_jobs
from app.views.export.state import ExportState, reduce_export
from app.views.view import EXPERT, View

if TYPE_CHECKING:
    import viser

    from app.views.panel import Panel


def _panel(client: viser.ClientHandle) -> Panel:
    from app.views.export.panel import ExportPanel

    return ExportPanel()


VIEW = View(
    "export",
    "Export",
    "DOWNLOAD",
    ExportState(),
    _panel,
    settings_in=EXPERT,
    reduce=reduce_export,
    intents=(Downloaded,),
    background_jobs=export_jobs,
)

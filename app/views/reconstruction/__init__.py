"""What the network makes of the events, beside what an ordinary camera saw."""

from __future__ import annotations

from typing import TYPE_CHECKING

from app.views.reconstruction.jobs import reconstruction_jobs
from app.views.reconstruction.state import ReconstructionState
from app.views.view import EXPERT, Card, View

if TYPE_CHECKING:
    import viser

    from app.views.panel import Panel


def _panel(client: viser.ClientHandle) -> Panel:
    from app.views.reconstruction.panel import ReconstructionPanel

    return ReconstructionPanel()


VIEW = View(
    "reconstruction",
    "Reconstruction",
    "PHOTO",
    ReconstructionState(),
    _panel,
    workspaces=EXPERT - {"attention", "compare", "recording"},
    cards=(
        Card("reconstruction", stage=frozenset({"inspect"})),
        Card("camera", stage=frozenset({"inspect"})),
    ),
    is_public=True,
    jobs=reconstruction_jobs,
)

"""Which runs a page's export holds side by side, and how they are shown: as *Compare* shows them."""

from __future__ import annotations

from typing import TYPE_CHECKING

from app.views.compare.state import NAMES, CompareState, Sight
from app.views.export.state import OrderedRun
from app.views.page import Page

if TYPE_CHECKING:
    from etnet.export import compared

SIGHTS: dict[Sight, compared.Sight] = {
    "side by side": "frames", "swipe": "frames", "difference": "difference", "error": "error",
}  # fmt: skip
"""What stays of it in a file: nobody swipes there, so both pictures stand side by side."""


def ordered_runs(page: Page) -> tuple[OrderedRun, ...]:
    """The runs that stand on the stage, the page's own first; none where nothing is compared."""
    if page.state.workspace != "compare":
        return ()
    runs = [run for run in page.runs if run.request is not None and not run.trouble]
    is_compared = len(runs) > 1 or page.state.of(CompareState).replays
    if not is_compared or not runs or runs[0].number:
        return ()
    return tuple(
        OrderedRun(run.request, run.run, run.model.source, run.number) for run in runs if run.request is not None
    )


def camera_error_of(compare: CompareState, numbers: tuple[int, ...]) -> int | None:
    """The place among `numbers` of the run whose error stands in the camera's place."""
    chosen = None if compare.camera == "frame" else NAMES.index(compare.camera)
    if chosen in numbers:
        return numbers.index(chosen)
    return 0 if compare.sight == "difference" else None

"""How grey values are shown."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar, Literal

from app.html.pictures import Tones
from app.state.view_state import ViewState
from etnet.render.tone import Tone

if TYPE_CHECKING:
    from app.views.page import Page


@dataclass(frozen=True, slots=True)
class ReconstructionState:
    """`tone` maps the network's raw output, and the camera's frame, to grey levels."""

    view: ClassVar[str] = "reconstruction"
    tone: Tone = "auto"
    shows: Literal["frame", "swipe", "variance"] = "frame"
    """The frame, the frame left of the camera's, or the network's own estimate of its variance."""


def tones_in(state: ViewState, is_linear_light: bool) -> Tones:
    """As a visitor chose."""
    return Tones(state.of(ReconstructionState).tone, is_linear_light)


def tones_of(page: Page) -> Tones:
    """As a visitor chose, of the frames of the page's network."""
    return tones_in(page.state, page.model.is_linear_light)

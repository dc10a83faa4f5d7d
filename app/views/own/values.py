"""What a view of one's own is given and may return."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
from jaxtyping import Float32

from etnet.events.events import Events
from etnet.events.recording import Recording
from etnet.windows import Window

if TYPE_CHECKING:
    from etnet.nets.attention import Attention
    from etnet.nets.base import State, Step


@dataclass(frozen=True, slots=True, eq=False)
class OwnMoment:
    """The current window. What is not there yet is `None`; the view is called again when it is."""

    recording: Recording
    window: Window
    windows: Sequence[Window]
    events: Events
    voxel: Float32[np.ndarray, "bins h w"]
    """The network's input, before a normalisation that some networks add."""
    frame: Float32[np.ndarray, "h w"] | None
    """The network's raw output for this window, not clipped."""
    truth: Float32[np.ndarray, "h w"] | None
    """The camera frame nearest to the window's end, 0 … 1."""
    query: tuple[int, int] | None
    """The chosen pixel (x, y)."""
    attention: Attention | None
    """Of this window, where the network has attention and a pixel is chosen, or the file says `probe = True`."""
    is_exact: bool
    """Whether `frame` is, bit for bit, that of a run from the first window on."""
    step: Step | None = None
    """What the network made of this window: frame, state, attention. Asked for where the file says `probe = True`."""

    @property
    def state(self) -> State | None:
        """What the network carries on from this window; it comes with the step."""
        return None if self.step is None else self.step.state


@dataclass(frozen=True, slots=True, eq=False)
class Plot:
    """Curves: names to values, all over `x` (their place by default)."""

    lines: dict[str, Any]
    x: Any = None
    x_label: str = ""


@dataclass(frozen=True, slots=True, eq=False)
class Table:
    """Rows of cells under their heads."""

    heads: Sequence[str]
    rows: Sequence[Sequence[object]] = field(default_factory=tuple)


@dataclass(frozen=True, slots=True)
class Html:
    """HTML as it stands: the file is its user's own."""

    content: str


@dataclass(frozen=True, slots=True)
class OwnView:
    """What a file or a function says: what to call, and its widgets by name with their first values."""

    title: str
    path: str
    show: Callable[..., Any]
    widgets: dict[str, Any]
    probe: bool = False
    """Whether it asks for the network's step, with its attention."""


def is_slider(first: object) -> bool:
    """Whether a widget's first value is three numbers: from, to, and the first value."""
    return (
        isinstance(first, list | tuple)
        and len(first) == 3
        and all(isinstance(part, int | float) and not isinstance(part, bool) for part in first)
    )

"""What a network has to look into, and why it has not what it lacks: every inspector asks it first."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

from app.engine.playbacks import LoadedPlayback
from app.engine.requests import FrameRequest

if TYPE_CHECKING:
    from etnet.inspection.anatomy import Anatomy


@dataclass(frozen=True, slots=True)
class NetworkParts:
    """A network's anatomy, and one sentence for each inspector that has nothing to show of it."""

    anatomy: Anatomy
    lacks: Mapping[str, str]
    """By `etnet.inspection.anatomy.Inspector`; an inspector that is not in it has something to show."""


def network_parts(model: object) -> NetworkParts:
    """The parts of a network and what it lacks."""
    from typing import get_args

    from etnet.inspection.anatomy import Inspector, anatomy_of, cannot_show

    known: list[Inspector] = list(get_args(Inspector))
    reasons = {name: cannot_show(model, name) for name in known}  # pyright: ignore[reportArgumentType]
    lacks = {str(name): reason for name, reason in reasons.items() if reason is not None}
    return NetworkParts(anatomy_of(model), lacks)  # pyright: ignore[reportArgumentType]  what the engine loads is one


@dataclass(frozen=True, slots=True)
class NetworkPartsJob:
    """The parts of the network of a request; equal for all windows where `request.index` is 0."""

    request: FrameRequest

    def run(self, loaded: LoadedPlayback, cancelled: Callable[[], bool]) -> Iterator[tuple[NetworkParts, float]]:
        """One look at the network itself."""
        yield network_parts(loaded.playback.model), 1.0

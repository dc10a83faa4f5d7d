"""One site's attention over time, and maps that were pinned at another moment."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from jaxtyping import Float32

from app.engine.playbacks import LoadedPlayback
from app.engine.requests import FrameRequest
from app.views.attention.state import PinnedMap, Quantity
from app.views.stretch import NEAR, Path, path_of, paths_of, windows_from
from etnet.nets.intervention import ORIGINAL, Intervention

if TYPE_CHECKING:
    from etnet.inspection.anatomy import Anatomy
    from etnet.inspection.pins import Pin
    from etnet.nets.runtime import Contract


@dataclass(frozen=True, slots=True, eq=False)
class Curve:
    """A quantity of one site window by window, for each head."""

    indices: tuple[int, ...]
    stamps: tuple[int, ...]
    """µs, when each window ends."""
    values: Float32[np.ndarray, "windows heads"]
    """Of an effect the axis has length 1: of the head that is masked, or of the site."""
    pixels: tuple[tuple[int, int], ...]
    """Where the query lay in each window."""
    wanted: int


@dataclass(frozen=True, slots=True)
class PathJob:
    """Where the patch lies in the windows around the current one that lies at a pixel in window `anchor`."""

    request: FrameRequest
    """Its index is the stretch's first window."""
    pixel: tuple[int, int]
    anchor: int

    def run(self, loaded: LoadedPlayback, cancelled: Callable[[], bool]) -> Iterator[tuple[Path, float]]:
        """One window more each time; nothing is decoded."""
        windows = windows_from(loaded.playback, self.request.index)
        path: Path = {}
        for path in paths_of(loaded.playback, windows, self.pixel, self.anchor, cancelled):
            yield path, min(len(path) / (len(windows) + 1), 0.99)
        yield path, 1.0


@dataclass(frozen=True, slots=True)
class CurveJob:
    """One pixel's attention at one site over a stretch, past and coming; one or two decodes a window."""

    request: FrameRequest
    """Its index is the stretch's first window."""
    pixel: tuple[int, int]
    site: str
    quantity: Quantity
    head: int | None
    """The head whose effect is measured; `None` takes the whole site's. Other quantities are of every head."""
    anchor: int | None = None
    """The window in which the patch that is followed lies at the pixel; `None`: none is followed."""

    def run(self, loaded: LoadedPlayback, cancelled: Callable[[], bool]) -> Iterator[tuple[Curve, float]]:
        """One window more each time."""
        from etnet.inspection.anatomy import require

        playback = loaded.playback
        asked = self._of(require(playback.model, "attention"))
        windows = windows_from(playback, self.request.index)
        places = path_of(playback, windows, self.pixel, self.anchor, cancelled)
        found: list[tuple[int, np.ndarray]] = []
        for index in places:
            found.append((index, asked._values(loaded, index, places[index], cancelled)))
            done = tuple(each for each, _ in found)
            yield (
                Curve(
                    done,
                    tuple(playback.windows[each].t_stop for each in done),
                    np.stack([values for _, values in found]),
                    tuple(places[each] for each in done),
                    len(places),
                ),
                len(found) / len(places),
            )

    def _of(self, anatomy: Anatomy) -> CurveJob:
        """The same of a network that may lack the site, or have fewer heads."""
        return replace(self, site=anatomy.site(self.site), head=anatomy.head(self.head))

    def _values(
        self, loaded: LoadedPlayback, index: int, pixel: tuple[int, int], cancelled: Callable[[], bool]
    ) -> Float32[np.ndarray, " heads"]:
        playback = loaded.playback
        if self.quantity == "effect":
            frames = [playback.at(index, intervention=each, cancelled=cancelled).frame for each in (ORIGINAL, self.cut)]
            original, without = (float(frame[0, 0, pixel[1], pixel[0]]) for frame in frames)
            return np.array([without - original], np.float32)
        from etnet.inspection.through_time import attention_through_time

        sites = frozenset({self.site})
        moment = next(attention_through_time(playback, pixel, [index], sites, cancelled=cancelled, near=NEAR))
        return getattr(moment, self.quantity)[0].float().cpu().numpy()

    @property
    def cut(self) -> Intervention:
        """What is taken out for an effect."""
        if self.head is None:
            return Intervention(removed_sites=frozenset({self.site}))
        return Intervention(masked_heads=frozenset({(self.site, self.head)}))


@dataclass(frozen=True, slots=True, eq=False)
class FoundPin:
    """A pin's map, and under which contract it was computed: another network's precision may be another one."""

    pin: Pin
    contract: Contract


@dataclass(frozen=True, slots=True)
class PinJob:
    """The map of a pin, at the pin's own moment and of its own network."""

    pinned: PinnedMap

    @property
    def request(self) -> FrameRequest:
        """The pin's moment."""
        return self.pinned.request

    def run(self, loaded: LoadedPlayback, cancelled: Callable[[], bool]) -> Iterator[tuple[FoundPin, float]]:
        """One decode that is observed."""
        from etnet.inspection.anatomy import require
        from etnet.inspection.pins import pin

        held = self.pinned
        playback, intervention = loaded.playing(held.request)
        anatomy = require(playback.model, "attention")
        site, chosen = anatomy.site(held.site), anatomy.head(held.head)
        head = held.gather if chosen is None else chosen
        index = held.request.index
        found = pin(playback, index, held.query, site, head, held.direction, intervention, cancelled)
        yield FoundPin(found, loaded.contract), 1.0

"""What all cards of the attention workspace are drawn from, or why there is nothing to draw."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from jaxtyping import Float

from app.engine.jobs import JobResult
from app.engine.network_parts import NetworkParts
from app.engine.requests import Ready
from app.html.attention.look import AttentionLook
from app.html.attention.maps import gathered, rows_of, site_in
from app.html.attention.not_maps import not_icon
from app.html.controls import under_way
from app.html.elements import empty
from app.html.moment import ARRAYS
from app.html.units import milliseconds
from app.views.attention.jobs.site import SiteFacts, site_of_word
from app.views.attention.state import AttentionState, look_of, path_of
from app.views.page import Page
from app.views.stretch import Path

if TYPE_CHECKING:
    from etnet.nets.attention import Attention
    from etnet.nets.padding import TokenGrid


@dataclass(frozen=True, slots=True)
class Seen:
    """A frame, the pixel that was chosen on it, and what is known by now; of any network."""

    page: Page
    slice_: AttentionState
    look: AttentionLook
    ready: Ready

    @property
    def site(self) -> str:
        """The chosen site."""
        return self.slice_.site

    @property
    def path(self) -> Path:
        """Where the followed patch lies in the windows around the current one, as far as that is known."""
        return path_of(self.page, self.ready)

    @property
    def is_lost(self) -> bool:
        """Whether the followed patch is not on the sensor in this window."""
        result = self.found("path")
        is_known = result is not None and result.is_whole and bool(self.path)
        return is_known and self.ready.request.index not in self.path

    def found(self, slot: str) -> JobResult | None:
        """What is known of a job; `None` where it was found of another network, recording or plan of windows."""
        found = self.page.results.get(f"attention.{slot}")
        return found if found is not None and found.job.request.playback == self.ready.request.playback else None

    def result(self, slot: str, **asked: object) -> Any:
        """What a job has found, if it answers what is asked now; `None` before that."""
        found = self.found(slot)
        if found is None or any(getattr(found.job, name) != value for name, value in asked.items()):
            return None
        request = found.job.request
        if slot in ("site", "tokens"):
            return found.value if request.frame == self.ready.request.frame else None
        return found.value if request.index == self.ready.request.index or slot == "basis" else None

    def feature(self, slot: Literal["tokens", "basis"]) -> Any:
        """The chosen feature's map, or its basis of colours."""
        word = self.slice_.feature
        return self.result(slot, site=site_of_word(word, self.slice_.site), word=word)


@dataclass(frozen=True, slots=True)
class Shown(Seen):
    """The same with the maps of a network that has attention."""

    attention: Attention

    @property
    def site(self) -> str:
        """The chosen site, or, where this network has no such one, its first."""
        return site_in(self.attention, self.slice_.site)

    @property
    def grid(self) -> TokenGrid:
        """The token grid over the padded sensor."""
        return self.attention.grid

    @property
    def token(self) -> int:
        """The token over the chosen pixel."""
        return self.grid.token_at(*self.look.query)

    @property
    def coarsest(self) -> int:
        """The coarsest scale that has attention."""
        return max(int(name[5]) for name in self.attention.sites)

    @property
    def num_heads(self) -> int:
        """Heads of a site."""
        return len(self.attention.queries[self.site])

    @property
    def uses_values(self) -> bool:
        """Whether maps are what is handed over, not weights: chosen, of a row, and known by now."""
        return self._facts_of_values is not None

    @property
    def _facts_of_values(self) -> SiteFacts | None:
        if self.slice_.weight != "value" or self.look.direction != "attends to":  # values are mixed along rows alone
            return None
        return self.result("site", site=self.slice_.site)

    def weights(self) -> Float[np.ndarray, "heads tokens"]:
        """The chosen site's weights of each head, in the direction that is looked in."""
        return rows_of(self.ready, self.attention, self.site, self.look.query, self.look.direction)

    def rows(self) -> Float[np.ndarray, "heads tokens"]:
        """The chosen site's map of each head: weights, or what is handed over by them as shares of it."""
        facts = self._facts_of_values
        return self.weights() if facts is None else self._handed(facts)[0]

    def row(self) -> Float[np.ndarray, " tokens"]:
        """The chosen map. What all heads together hand over is the norm of their sum: they may cancel."""
        facts = self._facts_of_values
        if facts is not None and self.look.head is None and self.look.gather == "mean":
            return self._handed(facts)[1]
        return gathered(self.rows(), self.look.head, self.look.gather)

    def _handed(self, facts: SiteFacts) -> tuple[np.ndarray, np.ndarray]:
        key = ("handed", self.ready.key, self.site, self.token)
        return ARRAYS.get(key, lambda: _handed_over(facts, self.site, self.token), lambda made: 2 * made[0].nbytes)


def _handed_over(facts: SiteFacts, site: str, token: int) -> tuple[np.ndarray, np.ndarray]:
    from etnet.inspection.mass import value_weighted

    found = value_weighted(facts.attention, site, [token])
    shares = [maps / maps.sum(-1, keepdim=True).clamp_min(1e-20) for maps in (found.by_head[:, 0], found.joint[0])]
    return shares[0].cpu().numpy(), shares[1].cpu().numpy()


def not_button(slice_: AttentionState) -> str:
    """What maps are not, in the large map's place: one click from every card."""
    is_on = slice_.over == "not"
    return not_icon(f"set:attention.over:{'none' if is_on else 'not'}", is_on)


def lacks_attention(page: Page) -> str:
    """Why the page's network has no maps, in one sentence; empty where it has, or while that is not known."""
    found = page.results.get("attention.network")
    if found is None or not page.is_about(found.job.request) or not isinstance(found.value, NetworkParts):
        return ""
    return found.value.lacks.get("attention", "")


def missing(page: Page, is_brief: bool = False) -> str:
    """Why there are no maps yet, and how far they are; empty where there are. `is_brief`: the stage says it."""
    ready, failed = page.ready, page.failed
    if page.moment is None:
        return empty("No recording", page.trouble or "Choose one in the bar.")
    if sentence := lacks_attention(page):
        return empty("No attention", f"{sentence}.")
    if page.state.query is None:
        return empty("Choose a pixel", "Click into the image: every map then shows what the network attends to there.")
    if ready is not None and ready.attention is not None and ready.attention.sites:
        return ""
    if is_brief:
        return '<div class="et-note">Follows with the maps.</div>'
    if failed is not None:
        return empty("No maps", failed.message)
    if ready is None:
        return under_way(0.0, "computing the first image")
    took = f", about {milliseconds(page.step_milliseconds)}" if page.step_milliseconds else ""
    return under_way(0.0, f"one decode for the maps of all heads{took}")


def seen_of(page: Page) -> Seen | None:
    """The newest frame with the chosen pixel, which goes with a patch that is followed; `None` before there is one."""
    look, ready = look_of(page), page.ready
    if look is None or ready is None:
        return None
    seen = Seen(page, page.state.of(AttentionState), look, ready)
    place = seen.path.get(ready.request.index)
    return seen if place is None else replace(seen, look=replace(look, query=place))


def shown_of(page: Page) -> Shown | None:
    """The maps of the newest frame that has them; `None` where `missing` says why."""
    seen = seen_of(page)
    attention = None if seen is None else seen.ready.attention
    if seen is None or attention is None or not attention.sites or lacks_attention(page):
        return None
    shown = Shown(page, seen.slice_, seen.look, seen.ready, attention)
    if seen.look.head is None or seen.look.head < shown.num_heads:
        return shown
    return replace(shown, look=replace(seen.look, head=None))  # this network has fewer


def recurrent_of(page: Page) -> tuple[int, ...]:
    """Recurrent levels whose hidden state can be shown; none while the network is not known."""
    found = page.results.get("attention.network")
    if found is None or not page.is_about(found.job.request) or not isinstance(found.value, NetworkParts):
        return ()
    return () if "hidden" in found.value.lacks else found.value.anatomy.levels

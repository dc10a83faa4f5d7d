"""One site as a whole: its values and sinks, what its tokens hold, and their colours."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from jaxtyping import Bool, Float32

from app.engine.playbacks import LoadedPlayback
from app.engine.requests import FrameRequest
from app.views.attention.state import FeatureWord

if TYPE_CHECKING:
    from etnet.inspection.basis import Basis
    from etnet.inspection.features import Feature, FeatureMap
    from etnet.nets.attention import Attention
    from etnet.nets.padding import TokenGrid
    from etnet.nets.runtime import Contract

NUM_FITTED = 8
"""Windows of the recording that a basis is fitted to."""


@dataclass(frozen=True, slots=True, eq=False)
class SiteFacts:
    """One site's attention with its values, and the tokens that nearly every query attends to."""

    attention: Attention
    sinks: Bool[np.ndarray, "heads tokens"]
    nbytes: int


@dataclass(frozen=True, slots=True)
class SiteJob:
    """q, k and v of one site, of the network as it is changed."""

    request: FrameRequest
    site: str
    """As it is chosen on the page; a network that has none such answers for its first."""

    def run(self, loaded: LoadedPlayback, cancelled: Callable[[], bool]) -> Iterator[tuple[SiteFacts, float]]:
        """One decode that is observed, and one pass over the site's map."""
        from etnet.errors import ModelError
        from etnet.inspection.anatomy import require
        from etnet.inspection.mass import received
        from etnet.nets.attention import AttentionProbe

        playback, intervention = loaded.playing(self.request)
        site = require(playback.model, "attention").site(self.site)
        probe = AttentionProbe(frozenset({site}), values=True)
        attention = playback.at(self.request.index, probe, intervention, cancelled).attention
        if attention is None or site not in attention.sites:
            raise ModelError(f"{playback.model.name} has no attention site {site}; choose one of its maps")
        sinks = received(attention, site).sinks().cpu().numpy()
        yield SiteFacts(attention, sinks, attention.nbytes), 1.0


@dataclass(frozen=True, slots=True, eq=False)
class Tokens:
    """One vector for each cell of a grid that lies over the padded sensor."""

    map: FeatureMap
    contract: Contract
    """Under which it was computed: another network's precision may be another one."""
    nbytes: int

    @property
    def grid(self) -> TokenGrid:
        """The sensor and the zeros around it."""
        return self.map.grid

    def similarity(self, pixel: tuple[int, int], of: Tokens | None = None) -> Float32[np.ndarray, "rows columns"]:
        """Cosine of every token with the one over a pixel, here or in another window or run.

        Raises:
            ValueError: the other network's vectors have another length.
        """
        from etnet.inspection.similarity import cosine_similarity

        return cosine_similarity(self.map, (of or self).map.at(*pixel)).numpy()


def feature_of_word(word: FeatureWord, site: str) -> Feature:
    """What a word of the page means; "tokens" are those that leave the site's layer."""
    from etnet.inspection.features import Feature

    match word:
        case "tokens" | "query" | "key" | "value":
            return Feature(word, site)
        case "context":
            return Feature("context")
    return Feature("hidden", level=int(word.removeprefix("hidden ")))


def feature_in(loaded: LoadedPlayback, word: FeatureWord, site: str) -> Feature:
    """The same, of a network that may have no such site."""
    from etnet.inspection.anatomy import anatomy_of

    return feature_of_word(word, anatomy_of(loaded.playback.model).site(site))


def site_of_word(word: FeatureWord, site: str) -> str:
    """The site, or nothing where the feature is of none: equal questions are then asked once."""
    return site if word in ("tokens", "query", "key", "value") else ""


@dataclass(frozen=True, slots=True)
class TokensJob:
    """One feature of a window, of the network as it is changed. Any pixel's similarity follows from it."""

    request: FrameRequest
    site: str
    word: FeatureWord = "tokens"

    def run(self, loaded: LoadedPlayback, cancelled: Callable[[], bool]) -> Iterator[tuple[Tokens, float]]:
        """One pass of TPA."""
        from etnet.inspection.features import feature_of, require_feature
        from etnet.inspection.pyramid import hold

        playback, intervention = loaded.playing(self.request)
        feature, index = feature_in(loaded, self.word, self.site), self.request.index
        require_feature(playback.model, feature)
        change = intervention if playback is loaded.playback else playback.intervention_at(index)
        found = feature_of(hold(playback, index, cancelled), feature, change)
        yield Tokens(found, loaded.contract, found.values.nbytes), 1.0


@dataclass(frozen=True, slots=True)
class BasisJob:
    """Three directions for a feature, fitted once a recording, so that colours keep their meaning in play."""

    request: FrameRequest
    site: str
    word: FeatureWord = "tokens"

    def run(self, loaded: LoadedPlayback, cancelled: Callable[[], bool]) -> Iterator[tuple[Basis | None, float]]:
        """One window more that it is fitted to each time; the basis at last."""
        from etnet.inspection.basis import fit_basis, sampled_maps, sampled_windows

        since = loaded.first_there
        wanted = len(sampled_windows(len(loaded.playback), NUM_FITTED, since))
        maps = []
        feature = feature_in(loaded, self.word, self.site)
        for map_ in sampled_maps(loaded.playback, feature, NUM_FITTED, cancelled=cancelled, since=since):
            maps.append(map_)
            if len(maps) < wanted:
                yield None, len(maps) / (wanted + 1)
        yield fit_basis(maps), 1.0

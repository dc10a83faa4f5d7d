"""What one place of a network holds as a vector: tokens, q, k, v of a site, the aggregated context, recurrent state."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal, get_args

import torch
from einops import rearrange
from jaxtyping import Float
from torch import Tensor

from etnet.errors import ModelError
from etnet.inspection.anatomy import Inspector, require
from etnet.inspection.pyramid import Held, hold
from etnet.inspection.sites import Site
from etnet.nets.attention import AttentionProbe, Observer
from etnet.nets.base import Reconstructor
from etnet.nets.etnet import ETNet
from etnet.nets.intervention import Intervention
from etnet.nets.padding import PATCH, TokenGrid
from etnet.nets.positions import ORIGIN
from etnet.nets.runtime import precision_of
from etnet.playback.playback import Playback

FeatureKind = Literal["tokens", "query", "key", "value", "context", "hidden", "cell"]
_OF_A_SITE, _OF_A_LEVEL = ("tokens", "query", "key", "value"), ("hidden", "cell")


@dataclass(frozen=True, slots=True)
class Feature:
    """Which vectors; hashable, so that a basis can be kept for it.

    "tokens" are those that leave the site's layer, "query", "key" and "value" what its heads are given (of all heads,
    one behind the other, or of one), "context" the aggregated tokens that the upsampler gets, "hidden" and "cell" the
    state of a recurrent level.
    """

    kind: FeatureKind
    site: str | None = None
    head: int | None = None
    level: int | None = None

    def __post_init__(self) -> None:
        if self.kind not in get_args(FeatureKind):
            raise ModelError(f"a feature is of kind {self.kind!r}; it takes {', '.join(get_args(FeatureKind))}")
        if (self.site is not None) != (self.kind in _OF_A_SITE):
            raise ModelError(f"{self.kind}: got site {self.site}; {', '.join(_OF_A_SITE)} are of a site, no others are")
        if (self.level is not None) != (self.kind in _OF_A_LEVEL):
            raise ModelError(f"{self.kind}: got level {self.level}; hidden and cell are of a level, no others are")
        if self.head is not None and self.kind not in ("query", "key", "value"):
            raise ModelError(f"{self.kind}: got head {self.head}; heads have queries, keys and values alone")


@dataclass(frozen=True, slots=True, eq=False)
class FeatureMap:
    """One feature of one window, laid out over the padded sensor in cells of `cell` × `cell` pixels."""

    feature: Feature
    index: int
    values: Float[Tensor, "rows columns channels"]
    cell: int
    grid: TokenGrid
    """The sensor and the zeros around it."""
    padded: bool = True
    """Whether cells lie over the padded sensor, or over the sensor alone (FireNet)."""

    def place_of(self, x: int, y: int) -> tuple[int, int]:
        """Row and column of the cell over a pixel of the sensor."""
        if not (0 <= x < self.grid.width and 0 <= y < self.grid.height):
            raise ValueError(
                f"pixel ({x}, {y}) lies outside the sensor of {self.grid.width} × {self.grid.height}; take one inside"
            )
        top, left = (self.grid.top, self.grid.left) if self.padded else (0, 0)
        return (y + top) // self.cell, (x + left) // self.cell

    def at(self, x: int, y: int) -> Float[Tensor, " channels"]:
        """The vector of the cell over a pixel."""
        return self.values[self.place_of(x, y)]


def feature_map(
    playback: Playback,
    index: int,
    feature: Feature,
    cancelled: Callable[[], bool] | None = None,
) -> FeatureMap:
    """The feature of window `index`, in fp32; of a branch as the branch's change leaves it."""
    require_feature(playback.model, feature)
    return feature_of(hold(playback, index, cancelled), feature, playback.intervention_at(index))


def feature_of(held: Held, feature: Feature, intervention: Intervention) -> FeatureMap:
    """The feature of a moment that is held."""
    grid = TokenGrid(held.pyramid.height, held.pyramid.width)
    if feature.level is not None:
        return _of_level(held, feature, grid)
    tokens = _passed(held, feature, intervention)
    values = rearrange(tokens.float().cpu(), "(i j) d -> i j d", i=grid.rows)
    return FeatureMap(feature, held.index, values, PATCH, grid)


def _of_level(held: Held, feature: Feature, grid: TokenGrid) -> FeatureMap:
    parts = require(held.model, "hidden")
    level = feature.level or 0
    if level not in parts.levels:
        raise ModelError(f"level {level} asked for; {parts.name} has {', '.join(map(str, parts.levels))}")
    is_lstm = parts.memory == "ConvLSTM"
    tensor = held.state.tensors[2 * (level - 1) + (feature.kind == "cell") if is_lstm else level - 1]
    values = rearrange(tensor[0].float().cpu(), "c i j -> i j c")
    return FeatureMap(feature, held.index, values, 2**level if is_lstm else 1, grid, is_lstm)


def _passed(held: Held, feature: Feature, intervention: Intervention) -> Float[Tensor, "n d"]:
    """Pass TPA once, without the upsampler, and keep what was asked for."""
    model = held.model
    assert isinstance(model, ETNet)
    # A probe, even of nothing, makes TPA pass all layers where its result is taken away.
    sites = frozenset(() if feature.site is None else (feature.site,))
    observer = Observer(AttentionProbe(sites, values=True), intervention)
    layer_tokens: list[Tensor] = []
    watch = None
    if feature.kind == "tokens":
        watch = _layer(model, feature.site or "").register_forward_hook(
            lambda _module, _given, tokens: layer_tokens.append(tokens.detach())
        )
    try:
        with torch.inference_mode(), precision_of(model.runtime, held.pyramid.levels[0].device.type):
            context = model.tpa(held.pyramid.levels, observer, ORIGIN)
    finally:
        if watch is not None:
            watch.remove()
    if feature.kind == "context":
        return rearrange(context[0], "d i j -> (i j) d")
    if feature.kind == "tokens":
        return layer_tokens[0][0]
    kept = {"query": observer.queries, "key": observer.keys, "value": observer.values}[feature.kind]
    by_head = kept.get(feature.site or "")  # "heads n d"
    if by_head is None:
        raise ModelError(f"{feature.site} is ablated here and has no {feature.kind}; reset it, or ask for its tokens")
    if feature.head is None:
        return rearrange(by_head, "h n d -> n (h d)")
    if not 0 <= feature.head < len(by_head):
        raise ModelError(f"head {feature.head} of {len(by_head)}; heads are counted from 0")
    return by_head[feature.head]


def _layer(model: ETNet, name: str) -> torch.nn.Module:
    site = Site.of(name)
    layers = model.tpa.encoders if site.part == "encoder" else model.tpa.decoders
    return layers[str(site.scale)][site.layer]  # pyright: ignore[reportIndexIssue]


def require_feature(model: Reconstructor, feature: Feature) -> None:
    """Raises `ModelError` where a network has no such feature."""
    asked: Inspector = "cell" if feature.kind == "cell" else "hidden" if feature.kind == "hidden" else "tokens"
    parts = require(model, asked)
    if feature.site is not None and feature.site not in parts.sites:
        raise ModelError(f"{feature.site!r} is no attention site of {parts.name}; it has {', '.join(parts.sites)}")

"""What a network has to look into, and one sentence for each inspector that it has nothing to show in."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

from etnet.errors import ModelError
from etnet.nets.abilities import abilities_of, lacking
from etnet.nets.adapter import Adapter
from etnet.nets.base import Reconstructor
from etnet.nets.blocks import ConvGRU
from etnet.nets.etnet import ETNet

Inspector = Literal[
    "attention",
    "atlas",
    "rollout",
    "tokens",
    "hidden",
    "cell",
    "gates",
    "ablation",
    "intervention",
    "levels",
    "gradient",
]
"""What can be asked of a network. "attention" covers rows, columns, values, links, and maps through time."""


@dataclass(frozen=True, slots=True)
class Anatomy:
    """The parts of one network. An empty field is a part that it does not have."""

    name: str
    sites: tuple[str, ...] = ()
    """Attention sites, in the order in which the network passes them."""
    num_heads: int = 0
    """Heads of each site."""
    scales: tuple[int, ...] = ()
    """Scales that are aggregated, from the coarsest."""
    has_decoders: bool = False
    skips: tuple[int, ...] = ()
    """Skip connections, from the coarsest; 0 is the head's."""
    levels: tuple[int, ...] = ()
    """Recurrent levels, from the finest."""
    memory: Literal["ConvLSTM", "ConvGRU", "unknown"] = "unknown"
    is_split: bool = True
    """Whether `decode` is apart from the recurrent part, so that a kept state gives its frame with no replay."""
    gradients: Literal["yes", "no", "unknown"] = "yes"
    """Whether a gradient comes back from the frame; of somebody's own function only the attempt tells."""

    def site(self, wanted: str) -> str:
        """`wanted`, or the first of its sites where it has none such: another network's sites have other names."""
        return self.sites[0] if self.sites and wanted not in self.sites else wanted

    def head(self, wanted: int | None) -> int | None:
        """`wanted`, or all heads (`None`) where a site has not so many."""
        return None if wanted is None or wanted >= self.num_heads else wanted

    @property
    def can_intervene(self) -> bool:
        """Whether parts of it can be switched off or changed."""
        return bool(self.sites or self.scales or self.skips or self.levels)


def anatomy_of(model: Reconstructor) -> Anatomy:
    """The parts of `model`, by what it declares (`etnet.nets.abilities`) and, of our own, how they are laid out."""
    whole: Any = model
    name, able = str(model.name), abilities_of(model)
    is_declared = hasattr(model, "abilities") and not isinstance(model, Adapter)
    gradients = "yes" if able.gradients else "no" if is_declared else "unknown"
    levels = tuple(range(1, able.levels + 1))
    memories = getattr(whole, "memories", ())
    gru = [block for block in memories if isinstance(block, ConvGRU)]
    memory = "ConvLSTM" if able.gates else "ConvGRU" if gru else "unknown"
    skips: tuple[int, ...] = ()
    if "removed_skips" in able.interventions:
        skips = tuple(sorted(getattr(getattr(whole, "config", None), "skip_levels", ()), reverse=True))
    if not able.attention or not isinstance(model, ETNet):
        is_split = not isinstance(model, Adapter)
        return Anatomy(name, skips=skips, levels=levels, memory=memory, is_split=is_split, gradients=gradients)
    config = model.config
    encoders = [f"encoder.{layer}.self" for layer in range(config.encoder_depth)]
    decoders = [f"decoder.{layer}.{kind}" for layer in range(config.decoder_depth) for kind in ("self", "cross")]
    # All encoders are passed before the first decoder.
    sites = [f"scale{scale}.{place}" for places in (encoders, decoders) for scale in config.scale_indices
             for place in places]  # fmt: skip
    return Anatomy(
        name, tuple(sites), config.heads, config.scale_indices, config.decoder_depth > 0, skips, levels, memory
    )


def cannot_show(model: Reconstructor, inspector: Inspector) -> str | None:
    """Why an inspector has nothing to show of this network, in one sentence; `None` where it has."""
    parts = anatomy_of(model)
    match inspector:
        case "attention" | "atlas" | "rollout" | "tokens" if not parts.sites:
            return f"{parts.name} has no attention, so there are no maps, heads or tokens to show"
        case "hidden" if parts.memory == "unknown":
            return f"{parts.name} does not say which of its state is a hidden map, so none can be shown"
        case "gates" | "cell" if parts.memory != "ConvLSTM":
            return f"{parts.name} has no ConvLSTM levels, so there are no cells or gates to show"
        case "ablation" if not (parts.scales or parts.skips):
            return f"{parts.name} has neither scales nor skips, so there is no part to ablate"
        case "levels" if not parts.levels:
            return str(lacking(model, "levels")).rstrip(".")
        case "gradient" if parts.gradients == "no":
            return str(lacking(model, "gradients")).rstrip(".")
        case "intervention" if not parts.can_intervene:
            return f"{parts.name} names no part of itself, so nothing inside it can be switched off or changed"
    return None


def require(model: Reconstructor, inspector: Inspector) -> Anatomy:
    """The parts of `model`; raises `ModelError` with the sentence of `cannot_show`."""
    reason = cannot_show(model, inspector)
    if reason is not None:
        raise ModelError(reason)
    return anatomy_of(model)

"""What can be observed or changed inside a network, declared by the network itself."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Literal

from etnet.nets.intervention import Intervention

Ability = Literal["attention", "gates", "levels", "gradients", "split", "variance"]


@dataclass(frozen=True, slots=True)
class Abilities:
    """The defaults describe a network of which nothing is known but that it steps."""

    attention: bool = False
    """`decode` answers a probe. Where this is true, `None` from `decode` means that no probe was passed."""
    levels: int = 0
    """Recurrent levels whose state an intervention can zero or freeze, numbered from 1 (finest)."""
    gates: bool = False
    """The levels are ConvLSTMs whose gates can be recomputed from the voxel grid and the state before."""
    gradients: bool = False
    """The frame is differentiable with respect to the voxel grid."""
    split: bool = False
    """`decode` has no memory and does the larger part of the work, so that a seek replays `encode` alone."""
    variance: bool = False
    """The network estimates a variance for each pixel (`Step.variance`)."""
    interventions: frozenset[str] = frozenset()
    """Fields of `Intervention` that this network follows; the others change nothing or are refused."""

    def has(self, ability: Ability) -> bool:
        """Whether the network can do this at all."""
        return bool(getattr(self, ability))


ALL_INTERVENTIONS = frozenset(field.name for field in fields(Intervention))
STATE_INTERVENTIONS = frozenset({"zeroed_levels", "frozen_levels"})

_LACKS: dict[Ability, str] = {
    "attention": "has no attention, so there are no attention maps to show",
    "levels": "has no recurrent levels that can be told apart, so its state can be neither zeroed nor frozen",
    "gates": "has no ConvLSTM, so there are no gates to show",
    "gradients": "passes no gradient back to its input, so its pixels cannot be attributed to events",
    "split": "gives whole steps only, so a seek replays every step in full",
    "variance": "estimates no variance, so there is no uncertainty map to show",
}


def abilities_of(model: object) -> Abilities:
    """What a network declares; nothing for one that declares nothing."""
    declared = getattr(model, "abilities", None)
    return declared if isinstance(declared, Abilities) else Abilities()


def lacking(model: object, ability: Ability) -> str | None:
    """One sentence that says what cannot be shown of this network and why; `None` where it can."""
    if abilities_of(model).has(ability):
        return None
    return f"{getattr(model, 'name', type(model).__name__)} {_LACKS[ability]}."

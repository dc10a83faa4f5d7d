"""What can be switched off or changed inside a network, as a value. `Intervention()` changes nothing, to the bit."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Intervention:
    """Changes to one pass through a network; hashable, so that caches can be keyed by it.

    Sites are named as in `Attention` ("scale1.encoder.2.self"), scales and skips by the paper's index
    (1 is the finest of three scales, skip 0 is the head's), levels are the recurrent levels 1 … 3.
    """

    masked_heads: frozenset[tuple[str, int]] = frozenset()
    """(site, head): this head's output is zero."""
    removed_sites: frozenset[str] = frozenset()
    """The attention of these sites adds nothing to its residual."""
    uniform_sites: frozenset[str] = frozenset()
    """These sites attend to every token alike."""
    removed_scales: frozenset[int] = frozenset()
    """The token streams of these scales are left out of the mean (paper, f^TPA)."""
    removed_skips: frozenset[int] = frozenset()
    """These skip connections from backbone to upsampler carry nothing."""
    zeroed_levels: frozenset[int] = frozenset()
    """The recurrent state of these levels is zero before the step."""
    frozen_levels: frozenset[int] = frozenset()
    """The recurrent state of these levels stays as it was before the step."""
    uniform_attention: bool = False
    """Every site attends to every token alike."""
    without_decoders: bool = False
    """The transformer decoders' streams are left out of the mean."""
    without_context: bool = False
    """TPA's output is zero: the upsampler sees the skips alone."""

    @property
    def changes_memory(self) -> bool:
        """Whether later frames differ too, and not only the frames decoded under it."""
        return bool(self.zeroed_levels or self.frozen_levels)


ORIGINAL = Intervention()

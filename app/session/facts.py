"""What a page says of a network, from its entry in the catalogue."""

from __future__ import annotations

from app.catalogue.models import ModelEntry
from app.html.provenance import ModelFacts


def facts_of(entry: ModelEntry) -> ModelFacts:
    """Name, trained band, card, tone, and what the command line calls it."""
    source = entry.source if isinstance(entry.source, str) else entry.source.name
    return ModelFacts(
        entry.title,
        entry.trained_band,
        entry.card,
        entry.is_linear_light,
        source,
        entry.architecture,
        entry.is_untrained,
    )

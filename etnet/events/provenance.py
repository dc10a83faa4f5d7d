"""How a recording was made, where a program made it: kept in the formats that have a place for it, told on opening."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from etnet.plain_values import PlainError, bounded_json

ATTRIBUTES = ("source", "simulation", "settings", "remarks")
"""The names by which files keep it. `settings` is what our data sets for training have in place of `simulation`."""
_LONGEST = 60_000
_UNPRINTABLE = re.compile("[^\\t\\x20-\\x7e\\xa0-\\ud7ff\\ue000-\\ufffd\\U00010000-\\U0010ffff]+")


@dataclass(frozen=True, slots=True)
class Provenance:
    """What a simulated recording was made of, with which parameters (JSON), and what was said while it was made."""

    source: str
    parameters: str
    remarks: str = ""

    @property
    def as_attributes(self) -> dict[str, str]:
        """Under the names that every format keeps it by; one line each, of letters that can be shown."""
        named = {"source": self.source, "simulation": self.parameters, "remarks": self.remarks}
        return {name: _UNPRINTABLE.sub(" ", text) for name, text in named.items() if text}

    @property
    def sentences(self) -> list[str]:
        """In words, the longest part cut."""
        made = f"{self.source[:200]}, with {self.parameters[:4000]}"
        return [made] if not self.remarks else [made, f"said when it was simulated: {self.remarks[:2000]}"]


def provenance_of(attributes: Mapping[str, Any]) -> Provenance | None:
    """What a file's attributes tell of its making; None where they tell no parameters."""
    texts = {name: _text(attributes.get(name)) for name in ATTRIBUTES}
    parameters = texts["simulation"] or texts["settings"]
    if not parameters or not _is_json(parameters):
        return None
    return Provenance(texts["source"] or "simulated", parameters, texts["remarks"])


def _text(value: object) -> str:
    if isinstance(value, bytes):
        value = value.decode("utf-8", "replace")
    return _UNPRINTABLE.sub(" ", value[:_LONGEST]) if isinstance(value, str) else ""


def _is_json(text: str) -> bool:
    try:
        return isinstance(bounded_json(text, _LONGEST, endless="none"), dict)
    except PlainError:
        return False

"""The bar keeps nothing of its own."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar


@dataclass(frozen=True, slots=True)
class AppearanceState:
    """The bar keeps nothing of its own."""

    view: ClassVar[str] = "appearance"
